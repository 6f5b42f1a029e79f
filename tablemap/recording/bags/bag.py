"""A file of rosbag (ROS 1) or a database of rosbag2, through the readers of rosbags."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag2 import Reader as Reader2

from tablemap.config import LimitsConfig
from tablemap.errors import ProcessWarning, RecordingError
from tablemap.geometry import Ints
from tablemap.recording.bags.bounded import BoundedReader, check_database
from tablemap.recording.raw import Channel, RawMessage

_GAP_NS = 1_000_000_000  # wanted messages with smaller gaps are read in one go
_ALL = 20_000  # up to this number all messages are read, without sampling
_SAMPLE_NS = 200_000_000  # time that is read at each place of a sample
_SCHEMA_ENCODINGS = {
    MessageDefinitionFormat.MSG: "ros2msg",
    MessageDefinitionFormat.IDL: "ros2idl",
    MessageDefinitionFormat.NONE: "",
}


class Bag:
    """An opened bag of ROS 1, or a database of ROS 2: a `tablemap.recording.raw.Source`.

    Losses are appended to ``warnings``. Raises `RecordingError` if the bag has no usable index.
    """

    def __init__(
        self, path: Path, *, ros1: bool, warnings: list[ProcessWarning], limits: LimitsConfig
    ) -> None:
        self._warnings = warnings
        self._reader: BoundedReader | Reader2
        # On bytes of any kind rosbags raises anything.
        try:
            if ros1:
                self._reader = BoundedReader(path, limits)
                self._most_bytes = self._reader.most_unpacked
            else:
                check_database(path)
                self._reader = Reader2(path)
                self._most_bytes = 2 * path.stat().st_size
            self._reader.open()
            connections = self._reader.connections
            self.channels = {each.id: _channel(each, ros1=ros1) for each in connections}
            self.counts = {each.id: each.msgcount for each in connections}
            has_messages = any(self.counts.values())
            self.start_ns = _time(self._reader.start_time) if has_messages else 0
            end_ns = _time(self._reader.end_time) - 1 if has_messages else 0
            self.end_ns = max(self.start_ns, end_ns)
        except Exception as error:
            raise RecordingError(_sentence(path, error, ros1=ros1)) from error
        self.profile = "ros1" if ros1 else "ros2"
        self.library = "rosbag" if ros1 else "rosbag2 sqlite3"

    def messages(
        self,
        channels: Collection[int],
        *,
        start_ns: int | None = None,
        end_ns: int | None = None,
        log_times_ns: Ints | None = None,
    ) -> Iterator[RawMessage]:
        """Yield the channels' messages by log time, in [start, end] or at given log times."""
        first = self.start_ns if start_ns is None else start_ns
        last = self.end_ns if end_ns is None else end_ns
        if log_times_ns is None:
            yield from self._between(channels, first, last)
            return
        times = np.unique(log_times_ns)
        times = times[(times >= first) & (times <= last)]
        exact = frozenset(times.tolist())
        for run in np.split(times, np.flatnonzero(np.diff(times) > _GAP_NS) + 1):
            if len(run):
                for message in self._between(channels, int(run[0]), int(run[-1])):
                    if message.log_time_ns in exact:
                        yield message

    def sample(self, channels: Collection[int], *, most: int) -> tuple[Iterator[RawMessage], bool]:
        """Return the messages of at most ``most`` moments, and whether these are all."""
        if sum(self.counts[id] for id in channels) <= _ALL:
            return self.messages(channels), True
        starts = np.linspace(self.start_ns, self.end_ns - _SAMPLE_NS, most).astype(np.int64)
        sampled = (
            message
            for start in starts.tolist()
            for message in self._between(channels, start, start + _SAMPLE_NS)
        )
        return sampled, False

    def close(self) -> None:
        """Close the file."""
        self._reader.close()

    def _between(
        self, channels: Collection[int], first_ns: int, last_ns: int
    ) -> Iterator[RawMessage]:
        """Yield the messages of a closed interval; a damaged chunk is left out."""
        wanted = [each for each in self._reader.connections if each.id in channels]
        at: int | None = first_ns
        left = self._most_bytes
        while wanted and at is not None and at <= last_ns:
            try:
                for connection, time_ns, data in self._reader.messages(wanted, at, last_ns + 1):
                    if not isinstance(data, bytes) or not isinstance(time_ns, int):
                        raise TypeError("a message is no bytes, or its time no number")
                    at = time_ns
                    left -= len(data)
                    if left < 0:  # some are named again and again
                        raise ValueError("its messages are more than it has room for")
                    yield RawMessage(time_ns, connection.id, memoryview(data))
                return
            except Exception as error:
                self._say_damaged(at, error)
                at = self._next_chunk(at) if left >= 0 else None

    def _next_chunk(self, after_ns: int) -> int | None:
        """Return when the next chunk begins; None for a database, which has none."""
        if not isinstance(self._reader, BoundedReader):
            return None
        starts = (chunk.start_time for chunk in self._reader.chunk_infos)
        return min((start for start in starts if start > after_ns), default=None)

    def _say_damaged(self, at_ns: int, error: Exception) -> None:
        until = "up to its next chunk" if isinstance(self._reader, BoundedReader) else "to its end"
        message = (
            f"The bag is damaged: its messages after {at_ns} ns were left out {until} "
            f"({str(error) or type(error).__name__})."
        )
        warning = ProcessWarning("recording.damaged", "recording", message)
        if warning not in self._warnings:
            self._warnings.append(warning)


def _time(value: object) -> int:
    if not isinstance(value, int) or not 0 <= value < 2**63:
        raise ValueError(f"{value!r:.40} is no time in nanoseconds")
    return value


def _channel(connection: Connection, *, ros1: bool) -> Channel:
    definition = connection.msgdef
    if not all(isinstance(each, str) for each in (connection.topic, connection.msgtype)):
        raise ValueError("a topic has no name or no type")
    return Channel(
        connection.id,
        connection.topic,
        "ros1" if ros1 else "cdr",
        connection.msgtype,
        "ros1msg" if ros1 else _SCHEMA_ENCODINGS[definition.format],
        definition.data.encode(),
        {"callerid": getattr(connection.ext, "callerid", None) or ""} if ros1 else {},
    )


def _sentence(path: Path, error: Exception, *, ros1: bool) -> str:
    why = str(error).rstrip(".") or type(error).__name__
    if ros1:
        return (
            f"The bag has no index that can be read ({why}); run `rosbag reindex` on it and try "
            f"again: {path}"
        )
    return f"The database of the bag cannot be read ({why}): {path}"
