"""A recording as it is: an .rrd of the raw log, for a look at it before anything is processed.

Our readers draw what they know, of every container and encoding: images, depth, scans, poses and
frames. The other topics of an MCAP are left to Rerun's own importer.
"""

from __future__ import annotations

import re
from collections import Counter
from contextlib import closing
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from tablemap import palette
from tablemap.config import LimitsConfig, ReviewConfig, TopicsConfig
from tablemap.errors import ProcessWarning, RecordingError
from tablemap.inputs import AnyInput, Input
from tablemap.recording.depth import decode_depth
from tablemap.recording.messages import (
    CameraInfo,
    CloudImage,
    CompressedImage,
    DecodingError,
    Image,
    LaserScan,
    Message,
    Pose,
    TransformStamped,
)
from tablemap.recording.raw import Source
from tablemap.recording.sources import open_source
from tablemap.recording.topics import Topic, decoders_of, list_topics, shows_depth
from tablemap.recording.window import windowed
from tablemap.review.eyes import GRID
from tablemap.review.images import colour_archetype, depth_archetype
from tablemap.review.sensors import IMAGE_PLANE, scan_points
from tablemap.review.stream import Stream, sensor_times
from tablemap.review.viewer.viewer import rrd_tool, viewer_tool
from tablemap.words import counted

TRANSFORMS_AT_ONCE = 20_000
ARROW_METRES = 0.3
IMPORTERS = ("ros2msg", "ros2_reflection", "foxglove", "protobuf")


def write_raw(
    recording: AnyInput,
    folder: Path,
    *,
    topics: TopicsConfig | None = None,
    limits: LimitsConfig | None = None,
) -> tuple[Path, list[ProcessWarning]]:
    """Write the raw log of a recording as an .rrd in ``folder``; return it and what was lost.

    ``topics`` says which part of the drive. Raises `RecordingError` if it is no recording, or has
    no messages there.
    """
    given, config = Input.of(recording), topics or TopicsConfig()
    limits = limits or LimitsConfig()
    warnings: list[ProcessWarning] = []
    with closing(open_source(given, warnings=warnings, limits=limits)) as whole:
        source = windowed(whole, config.start, config.end)
        known = [topic for topic in list_topics(source, limits) if topic.first is not None]
        others = sorted(
            {channel.topic for id, channel in source.channels.items() if source.counts.get(id)}
            - {topic.name for topic in known}
        )
        if not known and not others:
            raise RecordingError(f"Expected a recording with messages, found none: {given}")
        file = folder / f"{given.stem}.rrd"
        identity = f"raw-{given.stem}"
        stream = Stream(
            file, run_id=identity, recording_name=given.name, config=ReviewConfig(level="full")
        )
        log = _RawLog(stream, source, known)
        log.write(limits)
        stream.close()
        if others and not given.is_remote and source.profile != "ros1":
            file = _with_others(given, source, file, identity, others)
    return file, warnings


class _RawLog:
    """The log that is being written: each topic is an entity, each frame a named one."""

    def __init__(self, stream: Stream, source: Source, topics: list[Topic]) -> None:
        self._stream = stream
        self._source = source
        self._topics = topics
        self._pinholes = {
            topic.frame_id: topic.first for topic in topics if isinstance(topic.first, CameraInfo)
        }
        self._has_pinhole: set[str] = set()
        self._in_space: set[str] = set()
        self._parents: dict[str, str] = {}
        self._moving: dict[str, list[TransformStamped]] = {}
        self._held = 0

    def write(self, limits: LimitsConfig) -> None:
        """Log every message, and at the end the layout that shows them."""
        channels = [channel for topic in self._topics for channel in topic.channels]
        decoders, _ = decoders_of(channels, limits)
        depth = {topic.name for topic in self._topics if shows_depth(topic)}
        lost: Counter[str] = Counter()
        for raw in self._source.messages(decoders):
            topic = decoders[raw.channel_id].channel.topic
            try:
                self._log(topic, decoders[raw.channel_id].decode(raw), is_depth=topic in depth)
            except DecodingError as error:
                lost[f"{topic} {error}"] += 1
        self._send_transforms()
        self._stream.rec.reset_time()
        for what, times in lost.items():
            said = f"{counted(times, 'message')} not shown: {what}"
            self._stream.rec.log("log", rr.TextLog(said, level="WARN"), static=True)
        self._stream.show(self._layout(depth, are_lost=bool(lost)))

    def _log(self, topic: str, message: Message, *, is_depth: bool) -> None:
        if isinstance(message, tuple):
            self._hold_transforms(message)
            return
        self._at(message.stamp_ns)
        entity = _entity(topic)
        if isinstance(message, LaserScan):
            self._stream.log(entity, scan_points(message), frame=message.frame_id)
        elif isinstance(message, Pose):
            arrow = rr.Arrows3D(
                vectors=[_forward(message)],
                origins=[message.translation],
                colors=[palette.LOCALISED.on_dark],
            )
            self._stream.log(entity, arrow, frame=message.frame_id)
        elif isinstance(message, (Image, CompressedImage)):
            self._log_image(entity, message, is_depth=is_depth)

    def _log_image(self, entity: str, message: Image | CompressedImage, *, is_depth: bool) -> None:
        archetype: rr.AsComponents | None
        if is_depth:
            depth = decode_depth(message)
            self._log_pinhole(entity, message, depth.shape)
            archetype = depth_archetype(message, depth)
        else:
            archetype = colour_archetype(message)
            if archetype is None:
                kind = message.encoding if isinstance(message, Image) else message.format
                raise DecodingError(f"has an encoding that the viewer does not show: {kind!r}")
        if entity in self._has_pinhole:
            self._in_space.add(f"{entity}/image")
            plane = f"{message.frame_id}/{entity}{IMAGE_PLANE}"
            self._stream.log(f"{entity}/image", archetype, frame=plane)
        else:
            self._stream.log_flat(f"{entity}/image", archetype)

    def _log_pinhole(
        self, entity: str, message: Image | CompressedImage, shape: tuple[int, ...]
    ) -> None:
        """Log the camera of a depth image once: points are made from its pixels."""
        if entity in self._has_pinhole:
            return
        known = self._pinholes.get(message.frame_id)
        if isinstance(message, CloudImage):
            k = message.k
        elif isinstance(known, CameraInfo) and (known.height, known.width) == shape:
            k = known.k
        else:
            return
        self._has_pinhole.add(entity)
        pinhole = rr.Pinhole(
            image_from_camera=k,
            height=shape[0],
            width=shape[1],
            parent_frame=message.frame_id,
            child_frame=f"{message.frame_id}/{entity}{IMAGE_PLANE}",
            image_plane_distance=0.25,
            color=palette.TEXT.on_dark,
        )
        self._stream.rec.log(entity, pinhole, static=True)

    def _at(self, stamp_ns: int) -> None:
        self._stream.rec.reset_time()
        self._stream.rec.set_time("sensor_time", timestamp=np.datetime64(stamp_ns, "ns"))

    def _hold_transforms(self, transforms: tuple[TransformStamped, ...]) -> None:
        """Keep moving transforms, to be written many at once; a child keeps its first parent."""
        for each in transforms:
            if self._parents.setdefault(each.child_frame, each.parent_frame) != each.parent_frame:
                first = self._parents[each.child_frame]
                raise DecodingError(
                    f"has {each.child_frame} below {each.parent_frame}, which is below {first}"
                )
            if each.is_static:
                self._stream.rec.log(
                    _transform_entity(each.child_frame),
                    rr.Transform3D(
                        translation=each.translation,
                        quaternion=rr.Quaternion(xyzw=each.rotation),
                        parent_frame=each.parent_frame,
                        child_frame=each.child_frame,
                    ),
                    static=True,
                )
                continue
            self._moving.setdefault(each.child_frame, []).append(each)
            self._held += 1
        if self._held >= TRANSFORMS_AT_ONCE:
            self._send_transforms()

    def _send_transforms(self) -> None:
        for child, held in self._moving.items():
            self._stream.rec.send_columns(
                _transform_entity(child),
                indexes=[sensor_times([each.stamp_ns for each in held])],
                columns=rr.Transform3D.columns(
                    translation=[each.translation for each in held],
                    quaternion=[each.rotation for each in held],
                    parent_frame=[each.parent_frame for each in held],
                    child_frame=[each.child_frame for each in held],
                ),
            )
        self._moving, self._held = {}, 0
        self._stream.flush()

    def _layout(self, depth: set[str], *, are_lost: bool) -> rrb.Blueprint:
        """Return the layout: what lies in space on the left, the images beside it, depth first."""
        pictures = [
            topic for topic in self._topics if isinstance(topic.first, (Image, CompressedImage))
        ]
        pictures.sort(key=lambda topic: topic.name not in depth)
        entities = {topic.name: f"{_entity(topic.name)}/image" for topic in pictures}
        flat = [entity for entity in entities.values() if entity not in self._in_space]
        space = rrb.Spatial3DView(
            name="Space",
            origin="/",
            contents=["+ /**", "- /log/**", *(f"- /{entity}/**" for entity in flat)],
            background=palette.BACKGROUND,
            line_grid=rrb.LineGrid3D(color=GRID),
            spatial_information=rrb.SpatialInformation(target_frame=self._root()),
        )
        beside: list[rrb.View | rrb.Container] = [
            rrb.Spatial2DView(name=name, origin=entity, background=palette.BACKGROUND)
            for name, entity in entities.items()
        ]
        if are_lost:
            beside.append(rrb.TextLogView(name="Not shown", origin="log"))
        shown = [*beside[:2], *([rrb.Tabs(*beside[2:])] if len(beside) > 2 else [])]
        column = [rrb.Vertical(*shown)] if shown else []
        return rrb.Blueprint(
            rrb.Horizontal(
                space, *column, column_shares=[1.6, 1.0][: 1 + len(column)], name="Overview"
            ),
            rrb.BlueprintPanel(state="collapsed"),
            rrb.SelectionPanel(state="collapsed"),
            rrb.TimePanel(timeline="sensor_time"),
            auto_views=False,
            auto_layout=False,
        )

    def _root(self) -> str:
        """Return the frame above most frames; without transforms that of a sensor."""
        roots: Counter[str] = Counter()
        for child in self._parents:
            frame, seen = child, {child}
            while frame in self._parents and self._parents[frame] not in seen:
                frame = self._parents[frame]
                seen.add(frame)
            roots[frame] += 1
        if roots:
            return roots.most_common(1)[0][0]
        return next((topic.frame_id for topic in self._topics if topic.frame_id), "map")


def _entity(topic: str) -> str:
    return rr.new_entity_path([part for part in topic.split("/") if part]).lstrip("/") or "topic"


def _transform_entity(frame: str) -> str:
    return rr.new_entity_path(["tf", frame]).lstrip("/")


def _forward(pose: Pose) -> tuple[float, float, float]:
    """Return the x axis of a pose, as long as its arrow."""
    x, y, z, w = pose.rotation
    forward = (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y))
    return tuple(ARROW_METRES * part for part in forward)  # type: ignore[return-value]


def _with_others(
    given: Input, source: Source, file: Path, identity: str, topics: list[str]
) -> Path:
    """Return a file that also has what Rerun's importer makes of the other topics of an MCAP.

    What it cannot read, such as other containers, it leaves out.
    """
    imported, merged = file.with_suffix(".others.rrd"), file.with_suffix(".all.rrd")
    chosen = [part for topic in topics for part in ("-y", f"^{re.escape(topic)}$")]
    kinds = [part for kind in IMPORTERS for part in ("-d", kind)]
    times = ["--start-time", f"{source.start_ns}ns", "--end-time", f"{source.end_ns + 1}ns"]
    done = viewer_tool(
        "mcap", "convert", given.path, "-o", imported, *kinds, "--disable-raw-fallback", *chosen,
        *times, "--recording-id", identity, "--application-id", "tablemap",
    )  # fmt: skip
    if done.returncode != 0 or not imported.is_file():
        return file
    done = rrd_tool("merge", file, imported, "-o", merged)
    return merged if done.returncode == 0 and merged.is_file() else file
