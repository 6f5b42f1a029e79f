"""The scans for the legs, in the map: one combined scan a stop, and a selection from the drives."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tablemap.config import LegsConfig
from tablemap.geometry import Bools, Floats, Ints, Pose2
from tablemap.recording import Recording
from tablemap.recording.messages import LaserScan
from tablemap.stages.odometry import Trajectory, combine_beams, thinned
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
    - ``bridged``: (V, B), whether a range was filled in, as its own beam was lost
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
    bridged: Bools
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
    """Combine the scans of each stop, and take some of the drives; None without scans.

    Only the scans that are used are decoded. Memory is bounded, whatever the recording's length: at
    most ``config.stop_scans`` a stop and ``config.moving_scans`` of all drives are used.
    ``stop_poses`` are the poses of the used snapshots by index, ``centre`` (2,) is the table's in
    the map, ``range_noise`` (metres) is that of one beam.
    """
    if recording.names.laser is None:
        return None
    stops = sorted((snapshots[i].start_ns, snapshots[i].end_ns, i) for i in stop_poses)
    gathered: dict[int, _Stop] = {index: _Stop() for _, _, index in stops}
    trajectory = registration.trajectory
    stamps_ns = recording.scan_stamps()
    before = np.searchsorted([start for start, _, _ in stops], stamps_ns, side="right")
    ends = np.array([0, *(end for _, end, _ in stops)], dtype=np.int64)
    standing = (before > 0) & (stamps_ns <= ends[before])
    owner: dict[int, int] = {}
    for number, (_, _, index) in enumerate(stops, start=1):
        its = stamps_ns[standing & (before == number)]
        owner |= dict.fromkeys(thinned(its, config.stop_scans).tolist(), index)
    moving = _of_drives(stamps_ns[~standing], trajectory, centre, config.moving_scans)
    drive_of = dict(zip(stamps_ns.tolist(), before.tolist(), strict=True))
    drives: list[tuple[LaserScan, Pose2, int]] = []
    due = np.union1d(np.array([*owner], dtype=np.int64), moving)
    for scan in recording.scans(stamps_ns=due):
        if len(scan.ranges) < 3:
            continue
        if scan.stamp_ns in owner:
            gathered[owner[scan.stamp_ns]].add(scan)
        else:
            drives.append((scan, trajectory.at(scan.stamp_ns), drive_of[scan.stamp_ns]))
    rows: list[_Row] = []
    group_stops: list[int] = []
    height = 0.0
    for index, stop in gathered.items():
        if stop.first is None:
            continue
        mount = recording.base_from_laser(stop.first.stamp_ns)
        height = float(mount[2, 3])
        beams, noise = stop.combined(range_noise)
        pose = stop_poses[index]
        rows.append(_placed(stop.first, beams, mount, pose, pose, True, len(group_stops), noise))
        group_stops.append(index)
    for drive in sorted({number for _, _, number in drives}):
        for scan, pose, number in drives:
            if number == drive:
                mount = recording.base_from_laser(scan.stamp_ns)
                height = float(mount[2, 3])
                seconds = scan.sweep_seconds
                end = trajectory.at(scan.stamp_ns + round(max(seconds, 0.0) * 1e9))
                beams = _cleaned(scan)
                group, noise = len(group_stops), range_noise
                rows.append(_placed(scan, beams, mount, pose, end, False, group, noise))
        group_stops.append(-1)
    return _stacked(rows, group_stops, height) if rows else None


@dataclass(frozen=True, eq=False)
class _Beams:
    """A scan's ranges (n,), and which of them (n,) were filled in."""

    ranges: Floats
    bridged: Bools


@dataclass(frozen=True, eq=False)
class _Row:
    origins: Floats
    angles: Floats
    ranges: Floats
    bridged: Bools
    pivot: Floats
    standing: bool
    group: int
    noise: float


class _Stop:
    """The ranges of one stop's scans."""

    def __init__(self) -> None:
        self.first: LaserScan | None = None
        self.scans: list[_Beams] = []

    def add(self, scan: LaserScan) -> None:
        if self.first is None:
            self.first = scan
        if len(scan.ranges) == len(self.first.ranges):
            self.scans.append(_cleaned(scan))

    def combined(self, noise: float) -> tuple[_Beams, float]:
        """Return the beams' ranges, inf where most scans lost them, and the ranges' noise."""
        stack = np.stack([scan.ranges for scan in self.scans])
        beams = combine_beams(stack)
        lost = np.isinf(stack).mean(axis=0) >= 0.5
        ranges = np.where(beams.seen, beams.mean, np.where(lost, np.inf, np.nan))
        bridged = np.mean([scan.bridged for scan in self.scans], axis=0) >= 0.5
        return _Beams(ranges, bridged), noise / float(np.sqrt(len(stack)))


def _of_drives(stamps_ns: Ints, trajectory: Trajectory, centre: Floats, most: int) -> Ints:
    """Return at most ``most`` stamps near the table, a step of the base apart, evenly spread."""
    known = trajectory.stamps_ns
    if most == 0 or not len(known):
        return stamps_ns[:0]
    stamps_ns = stamps_ns[(stamps_ns >= known[0]) & (stamps_ns <= known[-1])]
    poses = _roughly_at(trajectory, stamps_ns)
    near = np.hypot(poses[:, 0] - centre[0], poses[:, 1] - centre[1]) <= _FARTHEST
    kept: list[int] = []
    step, last = _MOVING_STEP, None
    for stamp, pose in zip(stamps_ns[near].tolist(), poses[near].tolist(), strict=True):
        if last is not None:
            x, y, yaw = pose[0] - last[0], pose[1] - last[1], pose[2] - last[2]
            # A turn, too, shifts the beams against the legs: a radian counts as 25 cm.
            if math.hypot(x, y) + 0.25 * abs(yaw) < step:
                continue
        last = pose
        kept.append(stamp)
        if len(kept) > most:
            kept, step = kept[::2], 2 * step
    return np.array(kept, dtype=np.int64)


def _roughly_at(trajectory: Trajectory, stamps_ns: Ints) -> Floats:
    """Return (n, 3) x, y and unwrapped yaw at stamps within the trajectory's span."""
    known = trajectory.stamps_ns
    poses = trajectory.poses.copy()
    poses[:, 2] = np.unwrap(poses[:, 2])
    if len(known) == 1:
        return np.repeat(poses, len(stamps_ns), axis=0)
    after = np.clip(np.searchsorted(known, stamps_ns), 1, len(known) - 1)
    span = np.maximum(known[after] - known[after - 1], 1)
    fraction = ((stamps_ns - known[after - 1]) / span)[:, None]
    return np.asarray((1 - fraction) * poses[after - 1] + fraction * poses[after])


def _cleaned(scan: LaserScan) -> _Beams:
    """Return the ranges: inf where nothing came back, NaN where nothing is known."""
    ranges = scan.ranges.astype(np.float64)
    far = scan.range_max if scan.range_max > scan.range_min else np.inf
    unknown = np.isnan(ranges) | (ranges <= max(scan.range_min, 0.0))
    lost = ~unknown & (ranges >= far)
    # A driver without an infinity marks lost beams as NaN or zero.
    unknown_value = np.nan if lost.any() else np.inf
    cleaned = np.where(lost, np.inf, np.where(unknown, unknown_value, ranges))
    # Minus infinity is what was too near (REP 117): behind it nothing is known.
    return _bridged(np.where(np.isneginf(ranges), np.nan, cleaned))


def _bridged(ranges: Floats) -> _Beams:
    """Fill gaps of one or two lost beams between beams of one depth: these hit one surface."""
    hit = np.flatnonzero(np.isfinite(ranges))
    before, after = hit[:-1], hit[1:]
    gap = after - before
    same = np.abs(ranges[after] - ranges[before]) < _ONE_DEPTH
    filled, bridged = ranges.copy(), np.zeros(len(ranges), dtype=bool)
    for missing in (1, 2):
        at = before[same & (gap > missing) & (gap <= _LOST + 1)] + missing
        bridged[at] = True
        filled[at] = 0.5 * (
            ranges[at - missing] + ranges[after[np.searchsorted(before, at - missing)]]
        )
    return _Beams(filled, bridged)


def _placed(
    scan: LaserScan,
    scanned: _Beams,
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
    ranges, bridged = scanned.ranges, scanned.bridged
    if angles[-1] < angles[0]:  # mounted upside down, or turning clockwise
        origins, angles = origins[::-1], angles[::-1]
        ranges, bridged = ranges[::-1], bridged[::-1]
    return _Row(origins, angles, ranges, bridged, base[0], standing, group, noise)


def _stacked(rows: list[_Row], group_stops: list[int], height: float) -> Scans:
    beams = max(len(row.ranges) for row in rows)
    origins = np.zeros((len(rows), beams, 2))
    angles = np.zeros((len(rows), beams))
    ranges = np.full((len(rows), beams), np.nan)
    bridged = np.zeros((len(rows), beams), dtype=bool)
    for i, row in enumerate(rows):
        n = len(row.ranges)
        origins[i, :n], origins[i, n:] = row.origins, row.origins[-1]
        angles[i, :n], angles[i, n:] = row.angles, row.angles[-1]
        ranges[i, :n], bridged[i, :n] = row.ranges, row.bridged
    return Scans(
        origins=origins,
        angles=angles,
        ranges=ranges,
        bridged=bridged,
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
