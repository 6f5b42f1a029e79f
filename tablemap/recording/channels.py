"""The channels that a recording is read from: decoded messages, by their header stamps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tablemap.recording.decoding import Decoder, DecodingError
from tablemap.recording.messages import CameraInfo, CompressedImage, Image, LaserScan
from tablemap.recording.raw import Source
from tablemap.recording.tf.frames import TransformCollector, TransformTree
from tablemap.recording.topics import Roles, Topic

Stamps = NDArray[np.int64]

_REORDERED = 16  # depth images held back to come out by their stamps


@dataclass(frozen=True, eq=False)
class Stamped:
    """A channel's messages by header stamp: (n,) stamps ascending, and their (n,) log times."""

    stamps_ns: Stamps
    log_times_ns: Stamps


class Channels:
    """The messages of the topics that have a role.

    ``depth``, ``colour`` and ``laser`` say which there are, ``tree`` holds all transforms: both are
    read once, here. ``say`` takes the code and the words of a warning.
    """

    def __init__(self, source: Source, roles: Roles, *, say: Callable[[str, str], None]) -> None:
        self._source, self._roles, self._say = source, roles, say
        self._decoders = {
            topic.channel.id: Decoder(topic.channel)
            for topic in (roles.depth, roles.colour, roles.laser)
            if topic is not None
        }
        self.depth, self.colour, self.laser, self.tree = self._survey()

    def in_order(
        self, topic: Topic, due: Stamped
    ) -> Iterator[Image | CompressedImage | CameraInfo | LaserScan]:
        """Yield a topic's messages of the stamps that are due, decoded, by their stamps."""
        decoder = self._decoders[topic.channel.id]
        waiting: dict[int, Image | CompressedImage | CameraInfo | LaserScan] = {}
        expected = dict.fromkeys(due.stamps_ns.tolist())
        for raw in self._source.messages([topic.channel.id], log_times_ns=due.log_times_ns):
            try:
                message = decoder.decode(raw)
            except DecodingError as error:
                self.say_undecoded(topic.name, error)
                continue
            if isinstance(message, tuple) or message.stamp_ns not in expected:
                continue
            waiting[message.stamp_ns] = message
            while waiting:
                first = next(iter(expected))
                if first not in waiting and len(waiting) <= _REORDERED:
                    break
                first = min(waiting)
                del expected[first]
                yield waiting.pop(first)
        for stamp in sorted(waiting):
            yield waiting[stamp]

    def say_undecoded(self, topic: str, error: DecodingError) -> None:
        """Say once that a message was left out, and why."""
        self._say("recording.damaged", f"A message on {topic} was left out: it {error}.")

    def _survey(self) -> tuple[Stamped, Stamped, Stamped, TransformTree]:
        """Read the recording once for all transforms and for the stamps of images and scans."""
        transforms: dict[int, Decoder] = {}
        for topic in self._roles.transforms:
            if topic.first is not None:
                transforms[topic.channel.id] = Decoder(topic.channel)
            elif topic.count:
                self.say_undecoded(topic.name, DecodingError(topic.problem or "cannot be read"))
        stamped: dict[int, list[tuple[int, int]]] = {id: [] for id in self._decoders}
        collector = TransformCollector()
        for raw in self._source.messages({*transforms, *stamped}):
            try:
                if raw.channel_id in transforms:
                    message = transforms[raw.channel_id].decode(raw)
                    assert isinstance(message, tuple)
                    for transform in message:
                        collector.add(transform)
                else:
                    decoder = self._decoders[raw.channel_id]
                    stamped[raw.channel_id].append((decoder.stamp_ns(raw), raw.log_time_ns))
            except DecodingError as error:
                self.say_undecoded(self._source.channels[raw.channel_id].topic, error)
        tree = collector.tree()
        if collector.rejected:
            self._say(
                "recording.damaged",
                f"{collector.rejected} transforms were left out, for they are no rigid motions.",
            )
        depth, colour, laser = (
            _by_stamp(stamped[topic.channel.id] if topic is not None else [])
            for topic in (self._roles.depth, self._roles.colour, self._roles.laser)
        )
        return depth, colour, laser, tree


def _by_stamp(pairs: list[tuple[int, int]]) -> Stamped:
    """Sort (stamp, log time) pairs; of several messages with one stamp the first counts."""
    array = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    stamps, first = np.unique(array[:, 0], return_index=True)
    return Stamped(stamps, array[first, 1])


def only(have: Stamped, stamps_ns: ArrayLike | None) -> Stamped:
    """Return those of the given stamps alone, or all where none are given."""
    if stamps_ns is None:
        return have
    kept = np.isin(have.stamps_ns, np.asarray(stamps_ns, dtype=np.int64))
    return Stamped(have.stamps_ns[kept], have.log_times_ns[kept])
