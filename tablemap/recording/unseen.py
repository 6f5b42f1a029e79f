"""The range that a laser sends where it sees nothing, learnt from its own scans.

ROS asks for infinity there (REP 117). Some drivers send a number at or just under ``range_max``
instead, and merged scans have such a number for each beam. Taken as a wall, it walks along with
the robot. No wall does that: a range that comes back, to the tenth of a millimetre, in scans from
many places is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tablemap.geometry import Floats, Ints
from tablemap.recording.messages import LaserScan

APART = 0.3
"""Metres, or radians, between the places at which scans are compared."""
MOST_SCANS = 60

_FEWEST_SCANS = 6
_BIN = 1e-4  # metres
_SAME = 1e-3  # metres: floats differ by rounding
_LEAST_SHARE = 0.005  # of all ranges, or a beam's share below
_LEAST_BEAM_SHARE = 0.25
_LEAST_BEAMS = 0.01  # share of the beams that have a number of their own
_FAR, _BEAM_FAR = 0.98, 0.5  # of the longest range: a nearer number is a thing


@dataclass(frozen=True, eq=False)
class Unseen:
    """Ranges (beams,) in metres that stand for nothing seen, NaN for beams without one."""

    ranges: Floats

    def removed(self, scan: LaserScan) -> LaserScan:
        """Return the scan with infinity where it saw nothing."""
        if len(scan.ranges) != len(self.ranges):
            return scan
        nothing = np.abs(scan.ranges - self.ranges) < _SAME
        if not nothing.any():
            return scan
        return replace(scan, ranges=np.where(nothing, np.float32(np.inf), scan.ranges))

    def __str__(self) -> str:
        known = self.ranges[np.isfinite(self.ranges)]
        low, high = float(known.min()), float(known.max())
        return f"{low:.2f} m" if high - low < _SAME else f"{low:.2f} to {high:.2f} m by beam"


def places_apart(poses: Floats) -> Ints:
    """Return indices of poses (n, 4, 4) that lie apart along the drive, at most `MOST_SCANS`."""
    if not len(poses):
        return np.zeros(0, dtype=np.int64)
    steps = np.linalg.norm(np.diff(poses[:, :2, 3], axis=0), axis=1)
    cosine = np.sum(poses[1:, :2, 0] * poses[:-1, :2, 0], axis=1)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(steps, np.arccos(np.clip(cosine, -1, 1))))])
    _, first = np.unique(way // APART, return_index=True)
    return np.asarray(first[:: -(-len(first) // MOST_SCANS)], dtype=np.int64)


def learnt(scans: Sequence[LaserScan]) -> Unseen | None:
    """Learn from scans of different places; None if the laser sends no number for nothing."""
    beams = max((len(scan.ranges) for scan in scans), default=0)
    alike = [scan for scan in scans if len(scan.ranges) == beams]
    if len(alike) < _FEWEST_SCANS or not beams:
        return None
    ranges = np.array([_measured(scan) for scan in alike])
    if not np.isfinite(ranges).any():
        return None
    farthest = float(np.nanmax(ranges))
    own = _by_beam(ranges, _BEAM_FAR * farthest)
    common = _in_all(ranges, _FAR * farthest)
    if common is None and np.isfinite(own).mean() < _LEAST_BEAMS:
        return None
    if common is not None:
        own = np.where(np.isfinite(own), own, common)
    return Unseen(own)


def _measured(scan: LaserScan) -> Floats:
    """Return (n,) ranges, NaN where the scan itself says that it measured nothing."""
    ranges = scan.ranges.astype(np.float64)
    far = scan.range_max if scan.range_max > scan.range_min else np.inf
    seen = np.isfinite(ranges) & (ranges > max(scan.range_min, 0.0)) & (ranges < far)
    return np.where(seen, ranges, np.nan)


def _in_all(ranges: Floats, nearest: float) -> float | None:
    """Return the range that many beams have in several scans (scans, beams), None without one."""
    far = ranges >= nearest
    if not far.any():
        return None
    bins = np.round(ranges[far] / _BIN).astype(np.int64)
    values, counts = np.unique(bins, return_counts=True)
    most = int(np.argmax(counts))
    value = float(values[most] * _BIN)
    scans_with = int(np.sum((np.abs(ranges - value) < _SAME).sum(axis=1) >= 2))
    if counts[most] < _LEAST_SHARE * np.isfinite(ranges).sum() or scans_with < 3:
        return None
    return value


def _by_beam(ranges: Floats, nearest: float) -> Floats:
    """Return each beam's own range (beams,) that comes back in many scans, NaN without one."""
    scans = len(ranges)
    far = np.where(ranges >= nearest, np.round(ranges / _BIN), np.nan)
    order = np.sort(far, axis=0)  # NaN last
    length = max(3, int(np.ceil(_LEAST_BEAM_SHARE * scans)))
    if length > scans:
        return np.full(ranges.shape[1], np.nan)
    run = order[length - 1 :] - order[: scans - length + 1] == 0
    found = run.any(axis=0)
    first = np.argmax(run, axis=0)
    value = order[first, np.arange(ranges.shape[1])] * _BIN
    return np.where(found, value, np.nan)
