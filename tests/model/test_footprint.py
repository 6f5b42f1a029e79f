"""How sure it is that a point is on the table, against draws of pose and sides."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from msgspec import structs

from tablemap import model as m
from tablemap.geometry import Pose2
from tests.making.models import rectangle_model

DRAWS = 20_000
SAME = 0.015
"""Four standard deviations of a share of so many draws."""


POSE = Pose2(1.3, -0.7, 0.6)


def top_of(
    ring: np.ndarray,
    *,
    sigmas: list[float | None],
    covariance: np.ndarray | None = None,
    pose: Pose2 = POSE,
    statuses: list[m.Status] | None = None,
) -> m.TableSurface:
    """Return a top with this ring (M, 2) in its own frame, a side a segment."""
    points = [(float(x), float(y)) for x, y in pose.apply(ring)]
    variances = np.zeros((3, 3)) if covariance is None else covariance
    rows = [(float(a), float(b), float(c)) for a, b, c in variances]
    count = len(points) if len(sigmas) > 1 else 1
    edges = [
        m.Edge(
            points=(points[k], points[(k + 1) % len(points)]) if count > 1 else tuple(points),
            status=statuses[k] if statuses else "measured",
            sigma=sigmas[k],
            seen_fraction=1.0,
        )
        for k in range(count)
    ]
    template = rectangle_model().surface
    return structs.replace(
        template,
        pose=m.SurfacePose(
            x=pose.x, y=pose.y, yaw=pose.yaw, covariance=(rows[0], rows[1], rows[2])
        ),
        outline=tuple(points),
        edges=tuple(edges),
    )


def rectangle(length: float, width: float) -> np.ndarray:
    """Return a ring about the origin, counter-clockwise from the lower left."""
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.asarray(signs * [length / 2, width / 2])


L_SHAPE = np.array([[-0.6, -0.5], [0.6, -0.5], [0.6, 0.0], [0.0, 0.0], [0.0, 0.5], [-0.6, 0.5]])
PLACES = np.stack(np.meshgrid(np.linspace(-0.7, 0.7, 15), np.linspace(-0.6, 0.6, 13)), -1)
PLACES = PLACES.reshape(-1, 2)


def share_of_draws(top: m.TableSurface, ring: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return how often points (N, 2) in the map are within the ring, its pose drawn."""
    rng = np.random.default_rng(3)
    drawn = rng.multivariate_normal(
        [top.pose.x, top.pose.y, top.pose.yaw], top.pose.covariance, DRAWS
    )
    polygon = shapely.Polygon(ring)
    shapely.prepare(polygon)
    c, s = np.cos(drawn[:, 2:]), np.sin(drawn[:, 2:])
    dx, dy = points[:, 0] - drawn[:, :1], points[:, 1] - drawn[:, 1:2]
    return np.asarray(shapely.contains_xy(polygon, c * dx + s * dy, c * dy - s * dx).mean(axis=0))


COVARIANCE = np.array(
    [[0.03**2, 0.0004, 0.0002], [0.0004, 0.05**2, -0.0005], [0.0002, -0.0005, 0.03**2]]
)
CIRCLE = 0.3 * np.stack(
    [np.cos(np.arange(72) * math.tau / 72), np.sin(np.arange(72) * math.tau / 72)], axis=1
)


@pytest.mark.parametrize(
    ("ring", "sides"), [(rectangle(1.0, 0.6), 4), (L_SHAPE, 6), (CIRCLE, 1)], ids=["box", "L", "o"]
)
def test_in_the_map_the_pose_s_covariance_counts(ring: np.ndarray, sides: int) -> None:
    """At sides, convex and concave corners, inside and outside, as drawn poses have it."""
    top = top_of(ring, sigmas=[1e-6] * sides, covariance=COVARIANCE)
    points = Pose2(top.pose.x, top.pose.y, top.pose.yaw).apply(PLACES)
    found = top.contains(points[:, 0], points[:, 1])
    expected = share_of_draws(top, ring, points)
    assert ((expected > 0.05) & (expected < 0.95)).sum() > 10
    # A turn about the middle bends what is drawn; the calculation takes it as straight.
    assert np.abs(found - expected).max() < SAME + 0.01


def test_in_the_table_s_frame_the_sides_alone_count() -> None:
    """Each with its own sigma: at a corner both must lie beyond the point."""
    sigmas = [0.01, 0.03, 0.02, 0.004]
    top = top_of(rectangle(1.0, 0.6), sigmas=list(sigmas), covariance=COVARIANCE)
    rng = np.random.default_rng(4)
    # Half lengths to the lower, right, upper and left side.
    reach = np.array([0.3, 0.5, 0.3, 0.5]) + rng.normal(size=(DRAWS, 4)) * sigmas
    x, y = np.meshgrid([-0.51, -0.5, -0.49, 0.0, 0.45, 0.5, 0.53], [-0.32, -0.3, 0.0, 0.28, 0.3])
    distance = np.stack([y, -x, -y, x], axis=-1)  # how far inside each side's line, less its reach
    expected = (reach + distance[..., None, :] > 0).all(axis=-1).mean(axis=-1)
    found = top.contains(x, y, frame="table")
    assert found.shape == x.shape
    assert np.abs(found - expected).max() < SAME
    corner = float(top.contains(0.5, -0.3, frame="table"))
    assert corner == pytest.approx(0.25, abs=1e-3)


def test_numbers_and_arrays_of_any_shape_are_asked() -> None:
    """A number gives a number; the middle is on the table, a metre beside it is not."""
    surface = rectangle_model().surface
    assert float(surface.contains(0.31, -0.22)) == pytest.approx(1.0)
    assert float(surface.contains(0.31, 1.5)) == pytest.approx(0.0)
    assert surface.contains(np.zeros((2, 3)), 0.0).shape == (2, 3)
    assert surface.contains([], []).shape == (0,)
    assert np.isnan(surface.contains(float("nan"), 0.0))
    x, y = np.random.default_rng(0).normal(size=(2, 5000))
    several = surface.contains(x, y)
    assert several[4321] == pytest.approx(float(surface.contains(x[4321], y[4321])))
    assert ((several >= 0) & (several <= 1)).all()


@pytest.mark.parametrize("frame", ["map", "table"])
def test_beyond_a_side_that_nothing_bounds_all_is_unknown(frame: str) -> None:
    """What was seen is known, and so is what lies beside it; the pose's own doubt counts not."""
    unknown_place = np.diag([0.02**2, 0.02**2, 0.01**2])
    pose = Pose2(1.0, 2.0, 0.4)
    along = pose.rotation @ [1.0, 0.0]
    unknown_place[:2, :2] += 4.0 * np.outer(along, along)
    top = top_of(
        rectangle(1.0, 0.6),
        sigmas=[0.002, None, 0.002, 0.002],
        statuses=["measured", "unseen", "measured", "measured"],
        covariance=unknown_place,
        pose=pose,
    )
    asked = np.array([[0.0, 0.0], [0.4, 0.0], [0.6, 0.0], [4.0, 0.1], [0.6, 0.6], [-0.7, 0.0]])
    points = pose.apply(asked) if frame == "map" else asked
    found = top.contains(points[:, 0], points[:, 1], frame=frame)  # type: ignore[arg-type]
    assert found[:2] == pytest.approx([1.0, 1.0], abs=1e-3)
    assert np.isnan(found[2:4]).all()
    assert found[4:] == pytest.approx([0.0, 0.0], abs=1e-3)


def test_between_the_bounds_of_an_unseen_side_all_is_unknown() -> None:
    """Short of them and past them it is known."""
    top = top_of(
        rectangle(1.0, 0.6),
        sigmas=[0.002, 0.03, 0.002, 0.002],
        statuses=["measured", "unseen", "measured", "measured"],
    )
    found = top.contains([0.4, 0.47, 0.5, 0.54, 0.6], 0.0, frame="table")
    assert np.isnan(found).tolist() == [False, True, True, True, False]
    assert found[[0, 4]] == pytest.approx([1.0, 0.0], abs=1e-3)


def test_two_open_sides_leave_the_place_unknown() -> None:
    """In the map; in the table's own frame the seen part is as known as ever."""
    top = top_of(
        rectangle(1.0, 0.6),
        sigmas=[0.002, None, None, 0.002],
        statuses=["measured", "unseen", "unseen", "measured"],
        covariance=np.diag([4.0, 4.0, 0.01]),
    )
    assert np.isnan(top.contains(top.pose.x, top.pose.y))
    found = top.contains([0.0, 2.0, 2.0, -0.6], [0.0, 0.0, 2.0, 0.0], frame="table")
    assert np.isnan(found).tolist() == [False, True, True, False]


def test_a_hull_says_nothing() -> None:
    """It stands for what was seen, with no sigma."""
    top = top_of(L_SHAPE, sigmas=[None] * 6)
    assert np.isnan(top.contains([-0.5, 0.3, 1.0], [0.0, 0.3, 0.0], frame="table")).all()
