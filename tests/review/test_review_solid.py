"""The top as a solid in the viewer."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import trimesh

from tablemap.review.solid import extruded

SQUARE = shapely.box(-1.0, -0.5, 1.0, 0.5)
SHAPES = {
    "rectangle": SQUARE,
    "clockwise": SQUARE.reverse(),
    "L": SQUARE.difference(shapely.box(0.2, 0.0, 1.0, 0.5)),
    "with a hole": SQUARE.difference(shapely.box(-0.2, -0.2, 0.2, 0.2)),
    "circle": shapely.Point(0.3, 0.1).buffer(0.4),
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_drawn_top_is_closed_and_its_normals_point_outwards(name: str) -> None:
    """Its volume is the area times the thickness, as trimesh counts it."""
    corners, normals = extruded(SHAPES[name], 0.70, 0.73)
    mesh = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3))
    mesh.merge_vertices()
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(SHAPES[name].area * 0.03, rel=1e-9)
    assert mesh.bounds[:, 2] == pytest.approx([0.70, 0.73])
    assert normals[::3] == pytest.approx(mesh.face_normals, abs=1e-9)
