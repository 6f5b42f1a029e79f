"""A laser scan as points in the base, and all scans of a standing base combined into one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tablemap.geometry import Bools, Floats, Ints, Pose2, transform
from tablemap.recording.messages import LaserScan

# Ranges of a stop's beam farther from their median (metres) hit another thing: a person, an edge.
_SPREAD = 0.05
_SEEN_SHARE = 0.6  # of the scans: a beam that fewer scans measured is unknown


def points_in_base(
    scan: LaserScan,
    base_from_laser: Floats,
    *,
    maximum_range: float,
    motion: Pose2 | None = None,
) -> tuple[Floats, Bools]:
    """Lift a scan to 3D in the base at its stamp.

    ``motion`` is the base's motion during the sweep, from the first beam to the last; each beam is
    moved back by its share. Returns the points (n, 3) of all beams and a mask (n,) of beams that
    measured something.
    """
    ranges = np.asarray(scan.ranges, dtype=np.float64)
    nearest = max(scan.range_min, 0.02)
    # Some drivers set beams that saw nothing to the maximum range.
    farthest = min(maximum_range, scan.range_max - 1e-3 if scan.range_max > 0 else maximum_range)
    valid = np.isfinite(ranges) & (ranges >= nearest) & (ranges <= farthest)
    distance = np.where(valid, ranges, 0.0)
    beams = np.zeros((len(ranges), 3))
    beams[:, 0] = distance * np.cos(scan.angles)
    beams[:, 1] = distance * np.sin(scan.angles)
    points = transform(base_from_laser, beams)
    if motion is not None and len(ranges) > 1:
        share = np.linspace(0.0, 1.0, len(ranges))
        cos, sin = np.cos(share * motion.yaw), np.sin(share * motion.yaw)
        x = cos * points[:, 0] - sin * points[:, 1] + share * motion.x
        y = sin * points[:, 0] + cos * points[:, 1] + share * motion.y
        points[:, 0], points[:, 1] = x, y
    return points, valid


def sweep_motion(
    scan: LaserScan, base_at: Callable[[int], Pose2 | None]
) -> tuple[Pose2 | None, float]:
    """Return the base's motion during a scan (None: unknown or none), and the scan's duration.

    If the driver leaves ``time_increment`` at zero, the duration is zero. It is negative if the
    last beam of the message was measured first.
    """
    window = sweep_window(scan)
    if window is None:
        return None, 0.0
    duration = scan.sweep_seconds
    before, after = (base_at(scan.stamp_ns + offset) for offset in window)
    if before is None or after is None:
        return None, duration
    step = before.inverse() @ after
    share = duration / _span(duration)
    return Pose2(step.x * share, step.y * share, step.yaw * share), duration


def as_turning(scan: LaserScan, turn_seconds: float) -> LaserScan:
    """Return a scan as of a laser that turns once in a time, and takes one beam after the other."""
    beam = turn_seconds * abs(scan.angle_increment) / (2 * np.pi)
    return replace(scan, time_increment=beam)


def sweep_window(scan: LaserScan) -> tuple[int, int] | None:
    """Return the nanoseconds from a scan's stamp to where its motion is measured; None without."""
    duration = scan.sweep_seconds
    if not 0.0 < abs(duration) < 1.0:
        return None
    span = _span(duration)
    return round((duration - span) / 2 * 1e9), round((duration + span) / 2 * 1e9)


def _span(duration: float) -> float:
    # The recorded poses lie further apart in time than a sweep: a longer interval is more stable.
    return max(abs(duration), 0.1)


def thinned(stamps_ns: Ints, most: int) -> Ints:
    """Return at most ``most`` stamps: all, every second, every fourth, and so on."""
    every = 1
    while -(-len(stamps_ns) // every) > most:
        every *= 2
    return stamps_ns[::every]


@dataclass(frozen=True, eq=False)
class CombinedBeams:
    """The scans of a standing base, combined beam by beam.

    - ``mean``: (beams,) metres, mean of the ranges near the beam's median
    - ``seen``: (beams,), whether most scans measured something
    - ``agreed``: (beams,), whether at least half of these ranges lie near the median
    """

    mean: Floats
    seen: Bools
    agreed: Bools


def combine_beams(ranges: Floats) -> CombinedBeams:
    """Combine the ranges (scans, beams) of a standing base, metres; lost beams are not finite."""
    valid = np.isfinite(ranges)
    filled = np.where(valid, ranges, np.inf)
    order = np.sort(filled, axis=0)
    count = valid.sum(axis=0)
    middle = np.take_along_axis(order, np.maximum((count - 1) // 2, 0)[None], axis=0)[0]
    near = valid & (np.abs(filled - np.where(np.isfinite(middle), middle, 0.0)) < _SPREAD)
    kept = near.sum(axis=0)
    mean = np.where(near, ranges, 0.0).sum(axis=0) / np.maximum(kept, 1)
    agreed = (kept >= 0.5 * np.maximum(count, 1)) & (kept > 0)
    return CombinedBeams(mean, valid.mean(axis=0) >= _SEEN_SHARE, agreed)
