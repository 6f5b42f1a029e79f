"""Where an MCAP's messages lie: from its summary, or else from reading it front to back."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field, replace
from typing import BinaryIO

from mcap import records as mcap_records
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from tablemap.errors import ProcessWarning
from tablemap.recording.mcap.chunks import (
    MAX_RECORD_BYTES,
    RECORD_HEADER,
    DamageError,
    parse_chunk,
    parse_message,
    split,
    stream_of,
    unpack,
)

MAGIC = b"\x89MCAP0\r\n"
PARSE_ERRORS = (McapError, struct.error, ValueError, DamageError)

_FOOTER_BYTES = RECORD_HEADER.size + 20 + len(MAGIC)
_PIECE_BYTES = 4 * 2**20
_RUN_BYTES = 4 * 2**20  # bare messages are indexed in runs of about a chunk's size
_COMPRESSION_AT = RECORD_HEADER.size + 28  # where a chunk record names its compression


@dataclass(frozen=True)
class Span:
    """Bytes of the file that hold messages: a chunk record, or a run of bare messages.

    Times are log times; ``channels`` is None where any channel may be in it. Where it is not
    ``whole``, the file ends within it.
    """

    offset: int
    length: int
    start_ns: int
    end_ns: int
    channels: frozenset[int] | None
    is_chunk: bool = True
    whole: bool = True


@dataclass
class Index:
    """The definitions, the messages a channel, the spans, and the log times of first and last."""

    schemas: dict[int, mcap_records.Schema] = field(default_factory=dict)
    channels: dict[int, mcap_records.Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    spans: list[Span] = field(default_factory=list)
    start_ns: int = 0
    end_ns: int = 0

    def take_definition(self, opcode: int, content: memoryview) -> None:
        """Keep a schema or channel record; others are ignored."""
        if opcode == Opcode.SCHEMA:
            schema = mcap_records.Schema.read(stream_of(content))
            self.schemas.setdefault(schema.id, schema)
        elif opcode == Opcode.CHANNEL:
            channel = mcap_records.Channel.read(stream_of(content))
            self.channels.setdefault(channel.id, channel)


class Losses:
    """Collects what could not be read: each damaged place once."""

    def __init__(self, warnings: list[ProcessWarning]) -> None:
        self.warnings = warnings
        self._offsets: set[int] = set()

    def damaged(self, offset: int, error: DamageError) -> None:
        """Say that what begins at ``offset`` was left out."""
        if offset not in self._offsets:
            self._offsets.add(offset)
            self.say(
                "recording.damaged",
                f"A part of the file that begins at byte {offset} was left out: it {error}.",
            )

    def say(self, code: str, message: str) -> None:
        """Append a warning."""
        self.warnings.append(ProcessWarning(code, "recording", message))


def read_summary(file: BinaryIO, losses: Losses) -> Index | None:
    """Return the index that the summary gives; None where there is none that serves."""
    size = file.seek(0, 2)
    file.seek(max(size - _FOOTER_BYTES, 0))
    footer = file.read(_FOOTER_BYTES)
    if len(footer) < _FOOTER_BYTES or not footer.endswith(MAGIC):
        return None  # cut short: reading front to back says where
    opcode, length = RECORD_HEADER.unpack_from(footer)
    start, _, crc = struct.unpack_from("<QQI", footer, RECORD_HEADER.size)
    summary_bytes = size - _FOOTER_BYTES - start
    try:
        if opcode != Opcode.FOOTER or length != 20:
            raise DamageError("has a broken footer")
        if start == 0:
            return None  # written without a summary, which is no loss
        if not 0 <= summary_bytes <= MAX_RECORD_BYTES:
            raise DamageError("is not where the footer says")
        file.seek(start)
        data = memoryview(file.read(summary_bytes))
        if crc and zlib.crc32(footer[: RECORD_HEADER.size + 16], zlib.crc32(data)) != crc:
            raise DamageError("failed its checksum")
        return _parse_summary(data, size)
    except PARSE_ERRORS as error:
        why = error if isinstance(error, DamageError) else "cannot be parsed"
        losses.say(
            "recording.damaged",
            f"The file's summary {why}; the file was read front to back instead.",
        )
        return None


def _parse_summary(data: memoryview, size: int) -> Index | None:
    index = Index()
    statistics: mcap_records.Statistics | None = None
    mentioned: set[int] = set()
    for opcode, content in split(data):
        index.take_definition(opcode, content)
        if opcode == Opcode.STATISTICS:
            statistics = mcap_records.Statistics.read(stream_of(content))
        elif opcode == Opcode.CHUNK_INDEX:
            chunk = mcap_records.ChunkIndex.read(stream_of(content))
            if chunk.chunk_start_offset + chunk.chunk_length > size:
                raise DamageError("points out of the file")
            held = frozenset(chunk.message_index_offsets)
            mentioned |= held
            index.spans.append(
                Span(
                    chunk.chunk_start_offset,
                    chunk.chunk_length,
                    chunk.message_start_time,
                    chunk.message_end_time,
                    held or None,
                )
            )
    if statistics is None or len(index.spans) < max(statistics.chunk_count, 1):
        return None  # unchunked, or written without what would spare the reading
    if not mentioned | set(statistics.channel_message_counts) <= set(index.channels):
        return None
    index.counts = dict(statistics.channel_message_counts)
    index.start_ns, index.end_ns = statistics.message_start_time, statistics.message_end_time
    return index


def read_through(file: BinaryIO, losses: Losses) -> Index:
    """Read the whole file once, front to back, and index what can be read of it.

    A record of which the length is broken is passed over to the next compressed chunk.
    """
    size = file.seek(0, 2)
    scan = _Scan(losses)
    at, crc = len(MAGIC), zlib.crc32(MAGIC)
    file.seek(at)
    while True:
        head = file.read(RECORD_HEADER.size)
        opcode, length = RECORD_HEADER.unpack(head) if len(head) == RECORD_HEADER.size else (0, 0)
        end = at + RECORD_HEADER.size + length
        if opcode == 0 or end > size:
            found = _find_chunk(file, at + 1, size)
            if found is None:
                if opcode == Opcode.CHUNK:
                    file.seek(at + RECORD_HEADER.size)
                    scan.take_chunk(at, file.read(MAX_RECORD_BYTES), whole=False)
                scan.say_cut(at, size)
                break
            losses.damaged(at, DamageError("has a broken length"))
            at = file.seek(found)
        elif opcode == Opcode.DATA_END:
            (declared,) = struct.unpack("<I", file.read(4).ljust(4, b"\0"))
            if declared and declared != crc:
                losses.say(
                    "recording.damaged",
                    "The file's data failed its checksum: something in it was changed.",
                )
            scan.say_end(file, size)
            break
        elif length > MAX_RECORD_BYTES:
            crc = _checksum_over(file, length, zlib.crc32(head, crc))
            if opcode != Opcode.ATTACHMENT:
                losses.damaged(at, DamageError("is larger than anything that is read"))
            at = end
        else:
            content = file.read(length)
            crc = zlib.crc32(content, zlib.crc32(head, crc))
            if opcode == Opcode.CHUNK:
                scan.take_chunk(at, content, whole=True)
            else:
                scan.take_record(at, opcode, memoryview(content))
            at = end
    return scan.finished()


class _Scan:
    """Builds an index of records as they are met."""

    def __init__(self, losses: Losses) -> None:
        self.index = Index()
        self.losses = losses
        self.start_ns: int | None = None
        self.end_ns = 0
        self._run: Span | None = None
        self._run_channels: set[int] = set()

    def take_chunk(self, at: int, content: bytes, *, whole: bool) -> None:
        """Index the chunk record at a byte, of which the header was read."""
        self._end_run()
        times: list[int] = []
        channels: set[int] = set()
        try:
            chunk = parse_chunk(memoryview(content), whole=whole)
            for opcode, record in split(unpack(chunk, whole=whole)):
                if opcode == Opcode.MESSAGE:
                    message = parse_message(record)
                    times.append(message.log_time_ns)
                    channels.add(message.channel_id)
                    self._count(message.channel_id, message.log_time_ns)
                else:
                    self.index.take_definition(opcode, record)
        except PARSE_ERRORS as error:
            if whole:
                damage = error if isinstance(error, DamageError) else DamageError("is garbled")
                self.losses.damaged(at, damage)
        if times:
            length = RECORD_HEADER.size + len(content)
            held = frozenset(channels)
            span = Span(at, length, min(times), max(times), held, is_chunk=True, whole=whole)
            self.index.spans.append(span)

    def take_record(self, at: int, opcode: int, content: memoryview) -> None:
        """Index a record that stands outside of chunks."""
        try:
            if opcode == Opcode.MESSAGE:
                message = parse_message(content)
                self._count(message.channel_id, message.log_time_ns)
                self._extend_run(at, RECORD_HEADER.size + len(content), message.log_time_ns)
                self._run_channels.add(message.channel_id)
            else:
                self.index.take_definition(opcode, content)
        except PARSE_ERRORS as error:
            damage = error if isinstance(error, DamageError) else DamageError("is garbled")
            self.losses.damaged(at, damage)

    def _extend_run(self, at: int, length: int, time_ns: int) -> None:
        run = self._run
        if run is None or run.offset + run.length != at or run.length > _RUN_BYTES:
            self._end_run()
            self._run = Span(at, length, time_ns, time_ns, None, is_chunk=False)
        else:
            start_ns, end_ns = min(run.start_ns, time_ns), max(run.end_ns, time_ns)
            self._run = Span(run.offset, run.length + length, start_ns, end_ns, None, False)

    def _end_run(self) -> None:
        if self._run is not None:
            held = frozenset(self._run_channels)
            self.index.spans.append(replace(self._run, channels=held))
            self._run, self._run_channels = None, set()

    def _count(self, channel_id: int, time_ns: int) -> None:
        self.index.counts[channel_id] = self.index.counts.get(channel_id, 0) + 1
        self.start_ns = time_ns if self.start_ns is None else min(self.start_ns, time_ns)
        self.end_ns = max(self.end_ns, time_ns)

    def say_cut(self, at: int, size: int) -> None:
        """Warn that the file ends within the record that begins at a byte."""
        self.losses.say(
            "recording.truncated",
            f"The file was cut short: it ends at byte {size}, within a record that begins at byte "
            f"{at}; the {sum(self.index.counts.values())} messages before the cut were read.",
        )

    def say_end(self, file: BinaryIO, size: int) -> None:
        """Warn where all data is there and only the file's end is missing."""
        file.seek(max(size - len(MAGIC), 0))
        if file.read(len(MAGIC)) != MAGIC:
            self.losses.say(
                "recording.truncated",
                "The file was cut short after its data: all its messages were read.",
            )

    def finished(self) -> Index:
        """Return the index of all that was taken."""
        self._end_run()
        self.index.start_ns = self.start_ns or 0
        self.index.end_ns = self.end_ns
        return self.index


def _checksum_over(file: BinaryIO, length: int, crc: int) -> int:
    while length > 0 and (piece := file.read(min(length, _PIECE_BYTES))):
        crc = zlib.crc32(piece, crc)
        length -= len(piece)
    return crc


def _find_chunk(file: BinaryIO, start: int, size: int) -> int | None:
    """Return where the next compressed chunk begins, by the look of its header."""
    at, tail = start, b""
    while True:
        file.seek(at)
        piece = file.read(_PIECE_BYTES)
        if not piece:
            return None
        data = tail + piece
        candidates = [
            at - len(tail) + place - _COMPRESSION_AT
            for name in (b"\x04\x00\x00\x00zstd", b"\x03\x00\x00\x00lz4")
            for place in _places(data, name)
        ]
        for offset in sorted(candidates):
            if offset >= start and _is_chunk(file, offset, size):
                return offset
        at += len(piece)
        tail = data[-16:]


def _places(data: bytes, name: bytes) -> list[int]:
    places = []
    place = data.find(name)
    while place >= 0:
        places.append(place)
        place = data.find(name, place + 1)
    return places


def _is_chunk(file: BinaryIO, offset: int, size: int) -> bool:
    file.seek(offset)
    opcode, length = RECORD_HEADER.unpack(file.read(RECORD_HEADER.size))
    return bool(opcode == Opcode.CHUNK and offset + RECORD_HEADER.size + length <= size)
