"""Each stop's scans as one clean scan with normals."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from tablemap.geometry import Bools, Floats, Pose2
from tablemap.recording import Recording
from tablemap.recording.messages import LaserScan
from tablemap.stages.odometry import (
    Trajectory,
    as_turning,
    combine_beams,
    points_in_base,
    sweep_motion,
    thinned,
)
from tablemap.stages.registration.laser.normals import planar_normals
from tablemap.stages.registration.result import StopScan
from tablemap.stages.snapshots import Snapshot

_STILL = 0.005  # metres, and radians
_NEAREST_SCAN_NS = 300_000_000


def stop_scan(
    recording: Recording,
    snapshot: Snapshot,
    trajectory: Trajectory,
    *,
    most_scans: int,
    maximum_range: float,
    turn_seconds: float = 0.0,
    turn_share: float = 0.0,
) -> StopScan | None:
    """Combine the scans of a snapshot's standing interval, beam by beam, into one in the base.

    If the base did not stand still, the scan nearest in time is de-skewed, and the odometry moves
    it to the snapshot's stamp. At most ``most_scans`` are combined, and ranges beyond
    ``maximum_range`` (metres) are left out. If a scan does not say how long it took, it is taken as
    of ``turn_share`` of a turn of ``turn_seconds``. Returns None if there is no scan.
    """
    scans = _standing_scans(recording, snapshot, trajectory, most_scans)
    if len(scans) >= 2:
        ranges = _combined(np.stack([_cleaned(s, maximum_range) for s in scans]))
        return _as_stop(
            recording, snapshot, scans[0], ranges, Pose2(), _STANDS, len(scans), maximum_range
        )
    window = _NEAREST_SCAN_NS
    near = list(recording.scans(snapshot.stamp_ns - window, snapshot.stamp_ns + window)) or scans
    if not near:
        return None
    nearest = min(near, key=lambda s: (abs(s.stamp_ns - snapshot.stamp_ns), s.stamp_ns))
    motion = _Motion(sweep_motion(nearest, trajectory.at)[0])
    if not nearest.time_increment and turn_seconds:
        turn, _ = sweep_motion(as_turning(nearest, turn_seconds), trajectory.at)
        motion = _Motion(None if turn is None else _part(turn, turn_share), turn)
    moved = trajectory.at(snapshot.stamp_ns).inverse() @ trajectory.at(nearest.stamp_ns)
    ranges = _cleaned(nearest, maximum_range)
    return _as_stop(recording, snapshot, nearest, ranges, moved, motion, 1, maximum_range)


@dataclass(frozen=True)
class _Motion:
    """The base's motion while a scan was taken, and that of a whole turn if this is not known."""

    during: Pose2 | None
    turn: Pose2 | None = None


_STANDS = _Motion(None)


def _part(motion: Pose2, share: float) -> Pose2:
    return Pose2(share * motion.x, share * motion.y, share * motion.yaw)


def _combined(ranges: Floats) -> Floats:
    """Return one range (beams,) in metres for (scans, beams), NaN where the scans disagree."""
    beams = combine_beams(ranges)
    return np.where(beams.seen & beams.agreed, beams.mean, np.nan)


def _standing_scans(
    recording: Recording, snapshot: Snapshot, trajectory: Trajectory, most_scans: int
) -> list[LaserScan]:
    at_stamp = trajectory.at(snapshot.stamp_ns)
    stamps = recording.scan_stamps()
    during = stamps[(stamps >= snapshot.start_ns) & (stamps <= snapshot.end_ns)]
    standing: list[LaserScan] = []
    for scan in recording.scans(stamps_ns=thinned(during, most_scans)):
        moved = at_stamp.inverse() @ trajectory.at(scan.stamp_ns)
        if np.hypot(moved.x, moved.y) <= _STILL and abs(moved.yaw) <= _STILL:
            standing.append(scan)
    layouts = Counter(_layout(scan) for scan in standing)
    if not layouts:
        return []
    usual = layouts.most_common(1)[0][0]
    return [scan for scan in standing if _layout(scan) == usual]


def _layout(scan: LaserScan) -> tuple[int, float, float]:
    return len(scan.ranges), round(scan.angle_min, 5), round(scan.angle_increment, 7)


def _cleaned(scan: LaserScan, maximum_range: float) -> Floats:
    _, valid = points_in_base(scan, np.eye(4), maximum_range=maximum_range)
    return np.where(valid, np.asarray(scan.ranges, dtype=np.float64), np.nan)


def _as_stop(
    recording: Recording,
    snapshot: Snapshot,
    scan: LaserScan,
    ranges: Floats,
    moved: Pose2,
    motion: _Motion,
    scans: int,
    maximum_range: float,
) -> StopScan:
    base_from_laser = recording.base_from_laser(scan.stamp_ns)
    combined = LaserScan(**{**vars(scan), "ranges": ranges.astype(np.float32)})

    def lift(motion: Pose2 | None) -> tuple[Floats, Bools]:
        return points_in_base(combined, base_from_laser, maximum_range=maximum_range, motion=motion)

    lifted, valid = lift(motion.during)
    points = moved.apply(np.where(valid[:, None], lifted[:, :2], np.nan))
    origin = moved.apply(base_from_laser[:2, 3])
    beams = np.stack([np.cos(scan.angles), np.sin(scan.angles), np.zeros(len(ranges))], axis=1)
    direction = moved.rotate((beams @ base_from_laser[:3, :3].T)[:, :2])
    direction /= np.maximum(np.linalg.norm(direction, axis=1), 1e-9)[:, None]
    normals, holds, noise = planar_normals(points, origin)
    offset = points - origin
    bearing = np.where(
        valid, np.arctan2(offset[:, 1], offset[:, 0]), np.arctan2(direction[:, 1], direction[:, 0])
    )
    order = np.argsort(bearing, kind="stable")
    sweep = None
    if motion.turn is not None:
        sweep = moved.rotate((lift(motion.turn)[0] - lift(None)[0])[holds, :2])
    return StopScan(
        index=snapshot.index,
        points=points[holds],
        normals=normals[holds],
        scans=scans,
        directions=direction[holds],
        origin=origin,
        bearings=bearing[order],
        ranges=np.linalg.norm(offset, axis=1)[order],
        noise=noise,
        sweep=sweep,
    )
