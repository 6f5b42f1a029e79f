"""Arcs round the corners of a polygon as a disc that rolls along its sides would."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from tablemap.corners import Arcs

POLYGONS = {
    "rectangle": [(0.0, 0.0), (1.2, 0.0), (1.2, 0.8), (0.0, 0.8)],
    "triangle": [(0.0, 0.0), (1.2, 0.1), (0.4, 0.9)],
    "L": [(0.0, 0.0), (1.6, 0.0), (1.6, 0.7), (0.7, 0.7), (0.7, 1.5), (0.0, 1.5)],
}


@pytest.mark.parametrize("name", POLYGONS)
def test_corners_are_rounded_from_inside_and_from_outside(name: str) -> None:
    """The outline is what erosion and dilation by a disc make of the polygon."""
    radius = 0.08
    expected = shapely.Polygon(POLYGONS[name])
    for inward in (-radius, radius):
        expected = expected.buffer(inward, join_style="mitre").buffer(-inward, quad_segs=200)
    arcs = Arcs.rounding(np.array(POLYGONS[name]), radius)
    outline = shapely.Polygon(np.concatenate(arcs.points(200)))
    assert outline.is_valid
    assert shapely.hausdorff_distance(outline.exterior, expected.exterior) < 1e-3
    assert outline.symmetric_difference(expected).area < 1e-6


def test_arcs_end_where_their_points_end() -> None:
    """Both ways to ask for the ends agree."""
    arcs = Arcs.rounding(np.array(POLYGONS["L"]), 0.05)
    first, last = arcs.ends()
    points = arcs.points(8)
    assert np.array([arc[0] for arc in points]) == pytest.approx(first)
    assert np.array([arc[-1] for arc in points]) == pytest.approx(last)
