"""An MCAP on any seekable binary file: which channels it has, and their messages in time order.

Where the file has a summary, only the chunks that hold wanted channels and times are read. A file
without one, cut short or damaged is read front to back once, which rebuilds the index; what could
not be read becomes a warning. Memory holds one chunk, or as many as overlap in time.
"""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterator
from typing import BinaryIO

import numpy as np
from mcap import records as mcap_records
from mcap.opcode import Opcode
from numpy.typing import NDArray

from tablemap.errors import ProcessWarning, RecordingError
from tablemap.recording.mcap.chunks import (
    RECORD_HEADER,
    DamageError,
    parse_chunk,
    parse_message,
    split,
    stream_of,
    unpack,
)
from tablemap.recording.mcap.index import (
    MAGIC,
    PARSE_ERRORS,
    Losses,
    Span,
    read_summary,
    read_through,
)
from tablemap.recording.raw import Channel, RawMessage

MAX_HELD_BYTES = 256 * 2**20
"""Messages of overlapping chunks held for sorting; beyond it they come out in the file's order."""


class Container:
    """An opened MCAP: a `tablemap.recording.raw.Source`.

    Losses are appended to ``warnings`` as they are met.

    ``counts`` (messages a channel) and the log times ``start_ns`` and ``end_ns`` are the summary's,
    or counted where the file was read front to back. Raises `RecordingError` for what is no MCAP.
    """

    def __init__(self, file: BinaryIO, *, warnings: list[ProcessWarning] | None = None) -> None:
        self._file = file
        self.warnings: list[ProcessWarning] = [] if warnings is None else warnings
        self._losses = Losses(self.warnings)
        if self._read_at(0, len(MAGIC)) != MAGIC:
            raise RecordingError("The file does not begin as an MCAP does.")
        self.profile, self.library = self._read_header()
        index = read_summary(file, self._losses) or read_through(file, self._losses)
        self.channels = {
            id: _with_schema(channel, index.schemas.get(channel.schema_id))
            for id, channel in sorted(index.channels.items())
        }
        self.counts = {id: index.counts.get(id, 0) for id in self.channels}
        self.spans = sorted(index.spans, key=lambda span: (span.start_ns, span.offset))
        self.start_ns, self.end_ns = index.start_ns, index.end_ns

    def messages(
        self,
        channels: Collection[int],
        *,
        start_ns: int | None = None,
        end_ns: int | None = None,
        log_times_ns: NDArray[np.int64] | None = None,
    ) -> Iterator[RawMessage]:
        """Yield the channels' messages in log time order, in [start, end] or at given log times.

        Chunks that overlap in time are merged, within `MAX_HELD_BYTES`.
        """
        wanted = frozenset(channels)
        times = None if log_times_ns is None else np.unique(np.asarray(log_times_ns, np.int64))
        exact = None if times is None else frozenset(times.tolist())
        first = -1 if start_ns is None else start_ns
        last = 2**64 if end_ns is None else end_ns
        heap: list[tuple[int, int, int, RawMessage]] = []
        held = 0
        for span in self.spans_of(wanted):
            if span.end_ns < first or span.start_ns > last:
                continue
            if times is not None and not _any_within(times, span):
                continue
            while heap and (heap[0][0] < span.start_ns or held > MAX_HELD_BYTES):
                message = heapq.heappop(heap)[3]
                held -= len(message.data)
                yield message
            for order, message in enumerate(self.span_messages(span, wanted)):
                time = message.log_time_ns
                if first <= time <= last and (exact is None or time in exact):
                    heapq.heappush(heap, (time, span.offset, order, message))
                    held += len(message.data)
        while heap:
            yield heapq.heappop(heap)[3]

    def sample(self, channels: Collection[int], *, most: int) -> tuple[Iterator[RawMessage], bool]:
        """Return the messages of at most so many spans, and whether these are all."""
        spans = self.spans_of(channels)
        step = max(len(spans) / most, 1.0)
        places = np.arange(0, len(spans), step).astype(int).tolist()
        chosen = sorted({*places, *range(len(spans))[-1:]})
        wanted = frozenset(channels)
        sampled = (raw for place in chosen for raw in self.span_messages(spans[place], wanted))
        return sampled, len(chosen) == len(spans)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def spans_of(self, channels: Collection[int]) -> list[Span]:
        """Return the spans that may hold messages of the channels, in order of their start."""
        wanted = frozenset(channels)
        return [span for span in self.spans if span.channels is None or span.channels & wanted]

    def span_messages(self, span: Span, wanted: Collection[int]) -> list[RawMessage]:
        """Return one span's messages of the wanted channels, in the file's order."""
        messages: list[RawMessage] = []
        try:
            data = self._span_records(span)
            for opcode, content in split(data):
                if opcode == Opcode.MESSAGE:
                    message = parse_message(content)
                    if message.channel_id in wanted:
                        messages.append(message)
        except DamageError as error:
            if span.whole:
                self._losses.damaged(span.offset, error)
            return messages
        # A few small messages must not keep a whole chunk in memory until their turn comes.
        if 4 * sum(len(message.data) for message in messages) < len(data):
            return [m._replace(data=memoryview(bytes(m.data))) for m in messages]
        return messages

    def _span_records(self, span: Span) -> memoryview:
        data = memoryview(self._read_at(span.offset, span.length))
        if not span.is_chunk:
            return data
        if len(data) < RECORD_HEADER.size:
            raise DamageError("lies beyond the end of the file")
        opcode, length = RECORD_HEADER.unpack_from(data)
        if opcode != Opcode.CHUNK or (span.whole and length != len(data) - RECORD_HEADER.size):
            raise DamageError("is not the chunk that the index says")
        chunk = parse_chunk(data[RECORD_HEADER.size :], whole=span.whole)
        return unpack(chunk, whole=span.whole)

    def _read_at(self, offset: int, length: int) -> bytes:
        self._file.seek(offset)
        return self._file.read(length)

    def _read_header(self) -> tuple[str, str]:
        """Return the profile and the writing library, empty where the header is damaged."""
        start = self._read_at(len(MAGIC), RECORD_HEADER.size)
        if len(start) < RECORD_HEADER.size:
            return "", ""
        opcode, length = RECORD_HEADER.unpack(start)
        if opcode != Opcode.HEADER or length > 2**20:
            return "", ""
        try:
            content = memoryview(self._file.read(length))
            header = mcap_records.Header.read(stream_of(content))
        except PARSE_ERRORS:
            return "", ""
        return header.profile, header.library


def _with_schema(channel: mcap_records.Channel, schema: mcap_records.Schema | None) -> Channel:
    return Channel(
        channel.id,
        channel.topic,
        channel.message_encoding,
        schema.name if schema else "",
        schema.encoding if schema else "",
        schema.data if schema else b"",
        channel.metadata,
    )


def _any_within(times_ns: NDArray[np.int64], span: Span) -> bool:
    first = np.searchsorted(times_ns, span.start_ns, side="left")
    return bool(first < np.searchsorted(times_ns, span.end_ns, side="right"))
