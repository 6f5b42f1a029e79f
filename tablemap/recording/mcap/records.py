"""The sequence of records in an MCAP, and the messages among them, without copies."""

from __future__ import annotations

import struct
from array import array
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from itertools import pairwise

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode

from tablemap.recording.raw import LATEST_NS, RawMessage

RECORD_HEADER = struct.Struct("<BQ")
MESSAGE_HEADER = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
Record = tuple[int, int, int]
"""The opcode of a record, and where its content begins and ends."""


class DamageError(Exception):
    """Bytes that contradict the container's own statements; the text completes "it ..."."""


def split(data: memoryview) -> Iterator[Record]:
    """Yield each whole record.

    Raises `DamageError` after the last one if bytes are left over.
    """
    at, end = 0, len(data)
    header, size = RECORD_HEADER.unpack_from, RECORD_HEADER.size
    while at < end:
        if end - at < size:
            raise DamageError("ends within a record")
        opcode, length = header(data, at)
        if opcode == 0:
            raise DamageError("has something else where a record should begin")
        at += size
        if length > end - at:
            raise DamageError("ends within a record")
        yield opcode, at, at + length
        at += length


def message_header(data: memoryview, begin: int, end: int) -> tuple[int, int] | None:
    """Return the channel and the log time of the message record with this content.

    None where it has no header, or a time after the year 2262.
    """
    if end - begin < MESSAGE_HEADER.size:
        return None
    channel_id, _, log_time_ns, _ = MESSAGE_HEADER.unpack_from(data, begin)
    return (channel_id, log_time_ns) if log_time_ns <= LATEST_NS else None


@dataclass(eq=False)
class Messages:
    """Messages in one piece of data; each becomes an object only when it is needed.

    ``damaged`` says that the data failed a check, so that each message may be wrong. ``unsound``
    counts messages that were left out because they have no header or no valid time.
    """

    data: memoryview
    damaged: bool = False
    unsound: int = 0
    times_ns: array[int] = field(default_factory=lambda: array("q"))
    _channels: array[int] = field(default_factory=lambda: array("H"))
    _begins: array[int] = field(default_factory=lambda: array("q"))
    _ends: array[int] = field(default_factory=lambda: array("q"))

    def __len__(self) -> int:
        return len(self.times_ns)

    def __getitem__(self, place: int) -> RawMessage:
        data = self.data[self._begins[place] : self._ends[place]]
        return RawMessage(self.times_ns[place], self._channels[place], data, self.damaged)

    def __iter__(self) -> Iterator[RawMessage]:
        return map(self.__getitem__, range(len(self)))

    def take(self, records: Iterable[Record], channels: Collection[int] | None) -> Iterator[Record]:
        """Add the channels' messages, all where no channels are given; yield other records."""
        data, message = self.data, Opcode.MESSAGE
        for record in records:
            opcode, begin, end = record
            if opcode != message:
                yield record
                continue
            header = message_header(data, begin, end)
            if header is None:
                self.unsound += 1
                continue
            channel, time_ns = header
            if channels is None or channel in channels:
                self.times_ns.append(time_ns)
                self._channels.append(channel)
                self._begins.append(begin + MESSAGE_HEADER.size)
                self._ends.append(end)

    def counts(self) -> dict[int, int]:
        """Return how many messages there are by channel."""
        channels, counts = np.unique(np.array(self._channels), return_counts=True)
        return dict(zip(channels.tolist(), counts.tolist(), strict=True))

    def by_time(self) -> list[int]:
        """Return their places, the earliest first."""
        if all(a <= b for a, b in pairwise(self.times_ns)):
            return list(range(len(self)))
        order: list[int] = np.argsort(np.array(self.times_ns), kind="stable").tolist()
        return order

    def compact(self) -> None:
        """Copy the messages if they are a small part of the data, so that the data is freed."""
        sizes = [end - begin for begin, end in zip(self._begins, self._ends, strict=True)]
        if 4 * sum(sizes) >= len(self.data):
            return
        own = bytearray()
        for begin, end in zip(self._begins, self._ends, strict=True):
            own += self.data[begin:end]
        ends = np.cumsum(np.array(sizes, np.int64))
        self._ends = array("q", ends.tolist())
        self._begins = array("q", (ends - sizes).tolist())
        self.data = memoryview(own)


def stream_of(content: memoryview) -> ReadDataStream:
    """Wrap a record's content for the parsers of `mcap.records`."""
    return ReadDataStream(BytesIO(content))
