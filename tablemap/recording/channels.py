"""The channels that a recording is read from: decoded messages, by their header stamps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tablemap.config import LimitsConfig
from tablemap.recording.decoding import TRANSFORMS, Decoder, DecodingError
from tablemap.recording.messages import CameraInfo, CompressedImage, Image, LaserScan
from tablemap.recording.raw import Source
from tablemap.recording.tf.collector import TransformCollector
from tablemap.recording.tf.frames import TransformTree
from tablemap.recording.topics import Roles, Topic, decoders_of, implied_transforms

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

    def __init__(
        self,
        source: Source,
        roles: Roles,
        *,
        limits: LimitsConfig,
        say: Callable[[str, str], None],
    ) -> None:
        self._source, self._roles, self._say = source, roles, say
        self._limits = limits
        self._decoders: dict[int, Decoder] = {}
        for topic in (roles.depth, roles.colour, roles.laser, *roles.transforms):
            if topic is not None and topic.count:
                self._decoders |= self._decoders_of(topic)
        self.depth, self.colour, self.laser, self.tree = self._survey()

    def in_order(
        self, topic: Topic, due: Stamped
    ) -> Iterator[Image | CompressedImage | CameraInfo | LaserScan]:
        """Yield a topic's messages of the stamps that are due, decoded, by their stamps."""
        ids = topic.ids & self._decoders.keys()
        waiting: dict[int, Image | CompressedImage | CameraInfo | LaserScan] = {}
        expected = dict.fromkeys(due.stamps_ns.tolist())
        for raw in self._source.messages(ids, log_times_ns=due.log_times_ns):
            try:
                message = self._decoders[raw.channel_id].decode(raw)
            except DecodingError as error:
                self.say_undecoded(topic.name, error)
                continue
            if isinstance(message, tuple) or message.frame_id != topic.frame_id:
                continue
            if message.stamp_ns not in expected:
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

    def _decoders_of(self, topic: Topic) -> dict[int, Decoder]:
        decoders, problem = decoders_of(topic.channels, self._limits)
        if topic.first is None or problem is not None:
            problem = topic.problem or problem or "cannot be read"
            self.say_undecoded(topic.name, DecodingError(problem))
        return decoders if topic.first is not None else {}

    def _say_others(self, frames: dict[str, list[str]]) -> None:
        """Say that some of a topic's messages are in another frame than its first."""
        for name, others in frames.items():
            shown = ", ".join(sorted(set(others))[:3])
            self._say(
                "recording.topic_choice",
                f"{len(others)} messages on {name} were left out, for they are in another frame "
                f"({shown}): two sensors share the topic, and the first is used.",
            )

    def _survey(self) -> tuple[Stamped, Stamped, Stamped, TransformTree]:
        """Read the recording once for all transforms and for the stamps of images and scans."""
        sensors = [t for t in (self._roles.depth, self._roles.colour, self._roles.laser) if t]
        topic_of = {id: topic for topic in sensors for id in topic.ids}
        stamped: dict[str, list[tuple[int, int]]] = {}
        others: dict[str, list[str]] = {}
        collector = TransformCollector()
        for transform in implied_transforms(self._roles):
            collector.add(transform)
        for raw in self._source.messages(self._decoders):
            decoder = self._decoders[raw.channel_id]
            try:
                if decoder.kind == TRANSFORMS:
                    message = decoder.decode(raw)
                    assert isinstance(message, tuple)
                    for transform in message:
                        collector.add(transform, publisher=raw.channel_id)
                    continue
                topic = topic_of[raw.channel_id]
                stamp_ns, frame_id = decoder.header(raw)
                if frame_id in topic.recorded_frames:
                    stamped.setdefault(topic.name, []).append((stamp_ns, raw.log_time_ns))
                else:
                    others.setdefault(topic.name, []).append(frame_id)
            except DecodingError as error:
                self.say_undecoded(self._source.channels[raw.channel_id].topic, error)
        self._say_others(others)
        tree = collector.tree()
        if collector.rejected:
            self._say(
                "recording.damaged",
                f"{collector.lost()} were left out, for they are no rigid motions.",
            )
        depth, colour, laser = (
            _by_stamp([] if topic is None else stamped.get(topic.name, []))
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
