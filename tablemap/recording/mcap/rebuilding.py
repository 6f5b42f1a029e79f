"""The index of an MCAP that has no usable summary, from reading it front to back."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from dataclasses import replace
from typing import BinaryIO

from mcap.opcode import Opcode

from tablemap.config.limits import MIB
from tablemap.recording.mcap.chunks import parse_chunk, unpack
from tablemap.recording.mcap.index import MAGIC, PARSE_ERRORS, Index, Losses, Span, Totals, no_time
from tablemap.recording.mcap.records import RECORD_HEADER, DamageError, Messages, message_header
from tablemap.recording.mcap.salvage import Read, Sieve, chunk_length, next_in_file, records_of
from tablemap.words import counted

_PIECE_BYTES = 4 * MIB
_RUN_BYTES = 4 * MIB  # bare messages are indexed in runs of about a chunk's size


def read_through(file: BinaryIO, losses: Losses, totals: Totals) -> Index:
    """Read the whole file once, front to back, and index all readable records.

    After a record with a broken length, the next record is searched.
    """
    size = file.seek(0, 2)
    scan = _Scan(losses, totals)
    most = totals.limits.record_mib * MIB
    crc: int | None = zlib.crc32(MAGIC)  # None once it cannot be right any more
    # A record counts only if another follows it: otherwise its length may be wrong.
    pending: tuple[int, int, bytes] | None = None

    def read(at: int, count: int) -> bytes:
        if at >= size:  # a broken length may lead beyond what can be sought
            return b""
        file.seek(at)
        return file.read(count)

    at = len(MAGIC)
    while True:
        head = read(at, RECORD_HEADER.size)
        opcode, length = RECORD_HEADER.unpack(head) if len(head) == RECORD_HEADER.size else (0, 0)
        end = at + RECORD_HEADER.size + length
        if opcode == 0 or end > size:
            crc = None
            found = _where_it_goes_on(read, at, opcode, length, size, pending, scan.sieve())
            if pending is not None and (found is None or found > at):
                scan.take(*pending)
            elif pending is not None:
                losses.damaged(pending[0], DamageError("has a broken length"))
            pending = None
            if found is None or found > at:
                if opcode == Opcode.CHUNK:
                    left = (size if found is None else found) - at - RECORD_HEADER.size
                    scan.take_chunk(at, read(at + RECORD_HEADER.size, min(left, most)), whole=False)
                if found is None:
                    scan.say_cut(at, size)
                    break
                losses.damaged(at, DamageError("has a broken length"), partly=True)
            at = found
            continue
        if pending is not None:
            scan.take(*pending)
            pending = None
        if opcode == Opcode.DATA_END:
            (declared,) = struct.unpack("<I", file.read(4).ljust(4, b"\0"))
            if declared and crc is not None and declared != crc:
                losses.say(
                    "recording.damaged",
                    "The file's data failed its checksum: something in it was changed.",
                )
            scan.say_end(file, size)
            break
        if opcode in _TAKEN and length <= most:
            content = file.read(length)
            crc = crc and zlib.crc32(content, zlib.crc32(head, crc))
            pending = at, opcode, content
        else:
            crc = crc and _checksum_over(file, length, zlib.crc32(head, crc))
            if opcode in _TAKEN:
                over = totals.limits.over("record_mib")
                losses.damaged(at, DamageError(f"has {length / MIB:.0f} MiB, {over}"))
        at = end
    return scan.finished()


_TAKEN = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK)


def _where_it_goes_on(
    read: Read,
    at: int,
    opcode: int,
    length: int,
    size: int,
    pending: tuple[int, int, bytes] | None,
    sieve: Sieve,
) -> int | None:
    """Return the place of the next record after a place without a valid one.

    The place may lie within the record before, if that one's length is wrong. Returns None if there
    is no further record: the file was cut.
    """
    content = at + RECORD_HEADER.size
    if opcode == Opcode.CHUNK and (packed := chunk_length(read, content)) is not None:
        if packed == length:
            return None  # it says so twice, and the file ends before
        if sieve.begins_chain(read, content + packed, size, length=1):
            return content + packed
    start = at + 1
    if pending is not None and not _is_sure(*pending[1:]):
        start = pending[0] + 1
    return next_in_file(read, start, size, sieve)


def _is_sure(opcode: int, content: bytes) -> bool:
    """Tell whether a record says twice how long it is."""

    def read(at: int, count: int) -> bytes:
        return content[at : at + count]

    return opcode == Opcode.CHUNK and chunk_length(read, 0) == len(content)


class _Scan:
    """Builds an index of records as they are met."""

    def __init__(self, losses: Losses, totals: Totals) -> None:
        self.index = Index(totals)
        self.losses, self.totals = losses, totals
        self._logged: tuple[int, int] | None = None  # the first and the last log time
        self._run: Span | None = None
        self._run_channels: set[int] = set()
        self._messages = 0

    def sieve(self) -> Sieve:
        """Return the sieve for records of this file."""
        sieve = Sieve(self.index.channels)
        return sieve if self._logged is None else sieve.around(*self._logged)

    def take(self, at: int, opcode: int, content: bytes) -> None:
        """Index the record that begins at a byte."""
        if opcode == Opcode.CHUNK:
            self.take_chunk(at, content, whole=True)
        else:
            self._take_bare(at, opcode, memoryview(content))

    def take_chunk(self, at: int, content: bytes, *, whole: bool) -> None:
        """Index the chunk record at a byte; its end may be missing."""
        self._end_run()
        limits = self.totals.limits
        found = Messages(memoryview(b""))

        def say(error: DamageError) -> None:
            if whole:
                self.losses.damaged(at, error, partly=True)

        try:
            chunk = parse_chunk(memoryview(content), whole=whole)
            records = unpack(chunk, limits, whole=whole)
            self.totals.unpacked(at, len(records.data))
            found = Messages(records.data, damaged=records.damage is not None)
            sieve = Sieve(self.index.channels, chunk.start_ns, chunk.end_ns)
            for opcode, begin, end in found.take(records_of(records, sieve, limits, say=say), None):
                content_of = records.data[begin:end]
                self._define(at, opcode, content_of, doubtful=found.damaged)
        except DamageError as error:
            self.losses.damaged(at, error)
        if found.unsound:
            self.losses.damaged(at, no_time(found.unsound), partly=True)
        if len(found):
            counts = found.counts()
            length, times = RECORD_HEADER.size + len(content), found.times_ns
            span = Span(
                at,
                length,
                min(times),
                max(times),
                frozenset(counts),
                len(found.data),
                whole=whole,
            )
            self.index.spans.append(span)
            self._count(counts, span.start_ns, span.end_ns)

    def _take_bare(self, at: int, opcode: int, content: memoryview) -> None:
        """Index a record that stands outside of chunks."""
        if opcode != Opcode.MESSAGE:
            self._define(at, opcode, content)
            return
        header = message_header(content, 0, len(content))
        if header is None:
            self.losses.damaged(at, no_time(1))
            return
        channel, time_ns = header
        self._count({channel: 1}, time_ns, time_ns)
        self._extend_run(at, RECORD_HEADER.size + len(content), time_ns)
        self._run_channels.add(channel)

    def _define(self, at: int, opcode: int, content: memoryview, *, doubtful: bool = False) -> None:
        try:
            self.index.take_definition(opcode, content, doubtful=doubtful)
        except PARSE_ERRORS as error:
            damage = error if isinstance(error, DamageError) else DamageError("is garbled")
            self.losses.damaged(at, damage, partly=True)

    def _extend_run(self, at: int, length: int, time_ns: int) -> None:
        run = self._run
        if run is None or run.offset + run.length != at or run.length > _RUN_BYTES:
            self._end_run()
            self._run = Span(at, length, time_ns, time_ns, None, length, is_chunk=False)
        else:
            start_ns, end_ns = min(run.start_ns, time_ns), max(run.end_ns, time_ns)
            length += run.length
            self._run = Span(run.offset, length, start_ns, end_ns, None, length, is_chunk=False)

    def _end_run(self) -> None:
        if self._run is not None:
            held = frozenset(self._run_channels)
            self.index.spans.append(replace(self._run, channels=held))
            self._run, self._run_channels = None, set()

    def _count(self, counts: Mapping[int, int], start_ns: int, end_ns: int) -> None:
        for channel, count in counts.items():
            self.index.counts[channel] = self.index.counts.get(channel, 0) + count
            self._messages += count
        first, last = self._logged or (start_ns, end_ns)
        self._logged = min(first, start_ns), max(last, end_ns)
        self.totals.check_count("messages", self._messages, "messages")

    def say_cut(self, at: int, size: int) -> None:
        """Warn that the file ends within the record that begins at a byte."""
        self.losses.say(
            "recording.truncated",
            f"The file was cut short: it ends at byte {size}, within a record that begins at byte "
            f"{at}; {counted(self._messages, 'message')} before the cut could be read.",
        )

    def say_end(self, file: BinaryIO, size: int) -> None:
        """Warn if all data is there and only the file's end is missing."""
        file.seek(max(size - len(MAGIC), 0))
        if file.read(len(MAGIC)) != MAGIC:
            self.losses.say(
                "recording.truncated",
                "The file was cut short after its data: all its messages were read.",
            )

    def finished(self) -> Index:
        """Return the index of all records so far."""
        self._end_run()
        self.index.start_ns, self.index.end_ns = self._logged or (0, 0)
        return self.index


def _checksum_over(file: BinaryIO, length: int, crc: int) -> int:
    while length > 0 and (piece := file.read(min(length, _PIECE_BYTES))):
        crc = zlib.crc32(piece, crc)
        length -= len(piece)
    return crc
