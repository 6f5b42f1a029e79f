"""The scans for the legs, in the map: one combined scan a stop, and a selection from the drives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.config import LegsConfig
from tablemap.geometry import Bools, Floats, Ints, Pose2
from tablemap.recording import Recording
from tablemap.recording.messages import LaserScan
from tablemap.stages.odometry import Trajectory, combine_beams
from tablemap.stages.registration import Registration
from tablemap.stages.snapshots import Snapshot

_MOVING_STEP = 0.04  # metres that the base moves between two kept scans of a drive
_FARTHEST = 4.0  # metres between base and table's middle: farther away a leg is one beam wide
_LOST = 2  # beams in a row that a surface may lose
_ONE_DEPTH = 0.05  # largest difference, metres, of the ranges beside such a gap


@dataclass(frozen=True, eq=False)
class Scans:
    """V scans of B beams in the map, angles ascending, short ones padded as unknown.

    - ``origins``: (V, B, 2) metres
    - ``angles``: (V, B) radians
    - ``ranges``: (V, B) metres, inf where nothing came back, NaN where nothing is known
    - ``pivots``: (V, 2) metres, the base, about which a yaw error turns the scan
    - ``spacing``: (V,) radians between beams
    - ``standing``: (V,), whether the scan comes from a stop
    - ``groups``: (V,), scans of one group share a pose error: one group a stop, one a drive between
      stops
    - ``group_stops``: (G,), each group's snapshot index, -1 for a drive
    - ``noise``: (V,) metres, of a range
    - ``height``: metres, of the laser above the base
    """

    origins: Floats
    angles: Floats
    ranges: Floats
    pivots: Floats
    spacing: Floats
    standing: Bools
    groups: Ints
    group_stops: Ints
    noise: Floats
    height: float


def gather_scans(
    recording: Recording,
    snapshots: tuple[Snapshot, ...],
    registration: Registration,
    stop_poses: dict[int, Pose2],
    centre: Floats,
    *,
    config: LegsConfig,
    range_noise: float,
) -> Scans | None:
    """Stream the scans, combine those of a stop, and thin those of the drives; None without scans.

    Memory is bounded, whatever the recording's length: at most ``config.stop_scans`` a stop and
    ``config.moving_scans`` of all drives are kept. ``stop_poses`` are the poses of the used
    snapshots by index, ``centre`` (2,) is the table's in the map, ``range_noise`` (metres) is that
    of one beam.
    """
    if recording.names.laser is None:
        return None
    stops = sorted((snapshots[i].start_ns, snapshots[i].end_ns, i) for i in stop_poses)
    starts = np.array([start for start, _, _ in stops], dtype=np.int64)
    gathered: dict[int, _Stop] = {index: _Stop() for _, _, index in stops}
    drives = _Drives(config.moving_scans)
    trajectory = registration.trajectory
    span = (-1, -2)
    if len(trajectory.stamps_ns):
        span = (int(trajectory.stamps_ns[0]), int(trajectory.stamps_ns[-1]))
    path = _Path(trajectory)
    for scan in recording.scans():
        if len(scan.ranges) < 3:
            continue
        before = int(np.searchsorted(starts, scan.stamp_ns, side="right"))
        if before and scan.stamp_ns <= stops[before - 1][1]:
            gathered[stops[before - 1][2]].add(scan, config.stop_scans)
        elif span[0] <= scan.stamp_ns <= span[1]:
            rough = path.at(scan.stamp_ns)
            if np.hypot(*(rough[:2] - centre)) <= _FARTHEST and drives.moved(rough):
                drives.add(scan, trajectory.at(scan.stamp_ns), before)
    rows: list[_Row] = []
    group_stops: list[int] = []
    height = 0.0
    for index, stop in gathered.items():
        if stop.first is None:
            continue
        mount = recording.base_from_laser(stop.first.stamp_ns)
        height = float(mount[2, 3])
        ranges, noise = stop.combined(range_noise)
        pose = stop_poses[index]
        rows.append(_placed(stop.first, ranges, mount, pose, pose, True, len(group_stops), noise))
        group_stops.append(index)
    for drive in sorted({before for _, _, before in drives.kept}):
        for scan, pose, before in drives.kept:
            if before == drive:
                mount = recording.base_from_laser(scan.stamp_ns)
                height = float(mount[2, 3])
                seconds = scan.time_increment * (len(scan.ranges) - 1)
                end = trajectory.at(scan.stamp_ns + round(max(seconds, 0.0) * 1e9))
                ranges = _cleaned(scan)
                group, noise = len(group_stops), range_noise
                rows.append(_placed(scan, ranges, mount, pose, end, False, group, noise))
        group_stops.append(-1)
    return _stacked(rows, group_stops, height) if rows else None


@dataclass(frozen=True, eq=False)
class _Row:
    origins: Floats
    angles: Floats
    ranges: Floats
    pivot: Floats
    standing: bool
    group: int
    noise: float


class _Stop:
    """The ranges of one stop's scans, thinned on arrival to a bounded number."""

    def __init__(self) -> None:
        self.first: LaserScan | None = None
        self.ranges: list[Floats] = []
        self.stride = 1
        self.seen = 0

    def add(self, scan: LaserScan, bound: int) -> None:
        if self.first is None:
            self.first = scan
        elif len(scan.ranges) != len(self.first.ranges):
            return
        if self.seen % self.stride == 0:
            self.ranges.append(_cleaned(scan))
            if len(self.ranges) > bound:
                self.ranges = self.ranges[::2]
                self.stride *= 2
        self.seen += 1

    def combined(self, noise: float) -> tuple[Floats, float]:
        """Return the beams' ranges, inf where most scans lost them, and the ranges' noise."""
        stack = np.stack(self.ranges)
        beams = combine_beams(stack)
        lost = np.isinf(stack).mean(axis=0) >= 0.5
        ranges = np.where(beams.seen, beams.mean, np.where(lost, np.inf, np.nan))
        return ranges, noise / float(np.sqrt(len(stack)))


class _Path:
    """A trajectory for quick looks: places and unwrapped yaws, interpolated linearly."""

    def __init__(self, trajectory: Trajectory) -> None:
        self.stamps = trajectory.stamps_ns
        self.values = trajectory.poses.copy()
        self.values[:, 2] = np.unwrap(self.values[:, 2])

    def at(self, stamp_ns: int) -> Floats:
        """Return (3,) x, y, yaw within the trajectory's span."""
        i = int(np.clip(np.searchsorted(self.stamps, stamp_ns), 1, max(len(self.stamps) - 1, 1)))
        if len(self.stamps) == 1:
            return np.asarray(self.values[0])
        span = max(int(self.stamps[i]) - int(self.stamps[i - 1]), 1)
        fraction = (stamp_ns - int(self.stamps[i - 1])) / span
        return np.asarray((1 - fraction) * self.values[i - 1] + fraction * self.values[i])


class _Drives:
    """Scans taken in motion, thinned on arrival to a bounded number."""

    def __init__(self, bound: int) -> None:
        self.kept: list[tuple[LaserScan, Pose2, int]] = []
        self.step = _MOVING_STEP
        self.bound = bound
        self.last: Floats | None = None

    def moved(self, pose: Floats) -> bool:
        """Tell whether ``pose`` (3,) is a step from the last kept pose; if so, keep it."""
        if self.bound == 0:
            return False
        if self.last is not None:
            moved = pose - self.last
            # A turn, too, shifts the beams against the legs: a radian counts as 25 cm.
            if np.hypot(moved[0], moved[1]) + 0.25 * abs(moved[2]) < self.step:
                return False
        self.last = pose
        return True

    def add(self, scan: LaserScan, pose: Pose2, drive: int) -> None:
        self.kept.append((scan, pose, drive))
        if len(self.kept) > self.bound:
            self.kept = self.kept[::2]
            self.step *= 2


def _cleaned(scan: LaserScan) -> Floats:
    """Return (n,) ranges: inf where nothing came back, NaN where nothing is known."""
    ranges = scan.ranges.astype(np.float64)
    far = scan.range_max if scan.range_max > scan.range_min else np.inf
    unknown = np.isnan(ranges) | (ranges <= max(scan.range_min, 0.0))
    lost = ~unknown & (ranges >= far)
    # A driver without an infinity marks lost beams as NaN or zero.
    unknown_value = np.nan if lost.any() else np.inf
    return _bridged(np.where(lost, np.inf, np.where(unknown, unknown_value, ranges)))


def _bridged(ranges: Floats) -> Floats:
    """Fill gaps of one or two lost beams between beams of one depth: these hit one surface."""
    hit = np.flatnonzero(np.isfinite(ranges))
    before, after = hit[:-1], hit[1:]
    gap = after - before
    same = np.abs(ranges[after] - ranges[before]) < _ONE_DEPTH
    filled = ranges.copy()
    for missing in (1, 2):
        at = before[same & (gap > missing) & (gap <= _LOST + 1)] + missing
        filled[at] = 0.5 * (
            ranges[at - missing] + ranges[after[np.searchsorted(before, at - missing)]]
        )
    return filled


def _placed(
    scan: LaserScan,
    ranges: Floats,
    mount: Floats,
    start: Pose2,
    end: Pose2,
    standing: bool,
    group: int,
    noise: float,
) -> _Row:
    """Place every beam in the map by the base's pose at the time of that beam."""
    beams = scan.angles
    directions = np.stack([np.cos(beams), np.sin(beams)], axis=1) @ mount[:2, :2].T
    angles = np.unwrap(np.arctan2(directions[:, 1], directions[:, 0]))
    step = start.inverse() @ end
    fraction = np.linspace(0.0, 1.0, len(beams))
    yaw = start.yaw + fraction * step.yaw
    base = start.translation + fraction[:, None] * (end.translation - start.translation)
    mx, my = mount[0, 3], mount[1, 3]
    lever = np.stack(
        [np.cos(yaw) * mx - np.sin(yaw) * my, np.sin(yaw) * mx + np.cos(yaw) * my], axis=1
    )
    origins, angles = base + lever, angles + yaw
    if angles[-1] < angles[0]:  # mounted upside down, or turning clockwise
        origins, angles, ranges = origins[::-1], angles[::-1], ranges[::-1]
    return _Row(origins, angles, ranges, base[0], standing, group, noise)


def _stacked(rows: list[_Row], group_stops: list[int], height: float) -> Scans:
    beams = max(len(row.ranges) for row in rows)
    origins = np.zeros((len(rows), beams, 2))
    angles = np.zeros((len(rows), beams))
    ranges = np.full((len(rows), beams), np.nan)
    for i, row in enumerate(rows):
        n = len(row.ranges)
        origins[i, :n], origins[i, n:] = row.origins, row.origins[-1]
        angles[i, :n], angles[i, n:] = row.angles, row.angles[-1]
        ranges[i, :n] = row.ranges
    return Scans(
        origins=origins,
        angles=angles,
        ranges=ranges,
        pivots=np.stack([row.pivot for row in rows]),
        spacing=np.array(
            [(row.angles[-1] - row.angles[0]) / (len(row.angles) - 1) for row in rows]
        ),
        standing=np.array([row.standing for row in rows]),
        groups=np.array([row.group for row in rows], dtype=np.int64),
        group_stops=np.array(group_stops, dtype=np.int64),
        noise=np.array([row.noise for row in rows]),
        height=height,
    )
