"""Stretches along which the edge, as the views agree on it, does not follow the outline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.geometry import Bools, Floats, Ints, wrap_angles
from tablemap.robust import MAD_TO_SIGMA
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.joint import JointFit
from tablemap.stages.surface.shapes.rounded import Rounded
from tablemap.stages.surface.shapes.straight import Sided

_STEP = 0.02  # metres between windows along the outline
_WIDTH = 0.08  # metres; width of a window
_LEAST_WINDOWS = 4  # a shorter row is clutter at the edge, seen from neighbouring views
_LEAST_VIEWS = 2
_LEAST_POINTS = 3  # of a view in a window
_LEAST_OFFSET = 0.004  # metres; fits of the right shape leave less
_SIGMAS = 3.0
_FLOOR = 0.0007  # metres, of a window's offset
_REACH = 0.15  # metres; an edge farther away is another one
_LEAST_FACING = 0.3  # cosine between the normals of point and outline
_MEDIAN = 1.2533  # standard deviation of a median over that of a mean


@dataclass(frozen=True, eq=False)
class Departure:
    """A stretch of the outline that the edge does not follow.

    places: (n, 2), metres relative to the origin, along the outline
    offsets: (n,), metres from the outline to the edge there, positive outward
    length: metres along the outline
    side: the outline's side if it is all of one, else None
    """

    places: Floats
    offsets: Floats
    length: float
    side: int | None = None

    @property
    def farthest(self) -> float:
        """The largest offset, with its sign, metres."""
        return float(self.offsets[np.argmax(np.abs(self.offsets))])

    @property
    def place(self) -> Floats:
        """Where the offset is largest (2,)."""
        place: Floats = self.places[np.argmax(np.abs(self.offsets))]
        return place


def departures(fit: JointFit, evidence: Evidence) -> list[Departure]:
    """Return the stretches where the edge is off the outline, the longest first.

    Noise scatters about the outline, and so do the errors of single views. A wrong shape leaves the
    same offset in all views, over centimetres of the edge. In each window along the outline, the
    median of the views' medians is compared with their scatter. All edge points count, but those at
    holes: the robust loss discards those beside a corner that is rounder than the shape's.
    """
    outline = fit.shape.outline()
    offset, at, length = _offsets(fit.points, fit.normals, outline)
    offset[~evidence.is_whole] = np.nan
    count = max(int(length / _STEP), 3 * _LEAST_WINDOWS)
    windows: Floats = np.arange(count, dtype=np.float64) * (length / count)
    seen = np.full((count, len(evidence.view_slices)), np.nan)
    for column, part in enumerate(evidence.view_slices):
        seen[:, column] = _medians(offset[part], at[part], windows, length)
    views = np.isfinite(seen).sum(axis=1)
    able = views >= _LEAST_VIEWS
    middle, scatter = np.zeros(count), np.full(count, np.nan)
    middle[able] = np.nanmedian(seen[able], axis=1)
    deviation = np.abs(seen - middle[:, None])
    scatter[able] = MAD_TO_SIGMA * np.nanmedian(deviation[able], axis=1)
    many = views > _LEAST_VIEWS
    # Two views tell little of their own scatter: that of all windows counts, too.
    usual = MAD_TO_SIGMA * float(np.nanmedian(deviation[many])) if many.any() else np.inf
    sigma = _MEDIAN * np.fmax(scatter, usual) / np.sqrt(np.maximum(views, 1))
    off = able & (np.abs(middle) > np.maximum(_LEAST_OFFSET, _SIGMAS * np.hypot(sigma, _FLOOR)))
    places = _along(outline, windows)
    found = [
        Departure(places[row], middle[row], len(row) * length / count)
        for row in _rows(off, np.sign(middle))
        if len(row) >= _LEAST_WINDOWS
    ]
    return sorted(found, key=lambda departure: -departure.length)


def bowed_sides(fit: JointFit, evidence: Evidence) -> list[Departure]:
    """Return the sides of a polygon that stand for a curve: the edge bows out between their ends.

    Many sides follow a curve to a third of their bow, which is too little for `departures`. The bow
    of a side is read by all of its points: the offset from a chord is ``bow * (1/3 - u**2)``, with
    u from -1 to 1 along it. Only sides with a small turn at both ends are asked: an octagon's have
    no bow.
    """
    shape = fit.shape
    if not isinstance(shape, Sided):
        return []
    starts, ends = shape.ends()
    along = ends - starts
    length = np.linalg.norm(along, axis=1)
    heading = np.arctan2(along[:, 1], along[:, 0])
    turn = wrap_angles(heading - np.roll(heading, 1))
    next_turn = np.roll(turn, -1)
    alike = (np.minimum(turn, next_turn) > 0) & (np.maximum(turn, next_turn) < _SMALL_TURN)
    noise = fit.noise.sigma(evidence)
    found = []
    for index in np.flatnonzero(alike & (length > 4 * _CORNER)):
        start, unit = starts[index], along[index] / length[index]
        normal = np.array([unit[1], -unit[0]])
        offset = (fit.points - start) @ normal
        at = (fit.points - start) @ unit
        own = (np.abs(offset) < _REACH / 3) & (fit.normals @ normal > _FACING)
        own &= (at > _CORNER) & (at < length[index] - _CORNER)
        if own.sum() < 3 * _LEAST_POINTS:
            continue
        share = 2 * at[own] / length[index] - 1
        rows = np.column_stack([np.ones_like(share), share, 1 / 3 - share**2]) / noise[own, None]
        solved, *_ = np.linalg.lstsq(rows, offset[own] / noise[own], rcond=None)
        spread = np.linalg.inv(rows.T @ rows)[2, 2] * fit.noise.kappa
        bow = float(solved[2])
        if bow > max(_LEAST_OFFSET, _SIGMAS * np.sqrt(spread)):
            steps = np.linspace(-1.0, 1.0, 9)
            places = start + np.outer((steps + 1) / 2 * length[index], unit)
            offsets = bow * (1 / 3 - steps**2)
            side = int(index) * (2 if isinstance(shape, Rounded) else 1)
            found.append(Departure(places, offsets, float(length[index]), side))
    return found


_SMALL_TURN = np.deg2rad(55.0)
_CORNER = 0.025  # metres beside a corner, where its blur bows any side
_FACING = 0.8


def _offsets(points: Floats, normals: Floats, outline: Floats) -> tuple[Floats, Floats, float]:
    """Return each point's offset from the outline, where along it that is, and its length.

    The offset is counted along the point's own normal: the nearest place of the outline would be on
    a side, far from a corner that the edge cuts off. It is NaN if the normal meets no outline.
    """
    side = np.roll(outline, -1, axis=0) - outline
    length = np.maximum(np.linalg.norm(side, axis=1), 1e-12)
    start = np.concatenate([[0.0], np.cumsum(length)[:-1]])
    arm = outline[None] - points[:, None]
    slant = _cross(normals[:, None], side[None])
    slant = np.where(np.abs(slant) < 1e-12, 1e-12, slant)
    ahead = _cross(arm, side[None]) / slant
    share = _cross(arm, normals[:, None]) / slant
    outward = np.column_stack([side[:, 1], -side[:, 0]]) / length[:, None]
    meets = (share >= 0) & (share <= 1) & (np.abs(ahead) < _REACH)
    meets &= normals @ outward.T > _LEAST_FACING
    away = np.where(meets, np.abs(ahead), np.inf)
    nearest = away.argmin(axis=1)
    each = np.arange(len(points))
    offset = np.where(np.isfinite(away[each, nearest]), -ahead[each, nearest], np.nan)
    return offset, start[nearest] + share[each, nearest] * length[nearest], float(length.sum())


def _cross(first: Floats, second: Floats) -> Floats:
    product: Floats = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return product


def _medians(offset: Floats, at: Floats, windows: Floats, length: float) -> Floats:
    """Return one view's median offset in each window, NaN where it has too few points."""
    result = np.full(len(windows), np.nan)
    kept = np.flatnonzero(np.isfinite(offset))
    kept = kept[np.argsort(at[kept], kind="stable")]
    # The outline is a ring: it is repeated on both sides.
    ring = np.concatenate([at[kept] - length, at[kept], at[kept] + length])
    values = np.tile(offset[kept], 3)
    first = np.searchsorted(ring, windows - _WIDTH / 2)
    last = np.searchsorted(ring, windows + _WIDTH / 2)
    for window in np.flatnonzero(last - first >= _LEAST_POINTS):
        # As np.median, which takes five times as long for so few.
        part = np.sort(values[first[window] : last[window]])
        result[window] = (part[(len(part) - 1) // 2] + part[len(part) // 2]) / 2
    return result


def _along(outline: Floats, windows: Floats) -> Floats:
    """Return the places (n, 2) at these lengths along the outline."""
    ring = np.concatenate([outline, outline[:1]])
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
    return np.column_stack([np.interp(windows, at, ring[:, axis]) for axis in (0, 1)])


def _rows(off: Bools, sign: Floats) -> list[Ints]:
    """Return the rows of neighbouring windows on the ring that are off to the same side."""
    kind = np.where(off, sign, 0.0)
    change = np.flatnonzero(kind != np.roll(kind, 1))
    if not len(change):
        return [np.arange(len(off))] if off.all() and len(off) else []
    order = np.roll(np.arange(len(off)), -int(change[0]))
    pieces = np.split(order, np.flatnonzero(np.diff(kind[order])) + 1)
    return [piece for piece in pieces if kind[piece[0]] != 0]
