"""Directions of the camera: a stop at which the head turns gives one view for each direction."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tablemap.config import SnapshotsConfig
from tablemap.errors import EstimationError
from tablemap.geometry import Bools, Floats, Ints, Pose2, wrap_angles
from tablemap.recording import Recording
from tablemap.stages.snapshots.result import SetAside, Viewpoint
from tablemap.stages.snapshots.stops import SECOND_NS, choose_by_new_view, far_apart
from tablemap.words import counted

SAME_MOUNT_M, SAME_MOUNT_ANGLE = 0.003, np.deg2rad(0.3)
# Encoder jitter and a sagging neck stay below this; a robot that looks elsewhere turns by more.
ELSEWHERE_M, ELSEWHERE_ANGLE = 0.03, np.deg2rad(3.0)
STEEP = np.sin(np.deg2rad(10.0))  # with an axis closer to the vertical the image's up gives heading
SAMPLE_NS, MOST_SAMPLES = SECOND_NS // 20, 6000
_BLOCK = 64


@dataclass(frozen=True, eq=False)
class _Look:
    """One direction and its images; ``mount`` (4, 4) is the camera's pose in the base."""

    mount: Floats
    stamps_ns: Ints


def by_direction(
    recording: Recording, stop: Viewpoint, config: SnapshotsConfig
) -> tuple[list[Viewpoint], list[SetAside]]:
    """Split a stop by the camera's direction; return its views and the images outside of them.

    A camera that only jitters or sags leaves the stop as one view. If the camera turned, each
    direction in which it rested is one view, even if it came back there. If it never rested, the
    images that show something new are the views. The views divide the time of the stop, so that
    each has its own scans.
    """
    if len(stop.stamps_ns) == 1:
        return [stop], []
    mounts, known = recording.base_from_cameras(stop.stamps_ns)
    if not known.any() or not _elsewhere(mounts[known], mounts[known][0]).any():
        return [stop], []
    where = f"no pose of {recording.names.camera!r} in {recording.names.base!r} at its stamp"
    aside = [SetAside("depth image", int(s), where) for s in stop.stamps_ns[~known]]
    stamps, mounts = stop.stamps_ns[known], mounts[known]
    looks = _runs(stamps, mounts) if far_apart(stamps) else _rests(recording, stop, stamps, config)
    if looks:
        still = np.concatenate([look.stamps_ns for look in looks])
        reason = "it was taken while the camera turned to another direction"
        looks, again = _once_each(looks)
        aside += again
    else:
        angles = np.column_stack([np.zeros((len(stamps), 2)), _angles(mounts)])
        kept = choose_by_new_view(angles, config.maximum, config)
        looks, still = [_Look(mounts[i], stamps[i : i + 1]) for i in kept], stamps[kept]
        reason = (
            "the camera kept turning, and it is not among the "
            f"{counted(config.maximum, 'image')} with the most views"
        )
    aside += [SetAside("depth image", int(s), reason) for s in np.setdiff1d(stamps, still)]
    return _shared_out(stop, [look.stamps_ns for look in looks]), aside


def views_at(recording: Recording, stamps_ns: Ints) -> Floats:
    """Return (n, 4): the base's x and y, metres, the camera's heading and elevation, radians.

    If the camera never turned in the base, the heading is that of the base.
    """
    views = np.zeros((len(stamps_ns), 4))
    views[:, :3] = [planar_pose(recording, int(s)).as_array() for s in stamps_ns]
    mounts, known = recording.base_from_cameras(stamps_ns)
    if not known.any():
        return views
    mounts = np.where(known[:, None, None], mounts, mounts[known][0])
    if _elsewhere(mounts, mounts[0]).any():
        views[:, 2:] += _angles(mounts)
    return views


def planar_pose(recording: Recording, stamp_ns: int) -> Pose2:
    """Return the base's localised pose. Raises `EstimationError` if it is unknown."""
    pose = recording.fixed_from_base(stamp_ns)
    if pose is None:
        raise EstimationError(f"No pose at {stamp_ns} ns: {recording.input}")
    return Pose2.projected(pose)


def turned_left(mounts: Floats) -> Floats:
    """Return the angles (n,), radians, of mountings (n, 4, 4) to the left of the base's x axis.

    All are 0 if all mountings look in one direction: jitter of an encoder or a hand is no turn of a
    head.
    """
    ahead = mounts[:, :2, 2].copy()
    steep = np.hypot(ahead[:, 0], ahead[:, 1]) < STEEP
    ahead[steep] = np.sign(mounts[steep, 2:3, 2]) * mounts[steep, :2, 1]
    yaw = np.arctan2(ahead[:, 1], ahead[:, 0])
    turns = wrap_angles(yaw - yaw[0])
    return np.where(np.ptp(turns) < ELSEWHERE_ANGLE, 0.0, yaw)


def same_mount(first: Floats, second: Floats) -> bool:
    """Tell whether two mountings (4, 4) are the same up to the jitter of encoders."""
    return bool(_alike(first[None], second)[0])


def _runs(stamps: Ints, mounts: Floats) -> list[_Look]:
    """Group images taken far apart in time, as from a camera that rests for each image."""
    looks: list[_Look] = []
    first = 0
    while first < len(stamps):
        elsewhere = np.flatnonzero(_elsewhere(mounts[first:], mounts[first]))
        end = first + int(elsewhere[0]) if len(elsewhere) else len(stamps)
        looks.append(_Look(mounts[first], stamps[first:end]))
        first = end
    return looks


def _rests(
    recording: Recording, stop: Viewpoint, stamps: Ints, config: SnapshotsConfig
) -> list[_Look]:
    """Find the camera's rests that last as long as a stop must; use TF, not the images' stamps."""
    step = max(SAMPLE_NS, (stop.end_ns - stop.start_ns) // MOST_SAMPLES)
    times = np.union1d(np.arange(stop.start_ns, stop.end_ns + 1, step, dtype=np.int64), stamps)
    mounts, known = recording.base_from_cameras(times)
    times, mounts = times[known], mounts[known]
    rests: list[_Look] = []
    first = 0
    while first < len(times):
        last = _held_until(mounts, first)
        if times[last] - times[first] >= config.stop_seconds * SECOND_NS:
            images = stamps[(stamps >= times[first]) & (stamps <= times[last])]
            if rests and not _elsewhere(mounts[first : first + 1], rests[-1].mount)[0]:
                # The camera sagged or twitched. The decoding later picks the images that agree.
                rests[-1] = _Look(rests[-1].mount, np.union1d(rests[-1].stamps_ns, images))
            else:
                rests.append(_Look(mounts[first], images))
            first = last
        first += 1
    return [rest for rest in rests if len(rest.stamps_ns)]


def _held_until(mounts: Floats, first: int) -> int:
    """Return the last index of the run of mountings (n, 4, 4) that are like the ``first`` one."""
    for start in range(first, len(mounts), _BLOCK):
        moved = np.flatnonzero(~_alike(mounts[start : start + _BLOCK], mounts[first]))
        if len(moved):
            return start + int(moved[0]) - 1
    return len(mounts) - 1


def _once_each(looks: list[_Look]) -> tuple[list[_Look], list[SetAside]]:
    """Of several looks in one direction keep the one with most images; return in time order."""
    kept: list[_Look] = []
    aside = []
    for look in sorted(looks, key=lambda one: -len(one.stamps_ns)):
        if all(_elsewhere(other.mount[None], look.mount)[0] for other in kept):
            kept.append(look)
        else:
            reason = "at this stop the camera looked in the same direction once more, no shorter"
            middle = int(look.stamps_ns[len(look.stamps_ns) // 2])
            aside.append(SetAside("viewpoint", middle, reason))
    return sorted(kept, key=lambda one: int(one.stamps_ns[0])), aside


def _shared_out(stop: Viewpoint, views: list[Ints]) -> list[Viewpoint]:
    """Divide a stop's time at the middles between its views' images."""
    parts = [(int(before[-1]) + int(after[0])) // 2 for before, after in pairwise(views)]
    starts = [stop.start_ns, *(part + 1 for part in parts)]
    return [
        Viewpoint(start, end, images)
        for start, end, images in zip(starts, [*parts, stop.end_ns], views, strict=True)
    ]


def _angles(mounts: Floats) -> Floats:
    """Return the angles (n, 2) of mountings to the left and upward, radians."""
    return np.column_stack([turned_left(mounts), np.arcsin(np.clip(mounts[:, 2, 2], -1.0, 1.0))])


def _alike(mounts: Floats, other: Floats) -> Bools:
    """Return which of (n, 4, 4) mountings equal another (4, 4) up to the jitter of encoders."""
    shift, angle = _apart(mounts, other)
    return np.asarray((shift < SAME_MOUNT_M) & (angle < SAME_MOUNT_ANGLE))


def _elsewhere(mounts: Floats, other: Floats) -> Bools:
    """Return which of (n, 4, 4) mountings look elsewhere than another (4, 4)."""
    shift, angle = _apart(mounts, other)
    return np.asarray((shift >= ELSEWHERE_M) | (angle >= ELSEWHERE_ANGLE))


def _apart(mounts: Floats, other: Floats) -> tuple[Floats, Floats]:
    """Return the distances of mountings (n, 4, 4) to another (4, 4): (n,) metres, (n,) radians."""
    shift = np.linalg.norm(mounts[:, :3, 3] - other[:3, 3], axis=1)
    cosine = (np.einsum("nij,ij->n", mounts[:, :3, :3], other[:3, :3]) - 1) / 2
    return shift, np.arccos(np.clip(cosine, -1.0, 1.0))
