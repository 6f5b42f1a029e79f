"""Normals of a planar scan's points."""

from __future__ import annotations

import numpy as np

from tablemap.geometry import Bools, Floats, Ints, wrap_angles
from tablemap.stages.odometry import fit_windows

_NORMAL_REACH = 0.06
_NORMAL_BEAMS = 20
LEAST_COSINE = 0.15
"""Of the incidence: a more grazing surface has no valid normal."""
_LEAST_FLATNESS = 0.25
_JUMP = 0.05
_LEAST_POINTS = 5
_LONGER = 5.0  # length of the longer piece, in reaches of the short one
_LEAST_LONGER = 0.8  # of that length: a piece that is shorter from end to end does not go on
_STRAIGHT = 2.0  # times the variance across the short piece: a longer piece with more is bent


def planar_normals(points: Floats, origin: Floats) -> tuple[Floats, Bools, float]:
    """Return the normals of (n, 2) points in beam order, a mask of valid normals, and the noise.

    The normals (n, 2) are unit vectors towards ``origin``. The noise is metres RMS of the points
    off their own lines, 0.0 if no normal is valid.

    A line is fitted to the neighbours within 6 cm, or within four beams where the beams lie further
    apart. It does not cross jumps; NaN points count as jumps. A normal is valid if at least five
    neighbours lie on the line and the incidence is not too grazing. Where the line goes on, as a
    wall does, a longer piece of it gives the normal. Normals of short pieces vary with the noise:
    a bare wall would then seem to bind the pose along itself.
    """
    n = len(points)
    gap = np.full(n, True)
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    # At a distance, and along a grazing wall, the beams themselves lie far apart.
    spacing = _beam_spacing(points, origin)
    gap[1:] = ~(step < np.fmax(_JUMP, 4 * spacing[1:]))
    segment = np.cumsum(gap)
    offsets = np.arange(-_NORMAL_BEAMS, _NORMAL_BEAMS + 1)
    index = np.arange(n)[:, None] + offsets
    inside = (index >= 0) & (index < n)
    index = np.clip(index, 0, n - 1)
    difference = points[index] - points[:, None]
    near = inside & (segment[index] == segment[:, None])
    reach = np.fmax(_NORMAL_REACH, 4 * spacing)
    near &= np.einsum("ijk,ijk->ij", difference, difference) < np.square(reach)[:, None]
    weight = near.astype(np.float64)
    difference = np.where(near[..., None], difference, 0.0)
    count = weight.sum(axis=1)
    mean = difference.sum(axis=1) / np.maximum(count, 1)[:, None]
    centred = (difference - mean[:, None]) * weight[..., None]
    xx = np.einsum("ij,ij->i", centred[..., 0], centred[..., 0])
    yy = np.einsum("ij,ij->i", centred[..., 1], centred[..., 1])
    xy = np.einsum("ij,ij->i", centred[..., 0], centred[..., 1])
    tangent = 0.5 * np.arctan2(2 * xy, xx - yy)
    normals = np.stack([-np.sin(tangent), np.cos(tangent)], axis=1)
    to_origin = np.where(np.isfinite(points), origin - points, 0.0)
    cosine = np.einsum("ij,ij->i", normals, to_origin)
    normals *= np.where(cosine < 0, -1.0, 1.0)[:, None]
    incidence = np.abs(cosine) / np.maximum(np.linalg.norm(to_origin, axis=1), 1e-9)
    # The neighbours must span a line, not a blob: chair legs have no useful normal.
    trace, root = xx + yy, np.hypot(xx - yy, 2 * xy)
    flat = (trace - root) < _LEAST_FLATNESS * (trace + root)
    holds = (
        np.isfinite(points).all(axis=1)
        & (count >= _LEAST_POINTS)
        & (incidence > LEAST_COSINE)
        & flat
    )
    off = (trace - root)[holds] / 2 / np.maximum(count[holds] - 2, 1)
    noise = float(np.sqrt(np.median(off))) if len(off) else 0.0
    variance = np.fmax(off, noise**2)
    normals[holds] = _lengthened(
        normals[holds], points[holds], segment[holds], _LONGER * reach[holds], variance
    )
    return normals, holds, noise


def _lengthened(
    normals: Floats, points: Floats, segment: Ints, reach: Floats, variance: Floats
) -> Floats:
    """Return the normals (n, 2) of pieces that extend ``reach`` metres to either side.

    Where such a piece bends, the given normal of the short piece stays. ``variance`` (n,), square
    metres, is the variance across the short pieces.
    """
    if not len(points):
        return normals
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    first = np.searchsorted(way, way - reach)
    last = np.searchsorted(way, way + reach, side="right")
    first = np.maximum(first, np.searchsorted(segment, segment))
    last = np.minimum(last, np.searchsorted(segment, segment, side="right"))
    longer, along, across = fit_windows(points, first, last)
    # The piece must go on: two faces of a leg are no wall.
    goes_on = np.sqrt(12 * along) > _LEAST_LONGER * reach
    straight = goes_on & (last - first >= _LEAST_POINTS) & (across < _STRAIGHT * variance)
    longer *= np.where(np.einsum("ij,ij->i", longer, normals) < 0, -1.0, 1.0)[:, None]
    return np.where(straight[:, None], longer, normals)


def _beam_spacing(points: Floats, origin: Floats) -> Floats:
    """Return (n,) metres between neighbouring beams on a surface that faces them at each point."""
    offset = points - origin
    bearing = np.arctan2(offset[:, 1], offset[:, 0])
    turn = np.abs(wrap_angles(np.diff(bearing)))
    turn = turn[np.isfinite(turn)]
    increment = float(np.median(turn)) if len(turn) else 0.0
    return np.asarray(np.linalg.norm(offset, axis=1) * increment, dtype=np.float64)
