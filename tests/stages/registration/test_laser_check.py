"""The check of registered scans compares what both stops could see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tablemap.geometry import Floats
from tablemap.stages.registration.laser.check import check_stops, judge
from tablemap.stages.registration.laser.normals import planar_normals
from tablemap.stages.registration.result import LaserStatistics, StopScan

_AT = np.zeros(3)
_LEG = 0.06
_SPACING = 0.004


def _face(begin: Floats, end: Floats) -> Floats:
    points = round(float(np.linalg.norm(end - begin)) / _SPACING)
    return begin + np.linspace(0.0, 1.0, points)[:, None] * (end - begin)


def _scan(index: int, origin: Floats, faces: list[Floats]) -> StopScan:
    """Make a scan of faces, each (n, 2) points in beam order."""
    points = np.vstack([np.vstack([face, [[np.nan, np.nan]]]) for face in faces])
    normals, holds, noise = planar_normals(points, origin)
    offset = points[holds] - origin
    bearing = np.arctan2(offset[:, 1], offset[:, 0])
    order = np.argsort(bearing)
    away = np.linalg.norm(offset, axis=1)
    return StopScan(
        index=index,
        points=points[holds],
        normals=normals[holds],
        scans=1,
        directions=offset / away[:, None],
        origin=origin,
        bearings=bearing[order],
        ranges=away[order],
        noise=noise,
    )


def _seen(moved: float) -> LaserStatistics:
    """Return how a stop fits another; both see a wall, and two faces each of four legs.

    Stop 1 sees the legs from the other side. It is placed ``moved`` metres beside its true place.
    """
    wall = _face(np.array([-0.6, 2.0]), np.array([0.6, 2.0]))
    near, far = [], []
    for x in (-0.4, -0.2, 0.2, 0.4):
        low, high = np.array([x, 1.0]), np.array([x + _LEG, 1.0 + _LEG])
        near += [_face(low, np.array([high[0], low[1]])), _face(low, np.array([low[0], high[1]]))]
        far += [_face(high, np.array([high[0], low[1]])), _face(high, np.array([low[0], high[1]]))]
    first = _scan(0, np.array([-2.0, -1.0]), [wall, *near])
    second = _scan(1, np.array([1.5, 1.5]), [wall, *far])
    poses = np.array([_AT, [0.0, moved, 0.0]])
    check = check_stops([first, second], poses, [(1, 0)])[1]
    assert isinstance(check.statistics, LaserStatistics)
    return check.statistics


def test_faces_that_only_one_stop_can_see_say_nothing() -> None:
    """A leg seen from two sides shows other faces; only the wall can be compared."""
    assert _seen(0.0).consistent == pytest.approx(1.0)


def test_a_face_that_both_can_see_counts_where_it_does_not_fit() -> None:
    """Four centimetres off, the wall is still near its twin and contradicts it."""
    assert _seen(0.04).consistent < 0.2


@pytest.mark.parametrize(("points", "is_right"), [(15, True), (0, False), (600, False)])
def test_the_scatter_of_a_dozen_points_is_uncertain(points: int, is_right: bool) -> None:
    """Nine millimetres where eight are the limit: of few points they prove nothing."""
    assert (not judge(replace(_fits_itself(), rms=0.009, points=points), 0.002)) == is_right


@pytest.mark.parametrize(
    ("rms", "common", "is_right"),
    [(0.011, 0.002, False), (0.011, 0.008, True), (0.013, 0.008, False), (0.018, 0.016, False)],
)
def test_an_error_of_all_stops_is_the_lasers(rms: float, common: float, is_right: bool) -> None:
    """Ranges that bend misfit all stops alike; what misfits by centimetres is wrong at all."""
    assert (not judge(replace(_fits_itself(), rms=rms), common)) == is_right


def _fits_itself() -> LaserStatistics:
    """Return how a stop that saw one wall fits a twin of itself."""
    wall = _face(np.array([-0.6, 2.0]), np.array([0.6, 2.0]))
    scan = _scan(0, np.array([0.0, -1.0]), [wall])
    check = check_stops([scan, replace(scan, index=1)], np.zeros((2, 3)), [(1, 0)])[1]
    assert isinstance(check.statistics, LaserStatistics)
    assert check.statistics.points == len(scan.points)
    return check.statistics
