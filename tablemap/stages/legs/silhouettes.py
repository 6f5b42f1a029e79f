"""Segments of a scan near the table: their silhouettes, and which of them are walls."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
import shapely
from shapely.geometry import Polygon

from tablemap.geometry import Bools, Floats, Ints
from tablemap.stages.legs.scans import Scans

Walls = list[tuple[Floats, float]]
"""Lines in the map: a unit normal (2,), and the line's distance from the origin along it."""

_MARGIN = 0.35  # metres beyond the outline: this margin shows chairs and walls
_WALL_LENGTH = 0.35  # metres of a straight line in one scan: longer than any leg is wide
_WALL_BEYOND = 0.08  # metres: a line that goes on so far beyond the top is no panel of the table
WALL_DISTANCE = 0.03
"""Points nearer to a wall's line than this belong to the wall, metres."""

_STEP_NOISES = 4.0  # a real range step is larger than this many sigmas of a beam difference
_STEP_INCIDENCE = 2.5  # and larger than the step on a surface at 68 degrees incidence


@dataclass(frozen=True, eq=False)
class Segments:
    """S runs of neighbouring beams without a jump.

    - ``view``: (S,), the scan
    - ``first``, ``last``: (S,), the beams at its ends
    - ``centre``: (S, 2) metres in the map, the middle of a round thing with this silhouette
    - ``range``: (S,) metres, the mean
    - ``width``: (S,) metres, across the rays
    - ``low``, ``high``: (S,), whether this end is a silhouette: the neighbour lies farther or saw
      nothing
    - ``between``: (S,), whether it is a single beam in a jump between two surfaces, as a wide spot
      gives
    - ``inside``: (S,), share of the points under the top or a little beyond
    - ``wall``: (S,), whether it belongs to a line that goes on beyond the top
    """

    view: Ints
    first: Ints
    last: Ints
    centre: Floats
    range: Floats
    width: Floats
    low: Bools
    high: Bools
    between: Bools
    inside: Floats
    wall: Bools

    def __len__(self) -> int:
        return len(self.view)

    def only(self, keep: Bools) -> Segments:
        """Return the segments that ``keep`` (S,) selects."""
        return Segments(**{f.name: getattr(self, f.name)[keep] for f in fields(self)})


def beam_points(scans: Scans) -> Floats:
    """Return (V, B, 2) beam ends in the map, NaN where nothing came back."""
    ranges = np.where(np.isfinite(scans.ranges), scans.ranges, np.nan)
    directions = np.stack([np.cos(scans.angles), np.sin(scans.angles)], axis=-1)
    ends: Floats = scans.origins + ranges[..., None] * directions
    return ends


def find_segments(scans: Scans, points: Floats, outline: Polygon) -> tuple[Segments, Walls]:
    """Cut every scan where the range jumps, and keep the segments near the table.

    Returns the walls, too: the lines that go on beyond the table.
    """
    hit = np.isfinite(scans.ranges)
    found = _cut(scans, points, hit, outline)
    walls = _walls(found, points, outline)
    if walls:
        # A leg close before a wall may form one segment with it: take the wall's beams out.
        found = _cut(scans, points, hit & ~_near_lines(points, walls), outline)
    wall = _on_walls(found, points, walls)
    return replace(found, wall=wall).only(found.inside > 0.5), walls


def _cut(scans: Scans, points: Floats, hit: Bools, outline: Polygon) -> Segments:
    """Make segments of the beams in ``hit`` (V, B), cut where the range jumps."""
    beams = scans.ranges.shape[1]
    reach = np.where(np.isfinite(scans.ranges), scans.ranges, np.inf)
    nearer = np.minimum(reach[:, 1:], reach[:, :-1])
    near_both = hit[:, 1:] & hit[:, :-1]
    finite = np.where(hit, scans.ranges, 0.0)
    step = np.where(near_both, np.abs(finite[:, 1:] - finite[:, :-1]), np.inf)
    allowed = (
        0.01
        + _STEP_NOISES * np.maximum(np.sqrt(2.0) * scans.noise, 0.004)[:, None]
        + _STEP_INCIDENCE * np.where(near_both, nearer, 0.0) * scans.spacing[:, None]
    )
    starts = hit.copy()
    starts[:, 1:] &= step > allowed
    view, first = np.nonzero(starts)
    ends = hit.copy()
    ends[:, :-1] &= step > allowed
    last = np.nonzero(ends)[1]

    everything = np.nan_to_num(points, nan=1e9)
    inside = _within(everything, outline)
    counts = (last - first + 1).astype(np.float64)
    share = _sums(inside.astype(np.float64), view, first, last) / counts
    mean_range = _sums(np.where(hit, scans.ranges, 0.0), view, first, last) / counts
    angle_low, angle_high = scans.angles[view, first], scans.angles[view, last]
    spacing = scans.spacing[view]
    width = (angle_high - angle_low + spacing) * mean_range
    middle = 0.5 * (angle_low + angle_high)
    direction = np.stack([np.cos(middle), np.sin(middle)], axis=1)
    origin = scans.origins[view, (first + last) // 2]
    centre = origin + (mean_range + 0.39 * np.minimum(width, 0.2))[:, None] * direction

    unknown = np.isnan(scans.ranges)
    before, after = np.maximum(first - 1, 0), np.minimum(last + 1, beams - 1)
    range_first, range_last = reach[view, first], reach[view, last]
    low = (first > 0) & ~unknown[view, before] & (reach[view, before] > range_first)
    high = (last < beams - 1) & ~unknown[view, after] & (reach[view, after] > range_last)
    between = (
        (first == last)
        & (low ^ high)
        & (np.abs(np.minimum(reach[view, before], reach[view, after]) - range_first) < 0.6)
    )
    return Segments(
        view,
        first,
        last,
        centre,
        mean_range,
        width,
        low,
        high,
        between,
        share,
        np.zeros(len(view), dtype=bool),
    )


def _within(points: Floats, outline: Polygon) -> Bools:
    """Tell which (..., 2) points lie in the outline grown by `_MARGIN`."""
    grown = outline.buffer(_MARGIN)
    x0, y0, x1, y1 = grown.bounds
    inside: Bools = (
        (points[..., 0] > x0)
        & (points[..., 0] < x1)
        & (points[..., 1] > y0)
        & (points[..., 1] < y1)
    )
    if inside.any():
        inside[inside] = shapely.contains_xy(grown, points[inside][:, 0], points[inside][:, 1])
    return inside


def _sums(values: Floats, view: Ints, first: Ints, last: Ints) -> Floats:
    total = np.concatenate([np.zeros((len(values), 1)), np.cumsum(values, axis=1)], axis=1)
    sums: Floats = total[view, last + 1] - total[view, first]
    return sums


def _walls(found: Segments, points: Floats, outline: Polygon) -> Walls:
    """Return the straight lines that go on beyond the table by `_WALL_BEYOND`."""
    grown = outline.buffer(_MARGIN)
    beyond = outline.buffer(_WALL_BEYOND)
    start, end = points[found.view, found.first], points[found.view, found.last]
    length = np.linalg.norm(end - start, axis=1)
    long = np.flatnonzero((length > _WALL_LENGTH) & (found.last - found.first >= 5))
    lines: Walls = []
    for i in long[np.argsort(-length[long], kind="stable")]:
        run = points[found.view[i], found.first[i] : found.last[i] + 1]
        if not (shapely.intersects(grown, shapely.LineString(run[[0, -1]]))):
            continue
        for piece in _straight_pieces(run):
            centre = piece.mean(axis=0)
            _, _, axes = np.linalg.svd(piece - centre, full_matrices=False)
            along = (piece - centre) @ axes[0]
            if np.ptp(along) < _WALL_LENGTH:
                continue
            # A panel ends with the table; a wall goes on.
            outside = ~shapely.contains_xy(beyond, piece[:, 0], piece[:, 1])
            if outside.mean() * np.ptp(along) > 0.15:
                if any(
                    abs(normal @ axes[1]) > 0.99 and abs(normal @ centre - offset) < 0.03
                    for normal, offset in lines
                ):
                    continue
                lines.append((axes[1], float(axes[1] @ centre)))
    return lines


def _on_walls(found: Segments, points: Floats, walls: Walls) -> Bools:
    """Mark the segments that lie on one of the lines."""
    wall = np.zeros(len(found), dtype=bool)
    start, end = points[found.view, found.first], points[found.view, found.last]
    middle = points[found.view, (found.first + found.last) // 2]
    for normal, offset in walls:
        near = np.stack([np.abs(p @ normal - offset) for p in (start, middle, end)]).max(axis=0)
        wall |= near < WALL_DISTANCE
    return wall


def _near_lines(points: Floats, walls: Walls) -> Bools:
    """Tell which (V, B) beam ends lie on one of the lines."""
    near = np.zeros(points.shape[:2], dtype=bool)
    for normal, offset in walls:
        with np.errstate(invalid="ignore"):
            near |= np.abs(points @ normal - offset) < WALL_DISTANCE
    return near


def _straight_pieces(run: Floats) -> list[Floats]:
    """Split (n, 2) points of one segment at their corners (Douglas and Peucker, 2 cm)."""
    pieces: list[Floats] = []
    pending = [run]
    while pending:
        part = pending.pop()
        if len(part) < 6:
            continue
        chord = part[-1] - part[0]
        length = float(np.hypot(*chord))
        if length < 1e-6:
            continue
        normal = np.array([-chord[1], chord[0]]) / length
        off = np.abs((part - part[0]) @ normal)
        worst = int(np.argmax(off))
        if off[worst] > 0.02 and 0 < worst < len(part) - 1:
            pending += [part[worst:], part[: worst + 1]]
        else:
            pieces.append(part)
    return pieces
