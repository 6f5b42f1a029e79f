"""The motion of the wheels, in gaps where no scan could be placed."""

from __future__ import annotations

import numpy as np

from tablemap.geometry import Floats, Ints
from tablemap.stages.odometry.trajectory import Trajectory, composed, undone

_GAP_STEPS = 4.0  # usual distances between two scans: a longer way is a gap


def bridge(placed: Trajectory, wheels: Trajectory, *, moved: float) -> tuple[Trajectory, Ints]:
    """Fill the gaps between placed scans by the wheels; return the gaps' stamps (g, 2) too.

    A straight line between two scans is wrong if the base drove a curve between them. In a gap the
    trajectory follows the wheels. Their error at the end of the gap is distributed along the way.
    Before the first scan and after the last one the trajectory follows the wheels without a
    correction. ``wheels`` are in a frame of their own, and cover the stamps of ``placed``.
    ``moved`` (metres) is the usual way between two scans.
    """
    way = wheels.way()
    at = np.searchsorted(wheels.stamps_ns, placed.stamps_ns)
    limit = _GAP_STEPS * moved
    ends = np.concatenate([[0], at, [len(way) - 1]])
    pieces, gaps = [], []
    for k in np.flatnonzero(np.diff(way[ends]) > limit):
        inside = np.arange(ends[k] + (k > 0), ends[k + 1] + (k == len(at)))
        first = None if k == 0 else int(k - 1)
        last = None if k == len(at) else int(k)
        pieces.append((wheels.stamps_ns[inside], _carried(placed, wheels, at, inside, first, last)))
        gaps.append((wheels.stamps_ns[ends[k]], wheels.stamps_ns[ends[k + 1]]))
    if not pieces:
        return placed, np.zeros((0, 2), dtype=np.int64)
    stamps = np.concatenate([placed.stamps_ns, *(stamps for stamps, _ in pieces)])
    poses = np.concatenate([placed.poses, *(poses for _, poses in pieces)])
    stamps, first_of = np.unique(stamps, return_index=True)
    return Trajectory(stamps, poses[first_of]), np.array(gaps, dtype=np.int64)


def _carried(
    placed: Trajectory,
    wheels: Trajectory,
    at: Ints,
    inside: Ints,
    first: int | None,
    last: int | None,
) -> Floats:
    """Return the wheels' poses (n, 3) ``inside`` a gap between two placed scans (None: no scan)."""
    anchor = last if first is None else first
    assert anchor is not None
    seen_from = undone(wheels.poses[at[anchor]])
    carried = composed(placed.poses[anchor], composed(seen_from, wheels.poses[inside]))
    if first is None or last is None:
        return carried
    arrived = composed(seen_from, wheels.poses[at[last]][None])
    arrived = composed(placed.poses[first], arrived)[0]
    off = composed(undone(arrived), placed.poses[last][None])[0]
    way = wheels.way()
    share = (way[inside] - way[at[first]]) / max(way[at[last]] - way[at[first]], 1e-9)
    return composed(carried, share[:, None] * off)
