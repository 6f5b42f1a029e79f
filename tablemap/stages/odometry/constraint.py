"""Which directions of the plane a scan holds the base in."""

from __future__ import annotations

import numpy as np

from tablemap.geometry import Floats
from tablemap.stages.odometry.lines import fit_windows

_REACH = 0.1  # radians either side: far enough for a near wall's line to stand above the noise
_LEAST_POINTS = 5
_JUMP = 0.1  # metres, or so many times what lies between beams that hit squarely
_JUMP_SPACINGS = 4.0
_LEAST_COSINE = 0.15
_LEAST_FLATNESS = 0.25
_POINTS = 240  # enough for lines; more is time
# Simulated corridors lie at 0.01 to 0.02, rooms and halls with their tables at 0.28 to 0.48.
_OPEN, _HELD = 0.05, 0.15


def constrained(points: Floats, origin: Floats, *, voxel: float) -> Floats:
    """Return (2, 2) how (n, 2) points in beam order share out over the directions that they hold.

    A point on a line holds the base across the line, any other one in both directions alike; what
    grazes or stands alone holds nothing. Points count by the length (metres) that they stand for,
    no more than ``voxel``, as KISS-ICP thins them. The trace is 1; the smaller eigenvalue is 0 in
    an endless corridor and about a third in a room. Where nothing holds it is 0 in both.
    """
    points = points[:: max(1, len(points) // _POINTS)]
    n = len(points)
    if n < _LEAST_POINTS:
        return np.zeros((2, 2))
    offset = points - origin
    distance = np.linalg.norm(offset, axis=1)
    bearing = np.arctan2(offset[:, 1], offset[:, 0])
    increment = float(np.median(np.abs(np.diff(bearing))))
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    jump = step > np.maximum(_JUMP, _JUMP_SPACINGS * increment * distance[1:])
    segment = np.concatenate([[0], np.cumsum(jump)])
    first = np.searchsorted(segment, segment, side="left")
    last = np.searchsorted(segment, segment, side="right")
    reach = max(round(_REACH / max(increment, 1e-6)), _LEAST_POINTS // 2)
    place = np.arange(n)
    first, last = np.maximum(first, place - reach), np.minimum(last, place + reach + 1)
    normals, along, across = fit_windows(points, first, last)
    line = across < _LEAST_FLATNESS * along
    cosine = np.abs(np.einsum("ij,ij->i", normals, offset)) / np.maximum(distance, 1e-9)
    holds = (last - first >= _LEAST_POINTS) & (~line | (cosine > _LEAST_COSINE))
    # Behind a jump a point stands for what lies between two beams, not for the jump.
    spans = np.where(jump, increment * distance[1:], step)
    length = np.minimum(np.concatenate([spans[:1], spans]), voxel) * holds
    total = float(length.sum())
    if total <= 0:
        return np.zeros((2, 2))
    alike = float(length[~line].sum()) / 2
    directed = (normals[line].T * length[line]) @ normals[line]
    return np.asarray((directed + alike * np.eye(2)) / total, dtype=np.float64)


def held_share(constraint: Floats) -> Floats:
    """Return (2, 2), as a gain: 1 in the directions that hold, 0 in those left open.

    Point to point, the many points of a corridor's walls outvote the few that see along it, and
    what they say there is how they happen to lie: nearest neighbours, not motion. So directions
    that few points hold are left to the prior (Zhang, Kaess and Singh, On Degeneracy of
    Optimization-based State Estimation Problems, ICRA 2016), in a transition instead of at a step.
    """
    values, vectors = np.linalg.eigh(constraint)
    gain = np.clip((values - _OPEN) / (_HELD - _OPEN), 0.0, 1.0)
    return np.asarray((vectors * gain) @ vectors.T, dtype=np.float64)
