"""Sensors whose messages are empty or impossible."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Bools, Floats, Ints, planar, wrap_angles
from tablemap.recording.messages import LaserScan

_FEWEST_RETURNS = 5  # of one scan: fewer show neither a wall nor a leg
_TELLING_RANGES = 40  # of one message: so many do not come again, to the last digit, elsewhere
_MOVED = 0.05, math.radians(2.0)  # metres, radians: the poses themselves err by less
_STILL = 0.005, 0.005  # metres, radians: an old scan is as good as a new one there
_LONGEST_SWEEP_S = 2.0  # lasers turn many times a second


def is_silent(scans: Iterable[LaserScan]) -> bool:
    """Tell whether none of the scans has returns within its own range."""
    return not any(len(_returns(scan)) >= _FEWEST_RETURNS for scan in scans)


def is_telling(scan: LaserScan) -> bool:
    """Tell whether a scan has so many different ranges that no other place gives the same ones."""
    return len(np.unique(_returns(scan))) >= _TELLING_RANGES


def shows_much(depth: NDArray[np.float32]) -> bool:
    """Tell whether a depth image has so many different depths that no other place gives them."""
    return len(np.unique(depth[np.isfinite(depth)])) >= _TELLING_RANGES


def _returns(scan: LaserScan) -> NDArray[np.float32]:
    farthest = scan.range_max if scan.range_max > scan.range_min else np.inf
    seen = (scan.ranges > max(scan.range_min, 0.0)) & (scan.ranges < farthest)
    return scan.ranges[seen]


def repeated_elsewhere(contents: Ints, poses: Floats, known: Bools) -> Ints:
    """Return for each message (n,) the first one that it repeats from another place, -1 for none.

    ``contents`` (n,) numbers what the messages say, ``poses`` (n, 4, 4) are the robot's, and
    ``known`` (n,) says which of them are known. Where the robot stands, a simulated laser without
    noise says the same again, and rightly. So messages count only where some of the same content
    were sent from places that lie apart, and of those only the ones that are far from the first.
    """
    repeats = np.full(len(contents), -1)
    _, place, counts = np.unique(contents, return_inverse=True, return_counts=True)
    several = np.flatnonzero((counts[place] > 1) & known)
    if not len(several):
        return repeats
    # Groups of one content, each in the order of time.
    several = several[np.argsort(place[several], kind="stable")]
    begins = np.flatnonzero(np.diff(place[several], prepend=-1))
    first = np.repeat(several[begins], np.diff(begins, append=len(several)))
    step = planar(poses[several]) - planar(poses[first])
    far, turn = np.hypot(step[:, 0], step[:, 1]), np.abs(wrap_angles(step[:, 2]))
    moved = np.maximum.reduceat((far > _MOVED[0]) | (turn > _MOVED[1]), begins)
    has_moved = np.repeat(moved, np.diff(begins, append=len(several)))
    left = has_moved & ((far > _STILL[0]) | (turn > _STILL[1]))
    repeats[several[left]] = first[left]
    return repeats


def sweep_that_can_be(scan: LaserScan) -> LaserScan:
    """Return the scan; if its sweep takes impossibly long, all its beams get one time."""
    seconds = abs(scan.time_increment) * len(scan.ranges)
    if math.isfinite(seconds) and seconds <= _LONGEST_SWEEP_S:
        return scan
    return replace(scan, time_increment=0.0)
