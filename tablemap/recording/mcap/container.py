"""An MCAP on any seekable binary file: its channels, and their messages in time order.

If the file has a summary, only chunks with wanted channels and times are read. A file without a
summary, or one that is cut short or damaged, is read once from front to back to rebuild the index;
unreadable parts give warnings. Memory holds one chunk, or several if they overlap in time.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import BinaryIO

import numpy as np
from mcap import records as mcap_records
from mcap.opcode import Opcode

from tablemap.config import LimitsConfig
from tablemap.config.limits import MIB
from tablemap.errors import ProcessWarning, RecordingError
from tablemap.geometry import Ints
from tablemap.recording.mcap.chunks import Unpacked, parse_chunk, unpack
from tablemap.recording.mcap.index import MAGIC, PARSE_ERRORS, Losses, Span, Totals, no_time
from tablemap.recording.mcap.rebuilding import read_through
from tablemap.recording.mcap.records import RECORD_HEADER, DamageError, Messages, stream_of
from tablemap.recording.mcap.salvage import Sieve, records_of
from tablemap.recording.mcap.summary import read_summary
from tablemap.recording.raw import LATEST_NS, Channel, RawMessage

MAX_HELD_BYTES = 256 * MIB
"""Bytes of overlapping chunks held for sorting; beyond it messages come in the file's order."""


@dataclass(eq=False)
class _Cursor:
    """A span's messages that are still to come out, and which of them is next."""

    messages: Messages
    order: list[int]
    place: int = 0

    @property
    def time_ns(self) -> int:
        return self.messages.times_ns[self.order[self.place]]


class Container:
    """An opened MCAP: a `tablemap.recording.raw.Source`.

    Losses are appended to ``warnings`` as they are met.

    ``counts`` (messages a channel) and the log times ``start_ns`` and ``end_ns`` come from the
    summary, or from reading the whole file. Raises `RecordingError` for a file that is no MCAP.
    """

    def __init__(
        self,
        file: BinaryIO,
        *,
        warnings: list[ProcessWarning] | None = None,
        limits: LimitsConfig | None = None,
    ) -> None:
        self._file = file
        self.limits = limits or LimitsConfig()
        self.warnings: list[ProcessWarning] = [] if warnings is None else warnings
        self._losses = Losses(self.warnings)
        self._sound: set[int] = set()  # offsets of chunks
        if self._read_at(0, len(MAGIC)) != MAGIC:
            raise RecordingError("The file does not begin like an MCAP.")
        self.profile, self.library = self._read_header()
        self._totals = Totals(self.limits, file.seek(0, 2))
        index = read_summary(file, self._losses, self._totals)
        index = index or read_through(file, self._losses, self._totals)
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
        log_times_ns: Ints | None = None,
    ) -> Iterator[RawMessage]:
        """Yield the channels' messages in log time order, in [start, end] or at given log times.

        Chunks that overlap in time are merged, within `MAX_HELD_BYTES`.
        """
        wanted = frozenset(channels)
        times = None if log_times_ns is None else np.unique(np.asarray(log_times_ns, np.int64))
        exact = None if times is None else frozenset(times.tolist())
        first = -1 if start_ns is None else start_ns
        last = 2**64 if end_ns is None else end_ns
        heap: list[tuple[int, int, int, _Cursor]] = []
        held, last_time = 0, time.monotonic()
        spans = [
            span for span in self.spans_of(wanted) if span.end_ns >= first and span.start_ns <= last
        ]
        for span in spans if times is None else _with_any(spans, times):
            while heap and (heap[0][0] < span.start_ns or held + span.unpacked > MAX_HELD_BYTES):
                message, freed = _pop(heap)
                held -= freed
                yield message
                last_time = time.monotonic()
            self._check_idle(last_time)
            found = self.span_messages(span, wanted)
            order = [
                place
                for place in found.by_time()
                if first <= found.times_ns[place] <= last
                and (exact is None or found.times_ns[place] in exact)
            ]
            if order:
                cursor = _Cursor(found, order)
                heapq.heappush(heap, (cursor.time_ns, span.offset, 0, cursor))
                held += len(found.data)
        while heap:
            yield _pop(heap)[0]

    def sample(self, channels: Collection[int], *, most: int) -> tuple[Iterator[RawMessage], bool]:
        """Return the messages of at most ``most`` spans, and whether these are all."""
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

    def span_messages(self, span: Span, wanted: Collection[int]) -> Messages:
        """Return one span's messages of the wanted channels, in the file's order."""
        found = Messages(memoryview(b""))

        def say(error: DamageError) -> None:
            if span.whole:
                found.damaged = True
                self._losses.damaged(span.offset, error, partly=True)

        try:
            records = self._span_records(span)
            self._totals.unpacked(span.offset, len(records.data))
            found.data = records.data
            sieve = Sieve(self.channels, span.start_ns, span.end_ns)
            for _ in found.take(records_of(records, sieve, self.limits, say=say), wanted):
                pass  # the index has the definitions already
        except DamageError as error:
            if span.whole:
                self._losses.damaged(span.offset, error)
        if found.unsound:
            self._losses.damaged(span.offset, no_time(found.unsound), partly=True)
        # A few small messages must not keep a whole chunk in memory until their turn comes.
        found.compact()
        return found

    def _span_records(self, span: Span) -> Unpacked:
        most = self.limits.record_mib * MIB
        if span.length > most + RECORD_HEADER.size:
            raise DamageError(f"has {span.length / MIB:.0f} MiB, {self.limits.over('record_mib')}")
        data = memoryview(self._read_at(span.offset, span.length))
        if not span.is_chunk:
            return Unpacked(data, None)
        if len(data) < RECORD_HEADER.size:
            raise DamageError("lies beyond the end of the file")
        opcode, length = RECORD_HEADER.unpack_from(data)
        if opcode != Opcode.CHUNK or (span.whole and length != len(data) - RECORD_HEADER.size):
            raise DamageError("is not the chunk that the index says")
        chunk = parse_chunk(data[RECORD_HEADER.size :], whole=span.whole)
        # The recording is read several times; a checksum that held needs no other look.
        if span.offset in self._sound:
            chunk = replace(chunk, crc=0)
        unpacked = unpack(chunk, self.limits, whole=span.whole)
        if unpacked.damage is None:
            self._sound.add(span.offset)
        return unpacked

    def _check_idle(self, since: float) -> None:
        if time.monotonic() - since > self.limits.idle_seconds:
            raise RecordingError(
                "Nothing that is wanted was found in the recording for "
                f"{time.monotonic() - since:.0f} s, {self.limits.over('idle_seconds')}."
            )

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


def _pop(heap: list[tuple[int, int, int, _Cursor]]) -> tuple[RawMessage, int]:
    """Take the earliest message; return it, and the number of bytes that this freed."""
    _, offset, _, cursor = heap[0]
    message = cursor.messages[cursor.order[cursor.place]]
    cursor.place += 1
    if cursor.place < len(cursor.order):
        heapq.heapreplace(heap, (cursor.time_ns, offset, cursor.place, cursor))
        return message, 0
    heapq.heappop(heap)
    return message, len(cursor.messages.data)


def _with_any(spans: list[Span], times_ns: Ints) -> list[Span]:
    """Return the spans that some of the times (n,), ascending, lie in."""
    starts = np.array([min(span.start_ns, LATEST_NS) for span in spans], dtype=np.int64)
    ends = np.array([min(span.end_ns, LATEST_NS) for span in spans], dtype=np.int64)
    begun = np.searchsorted(times_ns, starts, side="left")
    holds = begun < np.searchsorted(times_ns, ends, side="right")
    return [span for span, any_time in zip(spans, holds.tolist(), strict=True) if any_time]
