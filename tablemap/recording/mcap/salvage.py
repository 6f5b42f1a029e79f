"""Search for valid records in damaged bytes: records that parse and fit their neighbours.

Damage moves the begin of the next record, or changes a record's own header. A record is valid if
its header is possible, its channel is known, its time is in the expected range, and another valid
record follows. After a place without a valid record, the next one is searched.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass

from mcap.opcode import Opcode

from tablemap.config import LimitsConfig
from tablemap.config.limits import MIB
from tablemap.recording.mcap.chunks import Unpacked
from tablemap.recording.mcap.records import (
    MESSAGE_HEADER,
    RECORD_HEADER,
    DamageError,
    Record,
    split,
)
from tablemap.recording.raw import LATEST_NS

Read = Callable[[int, int], bytes | memoryview]
"""Returns a number of bytes from a place on, fewer at the end."""

_IN_CHUNK = re.compile(rb"[\x03-\x05].{4}\x00{4}", re.DOTALL)
_IN_FILE = re.compile(rb"[\x01-\x0f].{4}\x00{4}", re.DOTALL)
_MOST_TRIES = 100_000  # places that look like a header, in one search
_WINDOW_BYTES = 4 * MIB
_FARTHEST_BYTES = 32 * MIB  # largest distance to the next record in a search
_CHAIN = 3  # this many records in a row prove a place where records begin
_NAMES = {0: b"", 3: b"lz4", 4: b"zstd"}
_DAY_NS = 86_400 * 10**9


@dataclass(frozen=True)
class Sieve:
    """The test of a record: a known channel, and a log time in [start, end]."""

    channels: Collection[int]
    start_ns: int = 0
    end_ns: int = LATEST_NS

    def around(self, start_ns: int, end_ns: int) -> Sieve:
        """Return the sieve for log times within a day of these times."""
        return Sieve(self.channels, start_ns - _DAY_NS, end_ns + _DAY_NS)

    def end_of(self, read: Read, at: int, size: int) -> int | None:
        """Return the end of the record that begins at a place; None if none begins there."""
        head = read(at, RECORD_HEADER.size + MESSAGE_HEADER.size)
        if len(head) < RECORD_HEADER.size:
            return None
        opcode, length = RECORD_HEADER.unpack_from(head)
        end = at + RECORD_HEADER.size + length
        if end > size:
            return None
        if opcode == Opcode.MESSAGE:
            return end if length >= MESSAGE_HEADER.size and self._fits(head) else None
        fits = _FITS.get(opcode)
        return end if fits is not None and fits(read, at + RECORD_HEADER.size, length) else None

    def _fits(self, head: bytes | memoryview) -> bool:
        channel, _, time_ns, _ = MESSAGE_HEADER.unpack_from(head, RECORD_HEADER.size)
        return channel in self.channels and self.start_ns <= time_ns <= self.end_ns

    def begins_chain(self, read: Read, at: int, size: int, *, length: int) -> bool:
        """Tell whether ``length`` records follow each other from a place on, or reach the end."""
        for _ in range(length):
            end = self.end_of(read, at, size)
            if end is None:
                return False
            if end == size:
                return True
            at = end
        return True


def records_of(
    unpacked: Unpacked, sieve: Sieve, limits: LimitsConfig, *, say: Callable[[DamageError], None]
) -> Iterator[Record]:
    """Yield a chunk's records: all of an undamaged chunk, the valid ones of a damaged chunk.

    ``say`` is called with the damage.
    """
    count = at = 0
    damage = unpacked.damage
    if damage is None:
        try:
            for record in split(unpacked.data):
                count += 1
                if count > limits.chunk_messages:
                    raise DamageError(
                        f"holds {count} records or more, {limits.over('chunk_messages')}"
                    )
                yield record
                at = record[2]
        except DamageError as error:
            damage = DamageError(str(error))  # without the frames that hold the data
        else:
            return
    say(damage)
    for record in salvaged(unpacked.data, sieve, start=at):
        count += 1
        if count > limits.chunk_messages:
            return
        yield record


def salvaged(data: memoryview, sieve: Sieve, *, start: int = 0) -> Iterator[Record]:
    """Yield the possible records of damaged data, from a byte on."""

    def read(at: int, count: int) -> memoryview:
        return data[at : at + count]

    at, size = start, len(data)
    while at < size:
        end = sieve.end_of(read, at, size)
        content = at + RECORD_HEADER.size
        if end is not None and (end == size or sieve.end_of(read, end, size) is not None):
            yield data[at], content, end
            at = end
            continue
        found = _next_in(data, at + 1 if end is None else content, sieve)
        if end is not None:
            # If the next record lies within this one, this one's length is wrong.
            yield data[at], content, end if found is None else min(end, found)
        if found is None:
            return
        at = found


def _next_in(data: memoryview, start: int, sieve: Sieve) -> int | None:
    def read(at: int, count: int) -> memoryview:
        return data[at : at + count]

    last = start + _FARTHEST_BYTES
    for _ in range(_MOST_TRIES):
        match = _IN_CHUNK.search(data, start, last)
        if match is None:
            return None
        if sieve.begins_chain(read, match.start(), len(data), length=2):
            return match.start()
        start = match.start() + 1
    return None


def next_in_file(read: Read, start: int, size: int, sieve: Sieve) -> int | None:
    """Return the place of the next records in a file, from a byte on; None if there are none."""
    tries = 0
    overlap = RECORD_HEADER.size - 1
    while start < size:
        window = read(start, _WINDOW_BYTES + overlap)
        at = 0
        while (match := _IN_FILE.search(window, at)) is not None:
            place = start + match.start()
            if sieve.begins_chain(read, place, size, length=_CHAIN):
                return place
            at = match.start() + 1
            tries += 1
            if tries > _MOST_TRIES:
                return None
        start += _WINDOW_BYTES
    return None


# Tests of a record's content by its kind. Each takes the begin and the length of the content.


def _is_definition(read: Read, at: int, length: int, *, strings: int) -> bool:
    """Tell whether strings with their lengths fill a schema or channel record."""
    end = at + length
    for _ in range(strings):
        word = read(at, 4)
        if len(word) < 4:
            return False
        at += 4 + struct.unpack("<I", word)[0]
        if at > end:
            return False
    return at == end


def _is_schema(read: Read, at: int, length: int) -> bool:
    return length >= 2 and _is_definition(read, at + 2, length - 2, strings=3)


def _is_channel(read: Read, at: int, length: int) -> bool:
    return length >= 4 and _is_definition(read, at + 4, length - 4, strings=3)


def chunk_length(read: Read, at: int) -> int | None:
    """Return how long the content of a chunk record is, by the length of what is packed in it."""
    head = bytes(read(at, 44))  # up to the longest name, and that length
    if len(head) < 44:
        return None
    name_bytes: int = struct.unpack_from("<I", head, 28)[0]
    if _NAMES.get(name_bytes) != head[32 : 32 + name_bytes]:
        return None
    packed: int = struct.unpack_from("<Q", head, 32 + name_bytes)[0]
    return 40 + name_bytes + packed


def _is_chunk(read: Read, at: int, length: int) -> bool:
    return chunk_length(read, at) == length


def _is_message_index(read: Read, at: int, length: int) -> bool:
    head = read(at, 6)
    return len(head) == 6 and struct.unpack_from("<I", head, 2)[0] == length - 6


def _is_data_end(_: Read, __: int, length: int) -> bool:
    return length == 4


_FITS: dict[int, Callable[[Read, int, int], bool]] = {
    Opcode.SCHEMA: _is_schema,
    Opcode.CHANNEL: _is_channel,
    Opcode.CHUNK: _is_chunk,
    Opcode.MESSAGE_INDEX: _is_message_index,
    Opcode.DATA_END: _is_data_end,
}
