"""The intervals in which the base stood still, and the images that show something new."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tablemap.config import SensorsConfig, SnapshotsConfig
from tablemap.geometry import Bools, Floats, Ints, Pose2, planar, wrap_angles
from tablemap.recording import Recording

SECOND_NS = 1_000_000_000
SAME_PLACE_M, SAME_HEADING = 0.02, np.deg2rad(1.0)
_Source = Literal["wheels", "localisation", "none"]

_SLOW = 3.0  # times the speed below which the base stands still
_LONGEST_JUMP = 0.5  # metres: after a longer jump the localisation is lost, not corrected


@dataclass(frozen=True, eq=False)
class BaseMotion:
    """Planar poses over time: ``stamps_ns`` (n,), ``poses`` (n, 3) with yaw unwrapped."""

    stamps_ns: Ints
    poses: Floats
    source: _Source


def sample_motion(recording: Recording, depth_stamps: Ints) -> BaseMotion:
    """Sample the base's motion from the wheels if recorded, else from the localisation.

    The localisation may jump while the base stands; the wheels do not.
    """
    start, end = int(depth_stamps[0]), int(depth_stamps[-1])
    margin = 2 * SECOND_NS
    start = max(min(start, recording.start_ns), start - margin)
    end = min(max(end, recording.end_ns), end + margin)
    step = max(SECOND_NS // 10, (end - start) // 6000)
    grid = np.arange(start, end + 1, step, dtype=np.int64)
    stamps = np.union1d(grid, depth_stamps[:: max(1, len(depth_stamps) // 6000)])
    lookups: tuple[tuple[_Source, Callable[[Ints], tuple[Floats, Bools]]], ...] = (
        ("wheels", recording.odom_from_bases),
        ("localisation", recording.fixed_from_bases),
    )
    for source, lookup in lookups:
        matrices, known = lookup(stamps)
        if known.sum() >= 2 or (known.any() and source == "localisation"):
            poses = planar(matrices[known])
            poses[:, 2] = np.unwrap(poses[:, 2])
            return BaseMotion(stamps[known], poses, source)
    return BaseMotion(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), "none")


def standing_intervals(
    motion: BaseMotion, config: SnapshotsConfig, sensors: SensorsConfig
) -> list[tuple[int, int]]:
    """Return the intervals (start, end in nanoseconds) in which the base stood still."""
    if len(motion.stamps_ns) < 2:
        return []
    seconds = np.diff(motion.stamps_ns) / 1e9
    steps = np.diff(motion.poses, axis=0)
    speed = np.linalg.norm(steps[:, :2], axis=1) / np.maximum(seconds, 1e-6)
    turn = np.abs(steps[:, 2]) / np.maximum(seconds, 1e-6)
    still = (speed < config.still_speed) & (turn < np.deg2rad(config.still_turn_deg))
    if motion.source == "localisation":
        # A jump is faster than any indoor robot, and short: the base itself did not move.
        fastest = np.deg2rad(sensors.localisation_jump_turn_deg_snapshots)
        jump = (speed > sensors.localisation_jump_speed) | (turn > fastest)
        jump &= np.linalg.norm(steps[:, :2], axis=1) < _LONGEST_JUMP
        lone = jump.copy()
        lone[1:-1] &= still[:-2] & still[2:]
        lone[[0, -1]] = False
        still |= lone
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    intervals = [
        (int(motion.stamps_ns[a]), int(motion.stamps_ns[b]))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]
    least = int(config.stop_seconds * SECOND_NS)
    return [(a, b) for a, b in _merge_creeping(intervals, motion) if b - a >= least]


def slow_views(motion: BaseMotion, stamps: Ints, standing: Ints, config: SnapshotsConfig) -> Ints:
    """Return the stamps of images (n,) taken in slow motion that show what no stop shows.

    ``standing`` (m,) are stamps at the stops. An odometry that drifts while the base stands makes a
    stop look like slow motion.
    """
    others = np.setdiff1d(stamps, standing)
    if len(motion.stamps_ns) < 2 or not len(others):
        return np.zeros(0, dtype=np.int64)
    seconds = np.maximum(np.diff(motion.stamps_ns) / 1e9, 1e-6)
    steps = np.diff(motion.poses, axis=0)
    before = np.searchsorted(motion.stamps_ns, others, side="right") - 1
    before = np.clip(before, 0, len(seconds) - 1)
    speed = np.linalg.norm(steps[before, :2], axis=1) / seconds[before]
    turn = np.abs(steps[before, 2]) / seconds[before]
    slow = speed < _SLOW * config.still_speed
    slow &= turn < _SLOW * np.deg2rad(config.still_turn_deg)
    others = others[slow]
    known = [*_poses_at(motion, standing)]
    new = []
    for stamp, pose in zip(others, _poses_at(motion, others), strict=True):
        delta = pose - np.array(known)
        apart = np.hypot(delta[:, 0], delta[:, 1]) / config.keyframe_distance
        turned = np.abs(wrap_angles(delta[:, 2])) / np.deg2rad(config.keyframe_angle_deg)
        if np.hypot(apart, turned).min() >= 1.0:
            known.append(pose)
            new.append(stamp)
    return np.array(new, dtype=np.int64)


def _poses_at(motion: BaseMotion, stamps: Ints) -> Floats:
    columns = [np.interp(stamps, motion.stamps_ns, column) for column in motion.poses.T]
    return np.stack(columns, axis=1)


def _merge_creeping(intervals: list[tuple[int, int]], motion: BaseMotion) -> list[tuple[int, int]]:
    """Join intervals less than a second apart, at the same place: only a twitch separates them."""
    merged: list[tuple[int, int]] = []
    for start, end in intervals:
        if merged and start - merged[-1][1] <= SECOND_NS:
            i = np.searchsorted(motion.stamps_ns, [merged[-1][1], start])
            shift = np.abs(motion.poses[i[1]] - motion.poses[i[0]])
            if np.hypot(shift[0], shift[1]) < 0.01 and shift[2] < np.deg2rad(1.0):
                merged[-1] = (merged[-1][0], end)
                continue
        merged.append((start, end))
    return merged


def is_same_place(first: Pose2, second: Pose2) -> bool:
    """Tell whether the base stood at one place for both: then only its head may have turned."""
    return first.is_near(second, metres=SAME_PLACE_M, radians=SAME_HEADING)


def far_apart(stamps: Ints) -> bool:
    """Tell whether stamps are so far apart in time that each is its own viewpoint."""
    return len(stamps) < 2 or float(np.median(np.diff(stamps))) > SECOND_NS


def choose_by_new_view(
    views: Floats, maximum: int, config: SnapshotsConfig, *, nod: float = 0.0
) -> Ints:
    """Return the indices of views (n, 4) that show something new, at most ``maximum``.

    A view is the base's place and the camera's heading and elevation. It is kept if it differs from
    all kept views by a distance or an angle; both limits grow until few enough views are left.
    ``nod``: radians by which elevations differ without a new view.
    """
    if len(views) == 0:
        return np.zeros(0, dtype=np.int64)
    scale = 1.0
    while True:
        distance = config.keyframe_distance * scale
        angle = np.deg2rad(config.keyframe_angle_deg) * scale
        kept = [0]
        for i in range(1, len(views)):
            delta = views[i] - views[kept]
            turn = wrap_angles(delta[:, 2])
            apart = (np.hypot(delta[:, 0], delta[:, 1]) / distance) ** 2
            nodded = np.maximum(np.abs(delta[:, 3]) - nod, 0.0)
            apart += (turn / angle) ** 2 + (nodded / angle) ** 2
            if apart.min() >= 1.0:
                kept.append(i)
        if len(kept) <= maximum:
            return np.array(kept, dtype=np.int64)
        scale *= 1.15
