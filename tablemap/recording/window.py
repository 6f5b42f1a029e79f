"""A part of a recording's time, read as a recording of its own."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from datetime import UTC, datetime

from tablemap.errors import RecordingError
from tablemap.geometry import Ints
from tablemap.recording.kinds import CALIBRATION, TRANSFORMS, kind_of
from tablemap.recording.raw import Channel, RawMessage, Source

_EPOCH_SECONDS = 1e8  # numbers beyond are no seconds of a drive, but Unix time


class Window:
    """The messages of a source that were logged in [start, end]: a source itself.

    What is published once for all of the drive is read from all of it: static transforms and
    calibrations.
    """

    def __init__(self, source: Source, start_ns: int, end_ns: int) -> None:
        self._source = source
        self.profile, self.library = source.profile, source.library
        self.channels = source.channels
        self.start_ns = max(start_ns, source.start_ns)
        self.end_ns = min(end_ns, source.end_ns)
        self._lasting = frozenset(id for id, each in self.channels.items() if _is_lasting(each))
        self.counts = {id: source.counts[id] * (id in self._lasting) for id in self.channels}
        for message in self.messages(self.channels.keys() - self._lasting):
            self.counts[message.channel_id] += 1
        if not any(self.counts[id] for id in self.channels.keys() - self._lasting):
            seconds = (source.end_ns - source.start_ns) / 1e9
            raise RecordingError(
                f"The recording has no messages between topics.start and topics.end; it begins at "
                f"{_iso(source.start_ns)} and lasts {seconds:.1f} s."
            )

    def messages(
        self,
        channels: Collection[int],
        *,
        start_ns: int | None = None,
        end_ns: int | None = None,
        log_times_ns: Ints | None = None,
    ) -> Iterator[RawMessage]:
        """Yield the channels' messages by log time, in [start, end] or at given log times."""
        channels = frozenset(channels)
        outside = channels & self._lasting
        first = self.start_ns if start_ns is None else max(start_ns, self.start_ns)
        last = self.end_ns if end_ns is None else min(end_ns, self.end_ns)
        if not outside:
            yield from self._source.messages(
                channels, start_ns=first, end_ns=last, log_times_ns=log_times_ns
            )
            return
        yield from self._source.messages(
            outside, start_ns=start_ns, end_ns=first - 1, log_times_ns=log_times_ns
        )
        yield from self._source.messages(
            channels, start_ns=first, end_ns=last, log_times_ns=log_times_ns
        )
        yield from self._source.messages(
            outside, start_ns=last + 1, end_ns=end_ns, log_times_ns=log_times_ns
        )

    def sample(self, channels: Collection[int], *, most: int) -> tuple[Iterator[RawMessage], bool]:
        """Return all messages: a window is short."""
        return self.messages(channels), True

    def close(self) -> None:
        """Close the files."""
        self._source.close()


def windowed(source: Source, start: str, end: str) -> Source:
    """Return the part of a source between two moments, or all of it where both are empty.

    A moment is in seconds from the recording's begin, or before its end where negative; or a date
    and time (ISO 8601, UTC where it names no zone), or Unix seconds. Raises `RecordingError` where
    nothing lies between.
    """
    if not (start or end):
        return source
    first = moment_ns(start, source) if start else source.start_ns
    last = moment_ns(end, source) if end else source.end_ns
    return Window(source, first, last)


def moment_ns(text: str, source: Source) -> int:
    """Return the log time that a text names."""
    try:
        seconds = float(text)
    except ValueError:
        moment = datetime.fromisoformat(text)
        moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
        whole = moment.replace(microsecond=0)
        return int(whole.timestamp()) * 1_000_000_000 + moment.microsecond * 1000
    nanoseconds = round(seconds * 1e9)
    if seconds > _EPOCH_SECONDS:
        return nanoseconds
    return nanoseconds + (source.end_ns if seconds < 0 else source.start_ns)


def _is_lasting(channel: Channel) -> bool:
    kind = kind_of(channel)
    return kind == CALIBRATION or (kind == TRANSFORMS and "static" in channel.topic)


def _iso(time_ns: int) -> str:
    return datetime.fromtimestamp(time_ns // 1_000_000_000, UTC).isoformat()
