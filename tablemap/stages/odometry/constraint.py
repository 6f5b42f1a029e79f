"""The directions of the plane in which a scan constrains the base, and how much of them it saw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.geometry import Floats
from tablemap.stages.odometry.lines import fit_windows

_REACH = 0.1  # radians to either side: a near wall's line is then long against the noise
_LEAST_POINTS = 5
_JUMP = 0.1  # metres, or `_JUMP_SPACINGS` beam spacings on a surface that faces the beams
_JUMP_SPACINGS = 4.0
_LEAST_COSINE = 0.15
_LEAST_FLATNESS = 0.25
_POINTS = 240  # enough for lines; more is time
# Simulated corridors lie at 0.01 to 0.02, rooms and halls with their tables at 0.28 to 0.48.
_OPEN, _HELD = 0.05, 0.15


@dataclass(frozen=True, eq=False)
class Constraint:
    """What a scan says of the base's place.

    - ``shares``: (2, 2), the directions that it constrains; the trace is 1, or 0 without any
    - ``length``: metres of surface behind them
    """

    shares: Floats
    length: float


def constrained(points: Floats, origin: Floats, *, voxel: float) -> Constraint:
    """Return the directions that (n, 2) points in beam order constrain.

    A point on a line constrains the base across the line; any other point constrains both
    directions equally. Grazing and lone points constrain nothing. A point counts by the length
    (metres) of surface that it covers, at most ``voxel``, as KISS-ICP thins the points. The smaller
    eigenvalue of the shares is 0 in an endless corridor and about a third in a room.
    """
    points = points[:: max(1, len(points) // _POINTS)]
    n = len(points)
    if n < _LEAST_POINTS:
        return Constraint(np.zeros((2, 2)), 0.0)
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
    # After a jump a point covers the spacing of two beams, not the jump.
    spans = np.where(jump, increment * distance[1:], step)
    length = np.minimum(np.concatenate([spans[:1], spans]), voxel) * holds
    total = float(length.sum())
    if total <= 0:
        return Constraint(np.zeros((2, 2)), 0.0)
    alike = float(length[~line].sum()) / 2
    directed = (normals[line].T * length[line]) @ normals[line]
    return Constraint((directed + alike * np.eye(2)) / total, total)


def held_share(constraint: Floats) -> Floats:
    """Return the gain (2, 2): 1 in constrained directions, 0 in open ones.

    In point-to-point ICP the many points on a corridor's walls outvote the few that constrain the
    motion along it. Along the corridor, nearest neighbours on the walls say nothing about motion.
    So directions that few points constrain are left to the prior (Zhang, Kaess and Singh, On
    Degeneracy of Optimization-based State Estimation Problems, ICRA 2016). The gain changes
    smoothly instead of in a step.
    """
    values, vectors = np.linalg.eigh(constraint)
    gain = np.clip((values - _OPEN) / (_HELD - _OPEN), 0.0, 1.0)
    return np.asarray((vectors * gain) @ vectors.T, dtype=np.float64)
