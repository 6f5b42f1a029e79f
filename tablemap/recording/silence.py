"""Sensors whose messages are empty or impossible."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from tablemap.recording.messages import LaserScan

_FEWEST_RETURNS = 5  # of one scan: fewer show neither a wall nor a leg
_LONGEST_SWEEP_S = 2.0  # lasers turn many times a second


def is_silent(scans: Iterable[LaserScan]) -> bool:
    """Tell whether none of the scans has returns within its own range."""
    for scan in scans:
        farthest = scan.range_max if scan.range_max > scan.range_min else np.inf
        seen = (scan.ranges > max(scan.range_min, 0.0)) & (scan.ranges < farthest)
        if np.count_nonzero(seen) >= _FEWEST_RETURNS:
            return False
    return True


def sweep_that_can_be(scan: LaserScan) -> LaserScan:
    """Return the scan; if its sweep takes impossibly long, all its beams get one time."""
    seconds = abs(scan.time_increment) * len(scan.ranges)
    if math.isfinite(seconds) and seconds <= _LONGEST_SWEEP_S:
        return scan
    return replace(scan, time_increment=0.0)
