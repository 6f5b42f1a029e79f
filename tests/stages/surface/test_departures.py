"""A shape that the edge does not follow is doubted, and its sigmas admit it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from tablemap.config import SensorsConfig, SurfaceConfig
from tablemap.geometry import Pose2
from tablemap.stages.surface import Surface, fit_surface
from tests.making.edges import (
    Bench,
    Table,
    box_table,
    desk,
    l_table,
    observe,
    polygon_table,
    rounded,
    school_table,
)

POSE = Pose2(0.31, -0.22, 0.37)


def _barrel(bow: float) -> Table:
    """Make a table of 1.6 m by 0.85 m, whose long sides bow out in the middle."""
    x = np.linspace(-0.8, 0.8, 40)
    y = 0.425 + bow * (1 - (x / 0.8) ** 2)
    return polygon_table([*zip(x, -y, strict=True), *zip(x[::-1], y[::-1], strict=True)], POSE)


def _half_round(radius: float) -> Table:
    """Make a half circle: a polygon of many sides follows it to millimetres."""
    turn = np.linspace(0.0, np.pi, 60)
    ring = radius * np.column_stack([np.cos(turn), np.sin(turn) - 0.4])
    return polygon_table([*map(tuple, ring.tolist())], POSE)


def _regular(sides: int) -> Table:
    """Make a regular polygon with a radius of 0.6 m."""
    turn = np.arange(sides) * (2 * np.pi / sides)
    ring = 0.6 * np.column_stack([np.cos(turn), np.sin(turn)])
    return polygon_table([*map(tuple, ring.tolist())], POSE)


def _with_paper() -> Table:
    """Make a rectangle of 1.4 m by 0.8 m with a sheet over its edge."""
    paper = shapely.box(-0.1, 0.3, 0.2, 0.48)
    whole = shapely.orient_polygons(shapely.union(shapely.box(-0.7, -0.4, 0.7, 0.4), paper))
    return polygon_table([*whole.exterior.coords][:-1], POSE)


def _with_cloth() -> Table:
    """Make a rectangle of 1.4 m by 0.8 m with a cloth over one end that is 10 cm wider."""
    cloth = shapely.box(0.1, -0.45, 0.75, 0.45)
    whole = shapely.orient_polygons(shapely.union(shapely.box(-0.7, -0.4, 0.7, 0.4), cloth))
    return polygon_table([*whole.exterior.coords][:-1], POSE)


def _unequal_table(radius: float) -> Table:
    """Make a rectangle of which two opposite corners are rounded."""
    soft = rounded(box_table(1.2, 0.8, Pose2()), radius).outline
    sharp = [shapely.box(-0.6, -0.4, 0, 0), shapely.box(0, 0, 0.6, 0.4)]
    whole = shapely.orient_polygons(shapely.union_all([shapely.Polygon(soft), *sharp]))
    return polygon_table([*whole.exterior.coords][:-1], POSE)


def _fit(table: Table, seed: int) -> Surface:
    outline, registration = observe(table, Bench(), np.random.default_rng(seed))
    config, sensors = SurfaceConfig(), SensorsConfig()
    return fit_surface(outline, registration, config=config, sensors=sensors, seed=0)


def _codes(surface: Surface) -> set[str]:
    return {warning.code for warning in surface.warnings}


def test_sides_that_bow_are_doubted() -> None:
    """Long sides bow by 4 cm: the warning says how far and where, and the sigmas reach it."""
    table = _barrel(0.04)
    surface = _fit(table, 3)
    (warning,) = [w for w in surface.warnings if w.code == "accuracy.outline"]
    assert "mm" in warning.message
    assert "in the map" in warning.message
    assert max(edge.sigma or 0.0 for edge in surface.edges) > 0.005
    for figure in surface.dimensions.values():
        assert figure.sigma is not None
        assert figure.budget is not None
        assert figure.budget["shape"] > 0.004**2
        assert figure.sigma**2 == pytest.approx(sum(figure.budget.values()))


def test_unequally_round_corners_are_doubted() -> None:
    """Two corners are sharp, two are round: the points that the robust loss discards show it."""
    assert "accuracy.outline" in _codes(_fit(_unequal_table(0.12), 3))


@pytest.mark.parametrize("radius", [0.4, 0.7])
def test_sides_that_stand_for_a_curve_are_doubted(radius: float) -> None:
    """Each side of the polygon bows out between its ends, by more than noise makes of it."""
    surface = _fit(_half_round(radius), 3)
    assert surface.shape == "polygon"
    assert "accuracy.outline" in _codes(surface)


@pytest.mark.parametrize("sides", [8, 12])
def test_polygons_of_many_straight_sides_are_not_doubted(sides: int) -> None:
    """An octagon turns as little at each corner as what stands for a curve."""
    assert "accuracy.outline" not in _codes(_fit(_regular(sides), 3))


def test_a_simple_shape_but_for_a_small_part_is_doubted() -> None:
    """A sheet of paper over the edge is as flat as the top; an L is no rectangle."""
    surface = _fit(_with_paper(), 4)
    assert surface.shape == "polygon"
    assert "accuracy.shape_ambiguous" in _codes(surface)
    assert "accuracy.shape_ambiguous" not in _codes(_fit(l_table(POSE), 3))


@pytest.mark.parametrize("is_hole", [True, False])
def test_the_end_of_a_hole_at_the_edge_is_no_edge(is_hole: bool) -> None:
    """A reflection at the rim leaves ends of top behind which some pixels have no depth."""
    table = box_table(1.2, 0.8, POSE)
    outline, registration = observe(table, Bench(), np.random.default_rng(3))
    place = POSE.apply(np.array([0.1, 0.4]))
    views = []
    for view, pose in zip(outline.views, registration.map_from_base, strict=True):
        about = np.linalg.norm(pose.apply(view.points) - place, axis=1) < 0.12
        views.append(
            replace(
                view,
                points=view.points - 0.07 * about[:, None] * view.normals,
                hole=np.where(about & is_hole, 3 * view.metres_per_px, np.nan),
            )
        )
    surface = fit_surface(
        replace(outline, views=tuple(views)),
        registration,
        config=SurfaceConfig(),
        sensors=SensorsConfig(),
        seed=0,
    )
    assert surface.shape == "rectangle"
    doubted = {"accuracy.outline", "accuracy.inner_edge"} & _codes(surface)
    assert not doubted if is_hole else doubted


def test_a_cloth_over_one_end_is_doubted() -> None:
    """No table is made so that a side steps or bends inward a little; a desk has its cut-out."""
    surface = _fit(_with_cloth(), 3)
    assert surface.shape == "polygon"
    assert "accuracy.shape_ambiguous" in _codes(surface)
    assert "accuracy.shape_ambiguous" not in _codes(_fit(desk(POSE), 3))


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_right_shapes_are_not_doubted(seed: int) -> None:
    """Noise, misplaced views, strays and occluders leave no stretch where all views agree."""
    soft = [rounded(table, 0.06) for table in (box_table(1.0, 0.6, POSE), school_table(POSE))]
    for table in (box_table(1.2, 0.8, POSE), *soft):
        assert "accuracy.outline" not in _codes(_fit(table, seed))
