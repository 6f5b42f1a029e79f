"""From a recording's stamps and poses to its snapshots, in two passes."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tablemap.config import SensorsConfig, SnapshotsConfig
from tablemap.errors import EstimationError, ProcessWarning, RecordingError
from tablemap.geometry import Ints, Pose2, invert
from tablemap.recording import DepthFrame, Recording
from tablemap.stages.snapshots.camera_kind import looked_at, seen_camera
from tablemap.stages.snapshots.combining import combine
from tablemap.stages.snapshots.directions import by_direction, planar_pose, same_mount, views_at
from tablemap.stages.snapshots.grounding import on_the_ground
from tablemap.stages.snapshots.mending import changed, mended
from tablemap.stages.snapshots.noise import depth_noise
from tablemap.stages.snapshots.own_body import without_own_body
from tablemap.stages.snapshots.result import (
    Camera,
    SeenCamera,
    SetAside,
    Snapshot,
    Snapshots,
    SnapshotsKind,
    Viewpoint,
)
from tablemap.stages.snapshots.rounding import find_rounding
from tablemap.stages.snapshots.stops import (
    choose_by_new_view,
    far_apart,
    is_same_place,
    sample_motion,
    slow_views,
    standing_intervals,
)
from tablemap.words import counted

_NOD = np.deg2rad(10.0)  # a moving robot nods by less; a hand that tilts its camera shows more
_LEAST_STOPS = 3  # this many stops, with a tenth of the images, are planned and not by chance


def take_snapshots(
    recording: Recording, *, config: SnapshotsConfig, sensors: SensorsConfig
) -> Snapshots:
    """Find the viewpoints by the poses, then decode and combine only their images.

    Raises the errors of `find_viewpoints`, and `EstimationError` if no image can be decoded.
    """
    kind, viewpoints, aside = find_viewpoints(recording, config=config, sensors=sensors)
    kept, reason = _limit(recording, viewpoints, kind, config)
    for i in np.setdiff1d(np.arange(len(viewpoints)), kept):
        aside.append(SetAside("viewpoint", viewpoints[i].middle_ns, reason))
    snapshots, dropped, camera = _decode(recording, [viewpoints[i] for i in kept], config)
    if not snapshots:
        reasons = Counter(entry.reason for entry in dropped)
        why = ", ".join(f"{reason} ({count})" for reason, count in reasons.most_common())
        raise EstimationError(
            f"Expected depth images at {counted(len(kept), 'viewpoint')}, but none could be used: "
            f"{why}; see the warnings of `tablemap info`: {recording.input}"
        )
    aside = sorted([*aside, *dropped], key=lambda entry: entry.stamp_ns)
    snapshots, grounded = _on_the_ground(recording, snapshots)
    cleared, body = without_own_body(snapshots)
    notes = _camera_notes(camera, sensors) + grounded + body
    return Snapshots(tuple(cleared), tuple(aside), kind, camera, notes)


def _on_the_ground(
    recording: Recording, snapshots: list[Snapshot]
) -> tuple[list[Snapshot], tuple[ProcessWarning, ...]]:
    """Take a drift of the base's height and tilt back; a camera in a hand has none to stand on."""
    if recording.names.base_is_virtual:
        return snapshots, ()
    stamps = np.array([one.stamp_ns for one in snapshots], dtype=np.int64)
    return on_the_ground(snapshots, list(recording.base_from_cameras(stamps)[0]))


def _camera_notes(camera: SeenCamera, sensors: SensorsConfig) -> tuple[ProcessWarning, ...]:
    """Say if the camera's kind or name changes what is believed of the sensors."""
    _, taken = sensors.of_camera(camera.kind)
    if not taken:
        return ()
    values = ", ".join(f"sensors.{name} = {value:g}" for name, value in taken.items())
    named = f"named {sensors.depth_camera}; " if sensors.depth_camera else ""
    message = (
        f"{named}{camera}: {values} taken in place of the defaults (--set "
        "sensors.depth_camera=NAME takes another's)"
    )
    return (ProcessWarning("snapshots.camera", "snapshots", message),)


def find_viewpoints(
    recording: Recording, *, config: SnapshotsConfig, sensors: SensorsConfig
) -> tuple[SnapshotsKind, list[Viewpoint], list[SetAside]]:
    """Find by the poses where images were taken; return also the images outside of that.

    Each stop gives one viewpoint, or one for each direction in which the camera rested there. If
    the base never stands still, every image is one. Raises `RecordingError` without depth images,
    and `EstimationError` if none of them has a pose.
    """
    stamps = np.unique(recording.depth_stamps())
    if len(stamps) == 0:
        raise RecordingError(
            "Expected depth images, found none; record the depth topic or name it with "
            f"--set topics.depth=TOPIC: {recording.input}"
        )
    located, aside = _with_pose(recording, stamps)
    kind, stops = _plan(recording, located, config, sensors)
    viewpoints: list[Viewpoint] = []
    for stop in stops:
        parts, unused = by_direction(recording, stop, config)
        viewpoints += parts
        aside += unused
    return kind, viewpoints, aside


def _with_pose(recording: Recording, stamps: Ints) -> tuple[Ints, list[SetAside]]:
    """Return the stamps with a localised pose, and a note for each stamp without one."""
    known = recording.fixed_from_bases(stamps)[1]
    names = recording.names
    if not known.any():
        poses = recording.pose_stamps()
        span = (
            f"poses cover {(int(poses[-1]) - int(poses[0])) / 1e9:.1f} s from "
            f"{(int(poses[0]) - int(stamps[0])) / 1e9:+.1f} s after the first image"
            if len(poses)
            else "no pose was recorded"
        )
        raise EstimationError(
            f"Expected the pose of {names.base!r} in {names.fixed!r} at the depth images' stamps, "
            f"found none on /tf ({span}); record /tf and /tf_static, or set topics.fixed_frame and "
            f"topics.base_frame: {recording.input}"
        )
    reason = f"no pose of {names.base!r} in {names.fixed!r} at its stamp"
    return stamps[known], [SetAside("depth image", int(s), reason) for s in stamps[~known]]


def _plan(
    recording: Recording,
    stamps: Ints,
    config: SnapshotsConfig,
    sensors: SensorsConfig,
) -> tuple[SnapshotsKind, list[Viewpoint]]:
    """Return the kind of recording and its viewpoints, before any limit on their number."""
    poses = recording.pose_stamps()
    if far_apart(stamps) and (len(poses) < 2 or far_apart(poses)):
        return "stops", _by_place(recording, stamps)
    motion = sample_motion(recording, stamps)
    intervals = standing_intervals(motion, config, sensors)
    stops = []
    for start, end in intervals:
        inside = stamps[(stamps >= start) & (stamps <= end)]
        if len(inside):
            stops.append(Viewpoint(start, end, inside))
    standing = sum(len(stop.stamps_ns) for stop in stops)
    if len(stops) >= _LEAST_STOPS and 10 * standing >= len(stamps):
        shown = np.concatenate([stop.stamps_ns for stop in stops])
        slow = slow_views(motion, stamps, shown, config)
        stops += [Viewpoint(int(s), int(s), np.array([s])) for s in slow]
        return "stops", sorted(stops, key=lambda stop: stop.start_ns)
    if stops and 2 * standing >= len(stamps):
        return "stops", stops
    if far_apart(stamps):
        return "stops", _by_place(recording, stamps)
    return "keyframes", [Viewpoint(int(s), int(s), np.array([s])) for s in stamps]


def _by_place(recording: Recording, stamps: Ints) -> list[Viewpoint]:
    """Group images that are far apart in time: consecutive ones at one place are one viewpoint."""
    groups: list[list[int]] = []
    place: Pose2 | None = None
    for stamp in stamps:
        pose = planar_pose(recording, int(stamp))
        if place is not None and is_same_place(place, pose):
            groups[-1].append(int(stamp))
            continue
        groups.append([int(stamp)])
        place = pose
    return [Viewpoint(g[0], g[-1], np.array(g, dtype=np.int64)) for g in groups]


def _limit(
    recording: Recording, viewpoints: list[Viewpoint], kind: str, config: SnapshotsConfig
) -> tuple[Ints, str]:
    """Return which viewpoints to keep, at most the configured number, and why not the others."""
    most = _most(kind, config)
    if all(len(v.stamps_ns) > 1 or v.end_ns > v.start_ns for v in viewpoints) and (
        len(viewpoints) <= most
    ):
        return np.arange(len(viewpoints)), ""
    views = views_at(recording, np.array([v.middle_ns for v in viewpoints], dtype=np.int64))
    nod = _NOD if kind == "keyframes" else 0.0
    new = choose_by_new_view(views, len(views), config, nod=nod)
    if len(new) <= most:
        return new, f"it shows nothing new beside the {counted(len(new), 'view')} kept"
    reason = f"it is not among the {counted(most, 'viewpoint')} with the most views"
    return choose_by_new_view(views, most, config, nod=nod), reason


def _most(kind: str, config: SnapshotsConfig) -> int:
    return min(config.maximum, config.maximum_at_stops) if kind == "stops" else config.maximum


def _decode(
    recording: Recording, viewpoints: list[Viewpoint], config: SnapshotsConfig
) -> tuple[list[Snapshot], list[SetAside], SeenCamera]:
    """Stream the chosen images, with the images of one viewpoint in memory at a time."""
    alone: list[NDArray[np.float32]] = []  # combined ones have neither the steps nor the noise
    looked = looked_at(len(viewpoints))
    chosen = [_spread(v.stamps_ns, config.images_per_stop) for v in viewpoints]
    owner = {int(s): i for i, stamps in enumerate(chosen) for s in stamps}
    colours = recording.colour_near(np.array([v.middle_ns for v in viewpoints], dtype=np.int64))
    snapshots: list[Snapshot] = []
    aside: list[SetAside] = []
    cameras: dict[Camera, Camera] = {}

    def finish(which: int, frames: list[DepthFrame]) -> None:
        viewpoint = viewpoints[which]
        alike = _alike(frames)
        aside.extend(
            SetAside("depth image", f.stamp_ns, "the camera moved, or changed, during the stop")
            for i, f in enumerate(frames)
            if i not in alike
        )
        same = [frames[i] for i in alike]
        middle = same[len(same) // 2]
        if which in looked:
            alone.append(middle.depth)
        camera = _camera(middle)
        fixed_from_base = recording.fixed_from_base(middle.stamp_ns)
        if fixed_from_base is None:
            aside.append(SetAside("depth image", middle.stamp_ns, "no pose at its stamp"))
            return
        pose = Pose2.projected(fixed_from_base)
        wheels = recording.odom_from_base(middle.stamp_ns)
        recorded = combine([f.depth for f in same])
        noise = depth_noise(recorded)
        depth = mended(recorded, noise)
        snapshots.append(
            Snapshot(
                index=len(snapshots),
                stamp_ns=middle.stamp_ns,
                start_ns=viewpoint.start_ns,
                end_ns=viewpoint.end_ns,
                images=len(same),
                depth=depth,
                camera=cameras.setdefault(camera, camera),
                base_from_camera=invert(pose.lifted()) @ fixed_from_base @ middle.base_from_camera,
                map_from_base=pose,
                odom_from_base=None if wheels is None else Pose2.projected(wheels),
                depth_message=middle.message,
                colour_message=colours.get(viewpoint.middle_ns),
                base_z=float(fixed_from_base[2, 3]),
                localised_sigma=recording.localised_sigma(middle.stamp_ns),
                recorded_noise=noise if depth is recorded else None,
                mended=changed(recorded, depth),
            )
        )

    pending: list[DepthFrame] = []
    current = -1
    decoded: set[int] = set()
    for frame in recording.depth_frames(np.array(sorted(owner), dtype=np.int64)):
        which = owner.get(frame.stamp_ns)
        if which is None or frame.stamp_ns in decoded:
            continue
        decoded.add(frame.stamp_ns)
        if which != current and pending:
            finish(current, pending)
            pending = []
        current = which
        pending.append(frame)
    if pending:
        finish(current, pending)
    aside += _left_out(recording, [s for s in owner if s not in decoded])
    return snapshots, aside, replace(seen_camera(alone), rounding=find_rounding(alone))


def _left_out(recording: Recording, stamps_ns: list[int]) -> list[SetAside]:
    """Say why images at stamps did not come: without a pose they are not decoded."""
    if not stamps_ns:
        return []
    names = recording.names
    _, placed = recording.base_from_cameras(np.array(stamps_ns, dtype=np.int64))
    unplaced = f"no pose of {names.camera!r} in {names.base!r} at its stamp"
    unread = "it could not be decoded, or fits no calibration"
    return [
        SetAside("depth image", stamp, unread if known else unplaced)
        for stamp, known in zip(stamps_ns, placed, strict=True)
    ]


def _spread(stamps: Ints, most: int) -> Ints:
    """Return at most ``most`` stamps, evenly spread, with the middle stamp among them."""
    if len(stamps) <= most:
        return stamps
    picked = np.unique(np.round(np.linspace(0, len(stamps) - 1, most)).astype(np.int64))
    picked[len(picked) // 2] = len(stamps) // 2
    return stamps[np.unique(picked)]


def _alike(frames: list[DepthFrame]) -> list[int]:
    """Return the indices of the largest group of frames with the same camera and mounting."""
    groups: list[list[int]] = []
    for i, frame in enumerate(frames):
        for group in groups:
            first = frames[group[0]]
            if (
                frame.depth.shape == first.depth.shape
                and np.allclose(frame.k, first.k)
                and same_mount(frame.base_from_camera, first.base_from_camera)
            ):
                group.append(i)
                break
        else:
            groups.append([i])
    return max(groups, key=len)


def _camera(frame: DepthFrame) -> Camera:
    height, width = frame.depth.shape
    k = frame.k
    return Camera(width, height, float(k[0, 0]), float(k[1, 1]), float(k[0, 2]), float(k[1, 2]))
