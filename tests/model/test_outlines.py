"""Outlines that cross themselves have a polygon all the same, and questions an answer."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from msgspec import structs

from tablemap.model import TableModel
from tablemap.model.outlines import simple_polygon
from tests.making.models import rectangle_model


@pytest.mark.parametrize(
    ("outline", "area"),
    [
        ([(0, 0), (1, 0), (1, 1), (0, 1)], 1.0),
        ([(0, 0), (2, 2), (2, 0), (0, 2)], 1.0),
        ([(0, 0), (3, 3), (3, 0), (2, 0), (0, 2)], 3.5),
        ([(0, 0), (1, 0), (2, 0)], 0.0),
        ([(0, 0), (1, 0), (1, 1), (0, 1), (0, 0), (-1, 0), (-1, -2), (0, -2)], 2.0),
    ],
)
def test_the_largest_part_stands_for_it(outline: list[tuple[float, float]], area: float) -> None:
    """A bow tie is one of its halves; what encloses nothing is empty."""
    polygon = simple_polygon(outline)
    assert isinstance(polygon, shapely.Polygon)
    assert polygon.is_valid
    assert polygon.area == pytest.approx(area)


def test_a_crossed_outline_is_asked_what_is_on_it() -> None:
    """Whether a place is on the top is answered for a bow tie as well."""
    model = rectangle_model()
    corners = model.surface.outline
    crossed = (corners[0], corners[2], corners[1], corners[3])
    surface = structs.replace(model.surface, outline=crossed)
    crossed_model = TableModel.read(structs.replace(model, surface=surface).fields())
    share = crossed_model.surface.contains([model.surface.pose.x, 9.0], [model.surface.pose.y, 9.0])
    assert np.isfinite(share).all()
    assert share[1] == pytest.approx(0.0, abs=1e-6)
