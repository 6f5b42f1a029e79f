"""A strip of the top whose depth is wrong: it looks like a level beside the top that is nowhere."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import Polygon

from tablemap.errors import ProcessWarning, WarnedPlace
from tablemap.geometry import Bools, Floats, Pose2
from tablemap.stages.snapshots import Snapshot

_BEYOND = 0.008, 0.03  # metres beyond the edge, where a ray meets the top's level
_LOWER = 0.02, 0.15  # metres below the top
_AWAY = 0.3  # cosine: the edge's side face is turned away from the ray
_STATION = 0.04  # metres along the edge
_LEAST_PIXELS = 2
_LEAST_SHARE = 0.6  # of the pixels at a station, and of the stations of a side
_APART = 0.04  # metres along a ray
_LEAST_VIEWS = 2
_FLATTEST = 0.05  # downward metres of a ray, for a metre of depth
_STRIDE = 2  # pixels
_MOST_POINTS = 400


def find_misread_side(
    snapshots: tuple[Snapshot, ...], poses: dict[int, Pose2], outline: Polygon, height: float
) -> ProcessWarning | None:
    """Warn of a side that the top may reach beyond, over a strip whose depth is wrong.

    A ray that passes just beyond an edge that is turned away meets the floor, or a thing that other
    views see there too. A pattern at the rim or a reflection makes depth too long by a share. Then
    the strip seems to be a level a little lower, elsewhere in each view, through which others see.
    """
    looks = [_look(snapshots[i], pose, outline, height) for i, pose in poses.items()]
    corners = np.asarray(shapely.orient_polygons(outline).exterior.coords)
    for start, end in pairwise(corners):
        length = float(np.linalg.norm(end - start))
        if length < _LEAST_SIDE:
            continue
        parts = [_lower(look, start, end) for look in looks]
        if sum(len(points) > 0 for points, _ in parts) < _LEAST_VIEWS:
            continue
        points = np.concatenate([points for points, _ in parts])
        share = float(np.mean(np.any([stations for _, stations in parts], axis=0)))
        if share < _LEAST_SHARE or not _is_nowhere(points, snapshots, poses):
            continue
        x, y = (start + end) / 2
        lower = 1e3 * (height - float(np.median(points[:, 2])))
        return ProcessWarning(
            "accuracy.hidden_rim",
            "legs",
            f"Along the side of {length:.2f} m at ({x:.2f}, {y:.2f}) in the map, a level about "
            f"{lower:.0f} mm lower was seen from across the top, where other views see nothing: a "
            "strip of the top has a wrong depth, as a pattern or a reflection makes it, and the "
            "top reaches as far beyond this side as the strip is wide.",
            places=(WarnedPlace.along((start, end)),),
        )
    return None


_LEAST_SIDE = 0.3  # metres


@dataclass(frozen=True, eq=False)
class _TopView:
    """What one view sees about the top.

    - ``eye``: (2,), the camera in the map
    - ``crossings``: (n, 2), where rays meet the top's level, in the map
    - ``points``: (n, 3), what they meet, in the map
    - ``below``: (n,), metres that this lies below the top
    """

    eye: Floats
    crossings: Floats
    points: Floats
    below: Floats


def _look(snapshot: Snapshot, map_from_base: Pose2, outline: Polygon, height: float) -> _TopView:
    rays = snapshot.camera.rays[::_STRIDE, ::_STRIDE].reshape(-1, 3)
    depth = snapshot.depth[::_STRIDE, ::_STRIDE].ravel()
    pose = snapshot.base_from_camera
    toward = rays @ pose[:3, :3].T.astype(np.float32)
    drop = max(float(pose[2, 3]) - height, 0.0)
    kept = np.flatnonzero((toward[:, 2] < -_FLATTEST) & np.isfinite(depth))
    toward, depth = toward[kept], depth[kept]
    reach = drop / -toward[:, 2]
    crossings = map_from_base.apply(pose[:2, 3] + reach[:, None] * toward[:, :2])
    x, y = crossings.T
    low_x, low_y, high_x, high_y = outline.buffer(_BEYOND[1]).bounds
    near = np.flatnonzero((x > low_x) & (x < high_x) & (y > low_y) & (y < high_y))
    met = depth[near, None] * toward[near] + pose[:3, 3]
    return _TopView(
        eye=map_from_base.apply(pose[:2, 3]),
        crossings=crossings[near],
        points=np.column_stack([map_from_base.apply(met[:, :2]), met[:, 2]]),
        below=height - met[:, 2],
    )


def _lower(look: _TopView, start: Floats, end: Floats) -> tuple[Floats, Bools]:
    """Return points (n, 3) that seem to lie lower just beyond a side, and where.

    The second is which of the side's stations (m,) see mostly such points.
    """
    along = end - start
    length = float(np.linalg.norm(along))
    along = along / length
    outward = np.array([along[1], -along[0]])
    count = max(int(length / _STATION), 1)
    beyond = (look.crossings - start) @ outward
    near = np.flatnonzero((beyond > _BEYOND[0]) & (beyond < _BEYOND[1]))
    run, sight = (look.crossings[near] - start) @ along, look.crossings[near] - look.eye
    kept = (run > 0) & (run < length)
    kept &= sight @ outward > _AWAY * np.linalg.norm(sight, axis=1)
    near, run = near[kept], run[kept]
    is_lower = (look.below[near] > _LOWER[0]) & (look.below[near] < _LOWER[1])
    station = np.minimum((run / length * count).astype(np.int64), count - 1)
    seen = np.bincount(station, minlength=count)
    lower = np.bincount(station, weights=is_lower, minlength=count)
    stations: Bools = (seen >= _LEAST_PIXELS) & (lower > _LEAST_SHARE * seen)
    return look.points[near][is_lower & stations[station]], stations


def _is_nowhere(points: Floats, snapshots: tuple[Snapshot, ...], poses: dict[int, Pose2]) -> bool:
    """Tell whether several views see through most of the points (n, 3) in the map."""
    points = points[:: max(1, len(points) // _MOST_POINTS)]
    through = np.zeros(len(points), dtype=np.int64)
    met = np.zeros(len(points), dtype=np.int64)
    for index, pose in poses.items():
        away, depth = snapshots[index].depth_at(pose.inverse().apply(points), nearest=0.2)
        with np.errstate(invalid="ignore"):
            through += depth > away + _APART
            met += np.abs(depth - away) <= _APART
    nowhere = (through >= _LEAST_VIEWS) & (through >= met)
    return bool(nowhere.mean() > _LEAST_SHARE)
