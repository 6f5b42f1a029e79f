"""A level that reaches a little beyond the top, all round: the table under a cushion or a board."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry import Polygon

from tablemap.errors import ProcessWarning, WarnedPlace
from tablemap.geometry import Floats, Pose2, transform
from tablemap.stages.snapshots import Snapshot

_BESIDE = 0.015, 0.05  # metres beyond the outline
_LOWER = 0.025, 0.10  # metres below the top
_STATION = 0.04  # metres along the outline
_LEAST_PIXELS = 6
_LEVEL = 0.012  # metres, standard deviation: upright faces and cloths spread their points farther
_ALIKE = 0.01  # metres between the levels of stations
_ROUND = 0.6  # of the stations
_STRIDE = 2  # pixels


def find_ledge(
    snapshots: tuple[Snapshot, ...], poses: dict[int, Pose2], outline: Polygon, height: float
) -> ProcessWarning | None:
    """Warn of a level surface just outside of the outline, a little lower and nearly all round.

    Beyond the edge of a table there are its side face, which is upright, and the floor.
    """
    band = outline.buffer(_BESIDE[1]).difference(outline.buffer(_BESIDE[0]))
    shapely.prepare(band)
    parts = [np.zeros((0, 3))]
    for index, map_from_base in poses.items():
        points = _points(snapshots[index], map_from_base, height)
        parts.append(points[shapely.contains_xy(band, points[:, 0], points[:, 1])])
    points = np.concatenate(parts)
    if len(points) < _LEAST_PIXELS:
        return None
    ring = outline.exterior
    count = max(int(ring.length / _STATION), 1)
    at = shapely.line_locate_point(ring, shapely.points(points[:, :2])) / ring.length
    station = (at * count).astype(np.int64) % count
    order = np.argsort(station, kind="stable")
    pieces = np.split(points[order, 2], np.searchsorted(station[order], np.arange(1, count)))
    # Some points lie on the side face of the level: its height is that of the upper ones.
    levels = [
        float(np.percentile(heights, 75))
        for heights in pieces
        if len(heights) >= _LEAST_PIXELS and np.std(heights) < _LEVEL
    ]
    if not levels:
        return None
    level = float(np.median(levels))
    if (np.abs(np.array(levels) - level) < _ALIKE).sum() < _ROUND * count:
        return None
    message = (
        f"Round the top, a level {1000 * (height - level):.0f} mm lower reaches beyond it; if a "
        "cushion or a board lies on the table, that level is its top; clear the table and record "
        "it again"
    )
    ledge = shapely.get_coordinates(outline.buffer(_BESIDE[1], join_style="mitre").exterior)
    place = WarnedPlace.along(ledge, height=level)
    return ProcessWarning("accuracy.two_levels", "legs", message, places=(place,))


def _points(snapshot: Snapshot, map_from_base: Pose2, height: float) -> Floats:
    """Return the points (n, 3) in the map, a little lower than the top, that a view saw."""
    rays = snapshot.camera.rays[::_STRIDE, ::_STRIDE]
    seen = rays * snapshot.depth[::_STRIDE, ::_STRIDE, None]
    points = transform(snapshot.base_from_camera, seen).reshape(-1, 3)
    with np.errstate(invalid="ignore"):
        below = height - points[:, 2]
        return map_from_base.apply(points[(below > _LOWER[0]) & (below < _LOWER[1])])
