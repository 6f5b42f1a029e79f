"""Beams of a laser that meet the robot itself: a post, a cable, its own shell.

They come back at one short range wherever the robot is. Taken as things of the room, they walk
along with the robot, fit nothing that other stops saw, and hide what lies behind them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tablemap.geometry import Bools
from tablemap.recording.messages import LaserScan

_FEWEST_SCANS = 6
_REACH = 0.6  # metres from the laser to the farthest part of a robot
_SAME = 0.025  # metres: the noise of small lasers, and a shell that shakes
_LEAST_SHARE = 0.85  # of the scans in which a beam comes back at its own range
_BESIDE = 1  # beams at the border of a part meet it now and then
_LEAST_BEAMS = 2  # a lone beam is a bad pixel, and harms nothing


@dataclass(frozen=True, eq=False)
class Blocked:
    """Which beams (beams,) of a scan meet the robot itself, and at what ranges, metres."""

    beams: Bools
    nearest: float
    farthest: float

    def removed(self, scan: LaserScan) -> LaserScan:
        """Return the scan with minus infinity in these beams: too near, and behind it unknown."""
        if len(scan.ranges) != len(self.beams):
            return scan
        return replace(scan, ranges=np.where(self.beams, np.float32(-np.inf), scan.ranges))

    def __str__(self) -> str:
        return (
            f"{int(self.beams.sum())} of {len(self.beams)} beams, at "
            f"{self.nearest:.2f} to {self.farthest:.2f} m"
        )


def blocked(scans: Sequence[LaserScan]) -> Blocked | None:
    """Learn it from scans of different places; None if the robot is in no beam's way."""
    beams = max((len(scan.ranges) for scan in scans), default=0)
    alike = [scan.ranges for scan in scans if len(scan.ranges) == beams]
    if len(alike) < _FEWEST_SCANS or not beams:
        return None
    ranges = np.array(alike, dtype=np.float64)
    near = np.where(np.isfinite(ranges) & (ranges > 0.0) & (ranges < _REACH), ranges, np.inf)
    usual = np.median(near, axis=0)
    with np.errstate(invalid="ignore"):  # beams that usually see nothing near
        share = (np.abs(near - usual) < _SAME).mean(axis=0)
    own = np.isfinite(usual) & (share >= _LEAST_SHARE)
    if own.sum() < _LEAST_BEAMS:
        return None
    wide = np.convolve(own, np.ones(2 * _BESIDE + 1), mode="same") > 0
    return Blocked(wide, float(usual[own].min()), float(usual[own].max()))
