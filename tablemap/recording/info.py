"""The contents of a recording, and what is missing for processing, for people or as JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, Literal

import numpy as np

from tablemap.config import LimitsConfig, TopicsConfig
from tablemap.errors import ProcessWarning, RecordingError, with_cause
from tablemap.inputs import AnyInput, Input
from tablemap.recording.calibrations import valid_calibrations
from tablemap.recording.carried import carried_warnings
from tablemap.recording.clocks import difference
from tablemap.recording.decoding import Decoder
from tablemap.recording.depth import decode_depth, depth_encoding
from tablemap.recording.floor import MOST_VIEWS
from tablemap.recording.judgement import judged, sampled
from tablemap.recording.messages import (
    CameraInfo,
    CompressedImage,
    DecodingError,
    Image,
    LaserScan,
    Message,
)
from tablemap.recording.pose_topics import read_poses
from tablemap.recording.raw import Channel, Source
from tablemap.recording.reader import open_recording
from tablemap.recording.rectification import rectification
from tablemap.recording.robots import Placed, placed
from tablemap.recording.roles import Roles, find_roles, implied_transforms, missing_roles
from tablemap.recording.sensor_clocks import tf_lags
from tablemap.recording.sources import open_source
from tablemap.recording.tf.collector import TransformCollector
from tablemap.recording.tf.frame_roles import FrameNames, pose_stamps
from tablemap.recording.tf.poses import PoseTrack
from tablemap.recording.topics import Topic, decoders_of, list_topics
from tablemap.recording.window import windowed
from tablemap.words import counted

_DEEPEST = 50  # levels of the TF tree that are shown
_MOST_PLACES = 64  # places of a long recording at which transforms are read for the TF tree


@dataclass(frozen=True)
class TopicInfo:
    """A topic: ``role`` and ``problem`` are None where it has none, ``detail`` may be empty."""

    name: str
    schema: str
    encoding: str
    role: str | None
    count: int
    rate_hz: float | None
    detail: str
    problem: str | None


@dataclass(frozen=True)
class FrameInfo:
    """An edge of the TF tree."""

    parent: str
    child: str
    is_static: bool


@dataclass(frozen=True)
class RoleFitness:
    """How fit for processing is what a recording has for one role, and why."""

    role: str
    state: Literal["fine", "weak", "missing"]
    says: str


@dataclass(frozen=True)
class RecordingInfo:
    """The result of `inspect`. Times are log times; ``missing`` is empty if processing can start.

    ``frames_sampled`` says that the transforms of a long recording were read only at some places;
    ``fitness`` is empty until somebody has judged it.
    """

    path: str
    size_bytes: int
    profile: str
    library: str
    start_ns: int
    end_ns: int
    messages: int
    topics: tuple[TopicInfo, ...]
    frames: tuple[FrameInfo, ...]
    frames_sampled: bool
    frame_roles: FrameNames | None
    missing: tuple[str, ...]
    warnings: tuple[ProcessWarning, ...]
    fitness: tuple[RoleFitness, ...] = ()

    @property
    def duration_s(self) -> float:
        """The time from the first message to the last."""
        return (self.end_ns - self.start_ns) / 1e9

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as values for JSON."""
        return {**asdict(self), "duration_s": self.duration_s, "processable": not self.missing}

    def tree_lines(self) -> list[str]:
        """Return the TF tree as indented lines, each frame below its parent."""
        children: dict[str, list[FrameInfo]] = {}
        for edge in self.frames:
            children.setdefault(edge.parent, []).append(edge)
        roots = sorted(set(children) - {edge.child for edge in self.frames})
        lines: list[str] = []
        shown: set[str] = set()
        # A tree that is a circle has no root: start at any of its frames.
        waiting = [(root, 0, "") for root in reversed(roots or sorted(children)[:1])]
        while waiting:
            name, indent, note = waiting.pop()
            again = " (as above)" if name in shown and name in children else ""
            lines.append("  " * indent + name + note + again)
            if name in shown:  # a frame with two parents is followed once
                continue
            shown.add(name)
            if indent == _DEEPEST and name in children:
                lines.append("  " * (indent + 1) + "... (more below)")
                continue
            below = sorted(children.get(name, []), key=lambda each: each.child, reverse=True)
            waiting += [
                (edge.child, indent + 1, " (static)" if edge.is_static else "") for edge in below
            ]
        return lines


def inspect(
    recording: AnyInput, *, topics: TopicsConfig | None = None, limits: LimitsConfig | None = None
) -> RecordingInfo:
    """Return the contents of a recording, and read no more of it than needed.

    ``topics`` may name topics and frames; roles that it does not name are found. Raises
    `RecordingError` if the file is no recording, or lacks the named topics.
    """
    given = Input.of(recording)
    config, limits = topics or TopicsConfig(), limits or LimitsConfig()
    warnings: list[ProcessWarning] = []
    with closing(open_source(given, warnings=warnings, limits=limits)) as whole:
        source = windowed(whole, config.start, config.end)
        warnings += carried_warnings(source)
        known = list_topics(source, limits)
        names = sorted({channel.topic for channel in source.channels.values()})
        roles, choices = find_roles(known, config, all_names=names)
        missing = missing_roles(source, roles, known)
        collector, sampled = _sampled_transforms(source, roles, limits)
        frame_roles: FrameNames | None = None
        localisation: PoseTrack | None = None
        tree = collector.tree()
        if roles.depth is not None and roles.calibration is not None:
            missing += _unfit_calibration(roles.depth, roles.calibration)
            if roles.transforms or roles.poses:
                try:
                    found = placed(collector, roles, config, partial(_poses, source, roles, limits))
                    tree, frame_roles, roles = found.tree, found.names, found.roles
                    localisation = found.localisation
                    choices += found.warnings
                    if _clocks_are_suspect(source, found, collector, limits):
                        choices += _said_of_clocks(given, config, limits)
                    choices += _judged(source, found, config, limits)
                except RecordingError as error:
                    missing.append(str(error))
    return RecordingInfo(
        path=str(given),
        size_bytes=given.size(),
        profile=source.profile,
        library=source.library,
        start_ns=source.start_ns,
        end_ns=source.end_ns,
        messages=sum(source.counts.values()),
        topics=_topic_infos(source, known, roles, localisation),
        frames=tuple(
            FrameInfo(edge.parent, edge.child, edge.is_static)
            for child in sorted(tree.edges)
            for edge in tree.edges[child]
        ),
        frames_sampled=sampled,
        frame_roles=frame_roles,
        missing=tuple(with_cause(sentence, warnings) for sentence in missing),
        warnings=(*warnings, *(choice for choice in choices if choice not in warnings)),
    )


def _topic_infos(
    source: Source, known: Sequence[Topic], roles: Roles, localisation: PoseTrack | None
) -> tuple[TopicInfo, ...]:
    used = [] if localisation is None else [localisation.topic]
    roles_of = (
        *(("pose", topic) for topic in roles.poses if topic.name in used),
        ("depth", roles.depth),
        ("calibration", roles.calibration),
        ("colour", roles.colour),
        ("laser", roles.laser),
        *(("transforms", topic) for topic in roles.transforms),
    )
    duration = (source.end_ns - source.start_ns) / 1e9

    def info(channel: Channel, count: int, topic: Topic | None) -> TopicInfo:
        return TopicInfo(
            channel.topic,
            channel.schema_name,
            channel.message_encoding,
            next((role for role, has in roles_of if has is not None and has is topic), None),
            count,
            (count - 1) / duration if count > 1 and duration > 0 else None,
            "" if topic is None else _detail(topic),
            None if topic is None else topic.problem,
        )

    read = {id for topic in known for id in topic.ids}
    infos = [info(topic.channels[0], topic.count, topic) for topic in known]
    infos += [
        info(channel, source.counts[id], None)
        for id, channel in source.channels.items()
        if id not in read
    ]
    return tuple(sorted(infos, key=lambda info: info.name))


def _detail(topic: Topic) -> str:
    described = _described(topic.first)
    if len(topic.channels) > 1:
        described += f"{', ' if described else ''}on {len(topic.channels)} channels"
    return described


def _described(message: Message | None) -> str:
    """Describe a message in a few words."""
    if isinstance(message, Image):
        return f"{message.width} x {message.height} {message.encoding}, in {message.frame_id}"
    if isinstance(message, CompressedImage):
        kind = message.format or depth_encoding(message) or "unknown format"
        return f"{kind}, in {message.frame_id}"
    if isinstance(message, CameraInfo):
        distorted = "distorted" if np.any(message.d) else "undistorted"
        return f"{message.width} x {message.height}, {distorted}, in {message.frame_id}"
    if isinstance(message, LaserScan):
        return f"{counted(len(message.ranges), 'beam')}, in {message.frame_id}"
    return ""


def _sampled_transforms(
    source: Source, roles: Roles, limits: LimitsConfig
) -> tuple[TransformCollector, bool]:
    """Read the transforms; in a long recording only the static ones and those at some places."""
    decoders: dict[int, Decoder] = {}
    for topic in roles.transforms:
        if topic.first is not None:
            decoders |= decoders_of(topic.channels, limits)[0]
    static = {id for id, decoder in decoders.items() if "static" in decoder.channel.topic}
    collector = TransformCollector(limits)
    for transform in implied_transforms(roles):
        collector.add(transform)
    sampled = False
    for channels in (static, decoders.keys() - static):
        messages, are_all = source.sample(channels, most=_MOST_PLACES)
        sampled |= not are_all
        for raw in messages:
            try:
                message = decoders[raw.channel_id].decode(raw)
            except DecodingError:
                continue  # processing says so; the tree is read from the others
            if isinstance(message, tuple):
                for transform in message:
                    collector.add(
                        transform,
                        publisher=raw.channel_id,
                        namespace=source.channels[raw.channel_id].topic.rpartition("/")[0],
                        log_ns=raw.log_time_ns,
                    )
    return collector, sampled


def _poses(source: Source, roles: Roles, limits: LimitsConfig) -> list[PoseTrack]:
    """Read the topics of poses, of a long recording some places."""
    return read_poses(
        source, roles.poses, limits, read=lambda ids: source.sample(ids, most=_MOST_PLACES)[0]
    )


def _clocks_are_suspect(
    source: Source, found: Placed, collector: TransformCollector, limits: LimitsConfig
) -> bool:
    """Tell by a few messages whether a sensor's clock may differ from that of TF."""
    tf = tf_lags(found.tree, found.names, collector)
    poses = pose_stamps(found.tree, found.names.fixed, found.names.carrier)
    for topic in (found.roles.depth, found.roles.laser):
        if topic is None:
            continue
        decoders = decoders_of(topic.channels, limits)[0]
        stamps, lags = [], []
        for raw in source.sample(decoders, most=MOST_VIEWS)[0]:
            try:
                stamps.append(decoders[raw.channel_id].header(raw)[0])
            except DecodingError:
                continue
            lags.append((raw.log_time_ns - stamps[-1]) / 1e9)
        if not stamps:
            continue
        apart = difference(np.array(lags), tf)
        if apart is not None and apart.is_suspect:
            return True
        is_outside = len(poses) > 1 and (max(stamps) < poses[0] or min(stamps) > poses[-1])
        if is_outside:
            return True
    return False


def _said_of_clocks(
    given: Input, config: TopicsConfig, limits: LimitsConfig
) -> list[ProcessWarning]:
    """Say what reading all of the recording shows of its clocks; raises what processing raises."""
    with open_recording(given, topics=config, limits=limits) as recording:
        return [each for each in recording.warnings if each.code.endswith(".clock")]


def _judged(
    source: Source, found: Placed, config: TopicsConfig, limits: LimitsConfig
) -> list[ProcessWarning]:
    """Say what the floor in a few images tells of depth and calibration."""
    roles = found.roles
    assert roles.depth is not None
    assert roles.calibration is not None
    assert isinstance(roles.calibration.first, CameraInfo)
    calibrations, warnings = valid_calibrations(
        [roles.calibration.first], topic=roles.calibration.name, depth=roles.depth.name
    )
    judgement = judged(
        sampled(_few_images(source, roles.depth, limits), found.tree, found.names),
        calibrations,
        roles,
        config,
        is_height_known=not found.names.base_is_virtual,
    )
    return [*warnings, *judgement.warnings]


def _few_images(
    source: Source, depth: Topic, limits: LimitsConfig
) -> Iterator[Image | CompressedImage]:
    """Yield a few of the depth images, spread over the recording."""
    decoders = decoders_of(depth.channels, limits)[0]
    apart_ns = (source.end_ns - source.start_ns) // (2 * MOST_VIEWS)
    last_ns: int | None = None
    for raw in source.sample(decoders, most=MOST_VIEWS)[0]:
        if last_ns is not None and raw.log_time_ns - last_ns < apart_ns:
            continue
        last_ns = raw.log_time_ns
        try:
            message = decoders[raw.channel_id].decode(raw)
        except DecodingError:
            continue
        if isinstance(message, Image | CompressedImage) and message.frame_id == depth.frame_id:
            yield message


def _unfit_calibration(depth: Topic, calibration: Topic) -> list[str]:
    info, image = calibration.first, depth.first
    assert isinstance(info, CameraInfo)
    assert isinstance(image, Image | CompressedImage)
    try:
        height, width = decode_depth(image).shape
        rectification(info, width=width, height=height, topic=depth.name)
    except RecordingError as error:
        return [str(error)]
    except DecodingError as error:
        return [f"The first depth image on {depth.name} {error}."]
    return []
