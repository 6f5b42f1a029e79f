"""The channels of a recording: decoded messages in the order of their header stamps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from hashlib import blake2b

import numpy as np
from numpy.typing import ArrayLike

from tablemap.config import LimitsConfig
from tablemap.geometry import Floats, Ints
from tablemap.recording.calibrations import is_same
from tablemap.recording.decoding import Decoder
from tablemap.recording.kinds import CALIBRATION, TRANSFORMS
from tablemap.recording.messages import (
    CameraInfo,
    CompressedImage,
    DecodingError,
    Image,
    LaserScan,
    Pose,
)
from tablemap.recording.raw import RawMessage, Source
from tablemap.recording.roles import Roles, implied_transforms
from tablemap.recording.tf.collector import TransformCollector
from tablemap.recording.tf.frames import Stamps
from tablemap.recording.topics import Topic, decoders_of
from tablemap.words import counted

_BEHIND_STAMP = 12  # bytes, of ROS's messages that begin with a header
_REORDERED = 16  # depth images held back to come out by their stamps


@dataclass(frozen=True, eq=False)
class Stamped:
    """A channel's messages by header stamp: (n,) stamps ascending, and their (n,) log times."""

    stamps_ns: Stamps
    log_times_ns: Stamps

    def lags_s(self) -> Floats:
        """Return how long after their stamps the messages were logged, (n,) seconds."""
        return np.asarray((self.log_times_ns - self.stamps_ns) / 1e9)


class Channels:
    """The messages of the topics that have a role.

    Stamps and transforms are read once, here: `of` returns a topic's stamps, ``collector`` has the
    transforms. ``say`` takes the code and the message of a warning.
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
        self._topics = [t for t in (roles.depth, roles.colour, *roles.lasers) if t is not None]
        if roles.calibration is not None and not roles.is_own_calibration:
            self._topics.append(roles.calibration)
        for topic in (*self._topics, *roles.transforms):
            if topic.count:
                self._decoders |= self._decoders_of(topic)
        self.collector = TransformCollector(limits)
        self._stamped: dict[str, Stamped] = {}
        self._contents: dict[str, Ints] = {}
        self._others: dict[str, list[str]] = {}
        self._offsets_ns: dict[str, int] = {}
        self.calibrations: list[CameraInfo] = []
        self.calibration_counts: list[int] = []
        self._survey()

    def of(self, topic: Topic | None) -> Stamped:
        """Return the stamps of a topic's messages; without a topic there are none."""
        if topic is None or topic.name not in self._stamped:
            return _by_stamp([])
        if topic.name in self._others:
            others = self._others[topic.name]
            self._say(
                "recording.topic_choice",
                f"{counted(len(others), 'message')} on {topic.name} left out, for another "
                f"frame ({', '.join(sorted(set(others))[:3])}): two sensors share the topic, and "
                "the first is used.",
            )
        stamped, offset_ns = self._stamped[topic.name], self._offsets_ns.get(topic.name, 0)
        return replace(stamped, stamps_ns=stamped.stamps_ns + offset_ns) if offset_ns else stamped

    def contents(self, topic: Topic) -> Ints:
        """Return one number a message of depth or a laser, in the order of `of`'s stamps.

        Messages that measured the same, to the last digit, have the same number.
        """
        return self._contents.get(topic.name, np.zeros(0, dtype=np.int64))

    def shift(self, topic: Topic, offset_ns: int) -> None:
        """Add an offset to the stamps of a topic's messages, whose clock is off by so much."""
        self._offsets_ns[topic.name] = offset_ns

    def in_order(
        self, topic: Topic, due: Stamped
    ) -> Iterator[Image | CompressedImage | CameraInfo | LaserScan]:
        """Yield the decoded messages of a topic at the given stamps, in the stamps' order."""
        ids = topic.ids & self._decoders.keys()
        waiting: dict[int, Image | CompressedImage | CameraInfo | LaserScan] = {}
        offset_ns = self._offsets_ns.get(topic.name, 0)
        expected = dict.fromkeys(due.stamps_ns.tolist())
        for raw in self._source.messages(ids, log_times_ns=due.log_times_ns):
            try:
                message = self._decoders[raw.channel_id].decode(raw)
            except DecodingError as error:
                self.say_undecoded(topic.name, error)
                continue
            if isinstance(message, tuple | Pose) or message.frame_id != topic.frame_id:
                continue
            if offset_ns:
                message = replace(message, stamp_ns=message.stamp_ns + offset_ns)
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
        """Warn once that a message was left out, and why."""
        self._say("recording.damaged", f"A message on {topic} was left out: it {error}.")

    def _take_calibration(
        self, decoder: Decoder, raw: RawMessage, latest: dict[int, tuple[bytes, int | None]]
    ) -> None:
        """Keep a calibration unless it equals the one before; most differ only in their stamps.

        ``latest`` holds the bytes of each channel's last one, and which of those that are kept it
        is; None: none, for it belongs to another frame.
        """
        rest = bytes(raw.data[_BEHIND_STAMP:]) if decoder.begins_with_header else b""
        before, index = latest.get(raw.channel_id, (b"", None))
        if not rest or before != rest:
            message = decoder.decode(raw)
            assert isinstance(message, CameraInfo)
            assert self._roles.calibration is not None
            index = None
            if message.frame_id == self._roles.calibration.frame_id:
                if not self.calibrations or not is_same(message, self.calibrations[-1]):
                    self.calibrations.append(message)
                    self.calibration_counts.append(0)
                index = len(self.calibrations) - 1
            latest[raw.channel_id] = rest, index
        if index is not None:
            self.calibration_counts[index] += 1

    def _decoders_of(self, topic: Topic) -> dict[int, Decoder]:
        decoders, problem = decoders_of(topic.channels, self._limits)
        if topic.first is None or problem is not None:
            problem = topic.problem or problem or "cannot be read"
            self.say_undecoded(topic.name, DecodingError(problem))
        return decoders if topic.first is not None else {}

    def _survey(self) -> None:
        """Read the recording once for all transforms and for the stamps of images and scans."""
        topic_of = {id: t for t in (*self._topics, *self._roles.transforms) for id in t.ids}
        stamped: dict[str, list[tuple[int, int]]] = {}
        depth = self._roles.depth
        contents: dict[str, list[int]] = {topic.name: [] for topic in self._roles.lasers}
        if depth is not None:
            contents[depth.name] = []
        calibrated: dict[int, tuple[bytes, int | None]] = {}
        for transform in implied_transforms(self._roles):
            self.collector.add(transform)
        for raw in self._source.messages(self._decoders):
            decoder, topic = self._decoders[raw.channel_id], topic_of[raw.channel_id]
            try:
                if decoder.kind == TRANSFORMS:
                    message = decoder.decode(raw)
                    assert isinstance(message, tuple)
                    for transform in message:
                        self.collector.add(
                            transform,
                            publisher=raw.channel_id,
                            namespace=topic.namespace,
                            log_ns=raw.log_time_ns,
                        )
                    continue
                if decoder.kind == CALIBRATION:
                    self._take_calibration(decoder, raw, calibrated)
                    continue
                stamp_ns, frame_id = decoder.header(raw)
                if frame_id in topic.recorded_frames:
                    stamped.setdefault(topic.name, []).append((stamp_ns, raw.log_time_ns))
                    if topic.name in contents:
                        told = decoder.sample(raw) if topic is depth else decoder.measured(raw)
                        contents[topic.name].append(_content(told, len(contents[topic.name])))
                else:
                    self._others.setdefault(topic.name, []).append(frame_id)
            except DecodingError as error:
                self.say_undecoded(topic.name, error)
        self._stamped = {name: _by_stamp(pairs) for name, pairs in stamped.items()}
        for name in contents.keys() & stamped.keys():
            _, first = np.unique([stamp_ns for stamp_ns, _ in stamped[name]], return_index=True)
            self._contents[name] = np.array(contents[name], dtype=np.int64)[first]


def _content(told: bytes, number: int) -> int:
    """Return a number of what a message measured; equal measurements have equal numbers.

    What tells nothing has its own ``number``, and equals nothing.
    """
    if not told:
        return number
    digest = blake2b(told, digest_size=8).digest()
    return int.from_bytes(digest, "little", signed=True)


def _by_stamp(pairs: list[tuple[int, int]]) -> Stamped:
    """Sort (stamp, log time) pairs; of several messages with one stamp the first counts."""
    array = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    stamps, first = np.unique(array[:, 0], return_index=True)
    return Stamped(stamps, array[first, 1])


def only(have: Stamped, stamps_ns: ArrayLike | None) -> Stamped:
    """Return only the given stamps, or all if None is given."""
    if stamps_ns is None:
        return have
    kept = np.isin(have.stamps_ns, np.asarray(stamps_ns, dtype=np.int64))
    return Stamped(have.stamps_ns[kept], have.log_times_ns[kept])
