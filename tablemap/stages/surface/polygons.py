"""Polygons from straight lines: lines found in a histogram cut the plane into cells."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.ops import polygonize, unary_union

from tablemap.config import SurfaceConfig
from tablemap.geometry import Floats, Ints, wrap_angle, wrap_angles
from tablemap.robust import geman_mcclure
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.shapes.shape import area
from tablemap.stages.surface.shapes.straight import Polygon, Rectilinear, Sided

_MOST_LINES = 16
_ANGLES = 180
_BAND = 0.02  # metres: points within this distance of a line belong to it
_BIN = 0.01  # metres, of a line's offset in the histogram
_STEP = 0.02  # metres along a line: its seen length is counted in these steps
_SNAP = np.radians(5.0)


def polygons(
    points: Floats, normals: Floats, evidence: Evidence, config: SurfaceConfig
) -> list[Sided]:
    """Propose polygons with right angles and with free angles, from many sides to few.

    ``points`` and ``normals`` (N, 2) are the edge points, placed by the best fit so far.
    """
    lines, lengths = peel(points, normals, config.line_minimum)
    if len(lines) < 3:
        return []
    proposals: list[Sided] = []
    snapped, direction, kept = _snap(lines, lengths)
    for least in (config.line_minimum, 1.6 * config.line_minimum, 3 * config.line_minimum):
        if direction is not None:
            chosen = snapped[kept & (lengths >= least)]
            chosen = _closed(chosen, direction, points, evidence)
            shape = _arrange(chosen, evidence)
            if shape is not None:
                rectilinear = _as_rectilinear(shape, direction)
                if rectilinear is not None:
                    proposals.append(rectilinear)
        shape = _arrange(lines[lengths >= least], evidence)
        if shape is not None:
            proposals.append(shape)
    return _distinct(proposals)


def peel(points: Floats, normals: Floats, least: float) -> tuple[Floats, Floats]:
    """Find straight lines in the (angle, offset) histogram, the longest first.

    The points of a line found are removed before the next search. Returns angle of the outward
    normal and offset (L, 2), and the seen length (L,) of each line, metres.
    """
    turn = np.arctan2(normals[:, 1], normals[:, 0])
    # One vote per place and direction, however many views saw it.
    key = np.column_stack([np.floor(points / _BIN), np.floor(turn / (np.pi / 8))])
    _, first = np.unique(key, axis=0, return_index=True)
    points, turn = points[np.sort(first)], turn[np.sort(first)]
    angles = np.arange(_ANGLES) * (2 * np.pi / _ANGLES)
    outward = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    lines: list[tuple[float, float]] = []
    lengths: list[float] = []
    for _ in range(_MOST_LINES):
        if len(points) < 6:
            break
        offset = points @ outward.T
        apart = np.abs(wrap_angles(turn[:, None] - angles))
        votes = apart < np.radians(25)
        base = float(offset.min())
        bins = np.floor((offset - base) / _BIN).astype(np.int64)
        width = int(bins.max()) + 1
        flat = (bins + width * np.arange(_ANGLES))[votes]
        counts = np.bincount(flat, minlength=width * _ANGLES).reshape(_ANGLES, width)
        counts = counts + np.roll(counts, 1, axis=1)
        peak, place = np.unravel_index(int(np.argmax(counts)), counts.shape)
        angle, at = _refine(float(angles[peak]), base + float(place) * _BIN, points, turn)
        close = _near_line(angle, at, points, turn, 1.0)
        length = _seen_length(angle, points[close])
        if length < least:
            break
        lines.append((angle, at))
        lengths.append(length)
        gone = _near_line(angle, at, points, turn, 1.5)
        points, turn = points[~gone], turn[~gone]
    return np.array(lines).reshape(-1, 2), np.array(lengths)


def _near_line(angle: float, at: float, points: Floats, turn: Floats, bands: float) -> np.ndarray:
    offset = points @ np.array([np.cos(angle), np.sin(angle)]) - at
    apart = np.abs(wrap_angles(turn - angle))
    near: np.ndarray = (np.abs(offset) < bands * _BAND) & (apart < np.radians(35))
    return near


def _refine(angle: float, at: float, points: Floats, turn: Floats) -> tuple[float, float]:
    for _ in range(4):
        close = _near_line(angle, at, points, turn, 1.0)
        if close.sum() < 4:
            break
        outward = np.array([np.cos(angle), np.sin(angle)])
        along = points[close] @ np.array([-outward[1], outward[0]])
        offset = points[close] @ outward - at
        weight = geman_mcclure((offset / 0.005) ** 2)
        middle = float(np.average(along, weights=weight))
        mean = float(np.average(offset, weights=weight))
        spread = float(np.average((along - middle) ** 2, weights=weight))
        slope = float(np.average((along - middle) * (offset - mean), weights=weight))
        slope = float(np.clip(slope / max(spread, 1e-6), -0.1, 0.1))
        on_line = outward * (at + mean) + np.array([-outward[1], outward[0]]) * middle
        angle -= float(np.arctan(slope))
        at = float(on_line @ np.array([np.cos(angle), np.sin(angle)]))
    return wrap_angle(angle), at


def _seen_length(angle: float, points: Floats) -> float:
    along = points @ np.array([-np.sin(angle), np.cos(angle)])
    return _STEP * len(np.unique(np.floor(along / _STEP)))


def _snap(lines: Floats, lengths: Floats) -> tuple[Floats, float | None, np.ndarray]:
    """Turn lines onto two perpendicular directions if most of their length lies near these."""
    angle = lines[:, 0]
    off = wrap_angles(angle[:, None] - angle[None], np.pi / 2)
    votes = (np.abs(off) < _SNAP) @ lengths
    best = int(np.argmax(votes))
    if votes[best] < 0.8 * lengths.sum():
        return lines, None, np.ones(len(lines), dtype=bool)
    kept = np.abs(off[:, best]) < _SNAP
    direction = float(angle[best] + np.average(off[kept, best], weights=lengths[kept]))
    quarter = np.round((angle - direction) / (np.pi / 2))
    return np.column_stack([direction + quarter * np.pi / 2, lines[:, 1]]), direction, kept


def _closed(lines: Floats, direction: float, points: Floats, evidence: Evidence) -> Floats:
    """Add lines at ends of the seen top that have no edge."""
    seen = np.concatenate([points, evidence.top])
    added = []
    for quarter in range(4):
        angle = direction + quarter * np.pi / 2
        outward = np.array([np.cos(angle), np.sin(angle)])
        end = float(np.percentile(seen @ outward, 99.8))
        same = np.abs(wrap_angles(lines[:, 0] - angle)) < 0.1
        if not (same & (lines[:, 1] > end - 0.06)).any():
            added.append((angle, end + evidence.cell / 2))
    return np.concatenate([lines, np.array(added).reshape(-1, 2)])


def _arrange(lines: Floats, evidence: Evidence) -> Polygon | None:
    """Cut the plane by the lines, keep the cells that top votes cover, and unite them."""
    if len(lines) < 3 or not len(evidence.top):
        return None
    seen = np.concatenate([evidence.top, evidence.points])
    reach = 1.0 + float(np.abs(seen).max())
    outward = np.stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])], axis=1)
    middle = outward * lines[:, 1:]
    along = np.stack([-outward[:, 1], outward[:, 0]], axis=1) * (2 * reach)
    drawn = [shapely.LineString([m - a, m + a]) for m, a in zip(middle, along, strict=True)]
    cells = list(
        polygonize(unary_union([*drawn, shapely.box(-reach, -reach, reach, reach).exterior]))
    )
    code = 2 ** np.arange(len(lines), dtype=np.int64)
    inside = np.array([np.asarray(c.representative_point().coords[0]) for c in cells])
    keys = (inside @ outward.T > lines[:, 1]) @ code
    top = _count(keys, (evidence.top @ outward.T > lines[:, 1]) @ code)
    free = _count(keys, (evidence.free @ outward.T > lines[:, 1]) @ code)
    areas = np.array([c.area for c in cells])
    covered = top * evidence.cell**2 / np.maximum(areas, 1e-9)
    kept = (top > free) & (covered > 0.25)
    if not kept.any():
        return None
    whole = unary_union([c for c, k in zip(cells, kept, strict=True) if k])
    parts = list(whole.geoms) if isinstance(whole, shapely.MultiPolygon) else [whole]
    ring = np.asarray(max(parts, key=lambda part: part.area).exterior.coords)[:-1]
    return _on_lines(ring if area(ring) > 0 else ring[::-1])


def _count(keys: Ints, votes: Ints) -> Ints:
    order = np.sort(votes)
    counted: Ints = np.searchsorted(order, keys, side="right") - np.searchsorted(order, keys)
    return counted


def _on_lines(ring: Floats) -> Polygon | None:
    """Make a polygon of a counter-clockwise ring; merge straight runs and drop slivers."""
    for _ in range(len(ring)):
        along = np.roll(ring, -1, axis=0) - ring
        before = ring - np.roll(ring, 1, axis=0)
        bend = before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0]
        bend /= np.maximum(np.linalg.norm(before, axis=1) * np.linalg.norm(along, axis=1), 1e-12)
        straight = np.abs(bend) < 0.03
        if not straight.any() or len(ring) <= 3:
            break
        ring = np.delete(ring, int(np.argmin(np.abs(bend))), axis=0)
    along = np.roll(ring, -1, axis=0) - ring
    angle = np.arctan2(-along[:, 0], along[:, 1])
    angle = np.unwrap(angle)
    offset = ring[:, 0] * np.cos(angle) + ring[:, 1] * np.sin(angle)
    shape = Polygon(np.concatenate([angle, offset]))
    return shape if len(ring) >= 3 and shape.is_plausible() else None


def _as_rectilinear(shape: Polygon, direction: float) -> Rectilinear | None:
    angle, offset, _, _ = shape.lines
    quarter = np.round((angle - direction) / (np.pi / 2)).astype(np.int64)
    if np.abs(angle - direction - quarter * np.pi / 2).max() > 0.05 or len(angle) < 5:
        return None
    order: dict[tuple[int, float], int] = {}
    line = np.array(
        [
            order.setdefault((int(q) % 4, round(float(o), 4)), len(order))
            for q, o in zip(quarter, offset, strict=True)
        ],
        dtype=np.int64,
    )
    offsets = np.array([key[1] for key in order])
    rectilinear = Rectilinear(np.concatenate([[direction], offsets]), quarter % 4, line)
    return rectilinear if rectilinear.is_plausible() else None


def _distinct(proposals: list[Sided]) -> list[Sided]:
    kept: list[Sided] = []
    for shape in proposals:
        same = [
            other
            for other in kept
            if type(other) is type(shape)
            and other.parameters.shape == shape.parameters.shape
            and np.abs(other.corners - shape.corners).max() < 0.02
        ]
        if not same:
            kept.append(shape)
    return kept
