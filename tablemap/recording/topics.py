"""The topics of a recording that processing knows, each with its first message.

A camera's name is a topic's name without the words for its contents:
``/head_rgbd_sensor/depth_registered/image`` and ``/head_rgbd_sensor/rgb/image_raw`` belong to
``head_rgbd_sensor``. Depth is 16UC1, mono16 or 32FC1 and not called infrared, confidence or the
like.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from tablemap.config import LimitsConfig
from tablemap.errors import RecordingError
from tablemap.recording.decoding import Decoder
from tablemap.recording.depth import depth_encoding
from tablemap.recording.kinds import kind_of
from tablemap.recording.messages import (
    CameraInfo,
    CloudImage,
    CompressedImage,
    DecodingError,
    Image,
    LaserScan,
    Message,
)
from tablemap.recording.raw import Channel, Source
from tablemap.recording.rectification import flaw

NO_DEPTH = {
    *("confidence", "ir", "infra", "infra1", "infra2", "infrared", "disparity", "thermal"),
    *("amplitude", "intensity", "mask", "label", "labels", "segmentation", "semantic", "noise"),
}
_SHOWN = {
    *("depth", "rgb", "color", "colour", "ir", "infra", "infra1", "infra2", "infrared", "stereo"),
    *("left", "right", "image", "raw", "rect", "registered", "unregistered", "aligned", "to", "hw"),
    *("sw", "compresseddepth", "compressed", "rvl", "calibration", "confidence", "info", "mono"),
    *("points", "points2", "cloud", "pointcloud", "xyz", "xyzrgb"),
}
_FLAWED = 100  # calibrations that are looked at for one that is none of zeros
_ALIKE = 5  # messages that are looked at for two that are alike
_TRANSPORTS = ("compressedDepth", "compressed", "rvl", "theora", "zstd")
_COLOURS = ("rgb", "bgr", "mono8", "8uc3", "8uc4", "bayer", "yuv", "uyvy", "yuyv", "nv12", "nv21")


@dataclass(frozen=True, eq=False)
class Topic:
    """A topic that processing knows, and its first message (None: none can be decoded).

    Each publisher, and each version of a schema, has its own channel in a recording. All channels
    with the same kind of message on one topic are read as one.
    """

    name: str
    channels: tuple[Channel, ...]
    kind: str
    count: int
    first: Message | None
    problem: str | None = None

    @property
    def ids(self) -> frozenset[int]:
        """The channels' numbers."""
        return frozenset(channel.id for channel in self.channels)

    @property
    def frame_id(self) -> str:
        """The frame of the first message, empty for transforms."""
        return "" if self.first is None or isinstance(self.first, tuple) else self.first.frame_id

    @property
    def recorded_frames(self) -> tuple[str, ...]:
        """The frames that the headers may name; for points in a body's axes, the body's frame."""
        body = self.first.body_frame if isinstance(self.first, CloudImage) else None
        return (self.frame_id,) if body is None else (self.frame_id, body)

    @property
    def words(self) -> set[str]:
        """The words in the topic's name, in small letters."""
        return set(re.split(r"[^a-z0-9]+", self.name.lower()))

    @property
    def camera(self) -> str:
        """The topic's name without the words for its contents."""
        parts = [part for part in self.name.split("/") if part not in ("camera_info", "")]
        left = ("_".join(w for w in p.split("_") if w.lower() not in _SHOWN) for p in parts)
        return "/".join(part for part in left if part)

    @property
    def namespace(self) -> str:
        """The topic's name without its last part: empty for ``/tf``."""
        return self.name.rpartition("/")[0]

    @property
    def prefix(self) -> str:
        """The prefix of the frame's name: ``robot1`` in ``robot1/base_link``."""
        return self.frame_id.rpartition("/")[0]

    @property
    def folder(self) -> str:
        """The common begin of the topic's siblings, without its transport."""
        parts = self.name.split("/")
        if parts[-1] in _TRANSPORTS:
            parts = parts[:-1]
        return "/".join(parts[:-1])


def list_topics(source: Source, limits: LimitsConfig) -> list[Topic]:
    """Return the topics that processing knows, each with its first message."""
    alike: dict[tuple[str, str], list[Channel]] = {}
    for channel in source.channels.values():
        kind = kind_of(channel)
        if kind is not None:
            alike.setdefault((channel.topic, kind), []).append(channel)
    schemas = {
        (channel.message_encoding, channel.schema_name, channel.schema_data)
        for channels in alike.values()
        for channel in channels
    }
    if len(schemas) > limits.schemas:
        raise RecordingError(
            f"The recording's topics have {len(schemas)} different schemas of the types that are "
            f"read, {limits.over('schemas')}; raise the limit if it is sound."
        )
    topics = []
    for (name, kind), channels in alike.items():
        first, problem = _first_message(source, channels, limits)
        count = sum(source.counts[channel.id] for channel in channels)
        topics.append(Topic(name, tuple(channels), kind, count, first, problem))
    return topics


def _first_message(
    source: Source, channels: Sequence[Channel], limits: LimitsConfig
) -> tuple[Message | None, str | None]:
    """Return the first message that another one near it resembles, or why there is none.

    All others are measured by it: one wrong letter in its frame would leave out all of them.
    """
    decoders, problem = decoders_of(channels, limits)
    if not any(source.counts[channel.id] for channel in channels):
        return None, "has no messages"
    found: list[Message] = []
    flawed: Message | None = None
    for tried, raw in enumerate(source.messages(decoders)):
        try:
            message = decoders[raw.channel_id].decode(raw)
        except DecodingError as error:
            problem = str(error)
        else:
            # Drivers publish zeros until they know the calibration.
            if isinstance(message, CameraInfo) and flaw(message, rectified=False) is not None:
                flawed = flawed or message
            else:
                found.append(message)
                alike = [each for each in found if _looks(each) == _looks(message)]
                if isinstance(message, tuple) or len(alike) > 1:
                    return alike[0], None
        if len(found) >= _ALIKE or tried >= (_FLAWED if found or flawed else 10):
            break
    if found or flawed is not None:
        return found[0] if found else flawed, None
    return None, problem or "has no message that could be read"


def _looks(message: Message) -> tuple[object, ...]:
    """Return what the messages of one sensor have in common."""
    if isinstance(message, tuple):
        return ()
    if isinstance(message, CameraInfo):
        return message.frame_id, message.width, message.height, message.k.tobytes()
    if isinstance(message, Image):
        return message.frame_id, message.encoding, message.width, message.height
    if isinstance(message, CompressedImage):
        return message.frame_id, message.format
    if isinstance(message, LaserScan):
        return message.frame_id, message.angle_min, message.angle_increment
    return message.frame_id, message.child_frame


def decoders_of(
    channels: Sequence[Channel], limits: LimitsConfig
) -> tuple[dict[int, Decoder], str | None]:
    """Return the decoders by channel, and the problem of a channel that cannot be read, if any."""
    decoders: dict[int, Decoder] = {}
    problem = None
    for channel in channels:
        try:
            decoders[channel.id] = Decoder(channel, limits)
        except DecodingError as error:
            problem = str(error)
    return decoders, problem


def shows_depth(topic: Topic) -> bool:
    """Tell whether a topic's images may hold depth, by their encoding."""
    return isinstance(topic.first, Image | CompressedImage) and (
        depth_encoding(topic.first) is not None
    )


def shows_colour(topic: Topic) -> bool:
    """Tell whether a topic's images are pictures."""
    if isinstance(topic.first, Image):
        return topic.first.encoding.lower().startswith(_COLOURS) and not topic.words & NO_DEPTH
    return (
        isinstance(topic.first, CompressedImage)
        and depth_encoding(topic.first) is None
        and not topic.words & NO_DEPTH
        and "depth" not in topic.words
    )
