"""Several files of one drive, read as one recording."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

from tablemap.geometry import Ints
from tablemap.recording.raw import Channel, RawMessage, Source


class Several:
    """Sources of one drive: a `tablemap.recording.raw.Source`.

    Channels that differ only in their number are one channel. Files that follow each other in time
    are opened one after the other, so that memory holds only files that overlap.
    """

    def __init__(self, sources: Sequence[Source]) -> None:
        self._sources = sources
        self.profile, self.library = sources[0].profile, sources[0].library
        self.channels: dict[int, Channel] = {}
        self.counts: dict[int, int] = {}
        self._numbers = [self._take(source) for source in sources]
        filled = [source for source in sources if any(source.counts.values())] or sources[:1]
        self.start_ns = min(source.start_ns for source in filled)
        self.end_ns = max(source.end_ns for source in filled)

    def _take(self, source: Source) -> dict[int, int]:
        """Add a source's channels; return our number for each of its numbers."""
        ours = {_key(channel): id for id, channel in self.channels.items()}
        seen: Counter[tuple[object, ...]] = Counter()
        numbers = {}
        for id, channel in source.channels.items():
            key = _key(channel)
            nth = seen[key]
            seen[key] += 1
            # A second equal channel in the same file belongs to a second publisher.
            number = ours.get(key) if nth == 0 else None
            if number is None:
                number = len(self.channels) + 1
                self.channels[number] = replace(channel, id=number)
            self.counts[number] = self.counts.get(number, 0) + source.counts[id]
            numbers[id] = number
        return numbers

    def messages(
        self,
        channels: Collection[int],
        *,
        start_ns: int | None = None,
        end_ns: int | None = None,
        log_times_ns: Ints | None = None,
    ) -> Iterator[RawMessage]:
        """Yield the channels' messages by log time, in [start, end] or at given log times."""
        streams = []
        for place, (source, numbers) in enumerate(zip(self._sources, self._numbers, strict=True)):
            wanted = [own for own, number in numbers.items() if number in channels]
            if wanted:
                messages = source.messages(
                    wanted, start_ns=start_ns, end_ns=end_ns, log_times_ns=log_times_ns
                )
                streams.append((source.start_ns, place, _renumbered(messages, numbers)))
        yield from _merged(sorted(streams, key=lambda each: each[:2]))

    def sample(self, channels: Collection[int], *, most: int) -> tuple[Iterator[RawMessage], bool]:
        """Return messages from at most ``most`` places, and whether these are all."""
        each = max(most // len(self._sources), 1)
        samples, are_all = [], True
        for source, numbers in zip(self._sources, self._numbers, strict=True):
            wanted = [own for own, number in numbers.items() if number in channels]
            if wanted:
                messages, complete = source.sample(wanted, most=each)
                samples.append(_renumbered(messages, numbers))
                are_all &= complete
        return (message for sample in samples for message in sample), are_all

    def close(self) -> None:
        """Close all files."""
        for source in self._sources:
            source.close()


def _key(channel: Channel) -> tuple[object, ...]:
    fields = vars(channel) | {"id": 0, "metadata": tuple(sorted(channel.metadata.items()))}
    return tuple(fields.values())


def _renumbered(messages: Iterator[RawMessage], numbers: dict[int, int]) -> Iterator[RawMessage]:
    return (message._replace(channel_id=numbers[message.channel_id]) for message in messages)


def _merged(
    streams: Sequence[tuple[int, int, Iterator[RawMessage]]],
) -> Iterator[RawMessage]:
    """Merge streams (first log time, place, messages) in time; each is opened at its first time."""
    waiting = list(streams)
    heap: list[tuple[int, int, RawMessage, Iterator[RawMessage]]] = []
    while waiting or heap:
        while waiting and (not heap or waiting[0][0] <= heap[0][0]):
            _, place, messages = waiting.pop(0)
            first = next(messages, None)
            if first is not None:
                heapq.heappush(heap, (first.log_time_ns, place, first, messages))
        if not heap:
            continue
        _, place, message, messages = heap[0]
        yield message
        following = next(messages, None)
        if following is None:
            heapq.heappop(heap)
        else:
            heapq.heapreplace(heap, (following.log_time_ns, place, following, messages))
