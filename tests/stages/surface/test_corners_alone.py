"""One corner unlike the others: too few points tell it to choose a shape, enough to doubt one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from tablemap.config import SensorsConfig, SurfaceConfig
from tablemap.geometry import Pose2
from tablemap.stages.surface import Surface, fit_surface
from tests.making.edges import Bench, Table, box_table, cut_off, observe, rounded

SQUARE = box_table(1.2, 0.8, Pose2(0.3, -0.2, 0.4))


def at_one_corner(table: Table, changed: Table) -> Table:
    """Return the table with one of its corners as the changed one has it."""
    about = shapely.Point(table.outline[0]).buffer(0.2)
    lost = about.difference(shapely.Polygon(changed.outline))
    left = shapely.orient_polygons(shapely.Polygon(table.outline).difference(lost))
    return replace(table, shape="polygon", outline=np.asarray(left.exterior.coords)[:-1])


def fitted(table: Table, seed: int) -> Surface:
    """Fit the table as eight views see it."""
    outline, registration = observe(table, Bench(), np.random.default_rng(seed))
    return fit_surface(
        outline, registration, config=SurfaceConfig(), sensors=SensorsConfig(), seed=seed
    )


@pytest.mark.parametrize(
    "changed", [cut_off(SQUARE, 0.03), rounded(SQUARE, 0.06)], ids=["cut", "round"]
)
@pytest.mark.parametrize("seed", [0, 1])
def test_one_blunt_corner_is_fitted_or_doubted(changed: Table, seed: int) -> None:
    """A rectangle that lacks one corner is not a sure rectangle, though its figures are right."""
    surface = fitted(at_one_corner(SQUARE, changed), seed)
    codes = [warning.code for warning in surface.warnings]
    assert surface.shape == "polygon" or "accuracy.outline" in codes
    if surface.shape == "rectangle":
        assert surface.dimensions["length"].value == pytest.approx(1.2, abs=0.006)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_sharp_corners_are_not_doubted(seed: int) -> None:
    """Noise cuts no corner."""
    surface = fitted(SQUARE, seed)
    assert surface.shape == "rectangle"
    assert "accuracy.outline" not in [warning.code for warning in surface.warnings]
