"""The caster of the made-up worlds: it meets what shapely and trimesh meet."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import trimesh

from tests.making.casting import Box, Drum, World, cast_level, looking

SOLIDS = (
    Box(1.5, 0.3, 1.2, 0.8, 0.70, 0.75, 0.4),
    Box(1.2, 0.1, 0.05, 0.05, 0.0, 0.70, 0.4),
    Drum(1.9, -0.4, 0.3, 0.0, 0.9),
)


def meshes() -> list[trimesh.Trimesh]:
    """The solids as trimesh makes them."""
    made = []
    for solid in SOLIDS:
        tall = solid.high - solid.low
        if isinstance(solid, Box):
            mesh = trimesh.creation.box((solid.length, solid.width, tall))
            turn = trimesh.transformations.rotation_matrix(solid.yaw, [0, 0, 1])
            mesh.apply_transform(turn)
        else:
            mesh = trimesh.creation.cylinder(solid.diameter / 2, tall, sections=512)
        made.append(mesh.apply_translation([solid.x, solid.y, (solid.low + solid.high) / 2]))
    return made


def test_the_surfaces_of_solids_and_floor_are_met() -> None:
    """What is met lies on the surface of what is named, and nothing lies before it."""
    pose = looking(1.2, np.radians(30), left=0.1)
    u, v = np.meshgrid(np.linspace(-0.6, 0.6, 25), np.linspace(-0.4, 0.4, 17))
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ pose[:3, :3].T
    depth, what = World(SOLIDS).cast(pose[:3, 3], rays)
    assert set(what.ravel().tolist()) == {0, 1, 2, 3}
    points = pose[:3, 3] + depth[..., None] * rays
    assert np.abs(points[what == 0][:, 2]).max() < 1e-9
    for number, mesh in enumerate(meshes(), start=1):
        _, apart, _ = trimesh.proximity.closest_point_naive(mesh, points[what == number])
        assert apart.max() < 1e-4
        # Nine tenths of the way there no ray is inside of anything.
        before = (pose[:3, 3] + 0.9 * depth[..., None] * rays).reshape(-1, 3)
        distance = trimesh.proximity.signed_distance(mesh, before)
        assert distance.max() < 1e-4


def test_a_laser_meets_what_it_cuts_and_the_walls() -> None:
    """As shapely intersects its beams with the outlines at that height, from its own place each."""
    walls = Box(1.0, 0.0, 6.0, 4.0).sides()
    angle = np.linspace(-2.0, 2.0, 101)
    origins = np.stack([0.01 * angle, 0.2 + 0.0 * angle], axis=1)
    rays = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found = World(SOLIDS, walls).cast_at(0.2, origins, rays)
    leg = shapely.Polygon(SOLIDS[1].sides()[:, :2])
    column = shapely.Point(SOLIDS[2].x, SOLIDS[2].y).buffer(0.15, quad_segs=512)
    scene = shapely.union_all([shapely.box(-2, -2, 4, 2).exterior, leg.exterior, column.exterior])
    beams = shapely.linestrings(np.stack([origins, origins + 20 * rays], axis=1))
    expected = shapely.distance(shapely.points(origins), shapely.intersection(beams, scene))
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert (found < 2.1).sum() > 5


def test_where_nothing_is_met_the_distance_has_no_end() -> None:
    """Above the horizon, or beside all walls; and a ray's own length is its unit."""
    assert np.isinf(World(SOLIDS).cast(np.array([0.0, 0, 1]), np.array([[1.0, 0, 0.5]]))[0]).all()
    wall = np.array([[2.0, -1.0, 2.0, 1.0]])
    rays = np.array([[1.0, 0.0], [0.5, 0.0], [0.0, 1.0]])
    assert cast_level(wall, np.zeros(2), rays).tolist() == [2.0, 4.0, np.inf]


@pytest.mark.parametrize("solid", [SOLIDS[0], SOLIDS[2]])
def test_how_far_outside_is_the_distance_to_the_outline(solid: Box | Drum) -> None:
    """Negative within it."""
    points = np.random.default_rng(0).uniform(-1, 4, (200, 2))
    outline = (
        shapely.Polygon(solid.sides()[:, :2])
        if isinstance(solid, Box)
        else shapely.Point(solid.x, solid.y).buffer(solid.diameter / 2, quad_segs=512)
    )
    apart = shapely.distance(shapely.points(points), outline.exterior)
    inside = shapely.contains_xy(outline, points)
    np.testing.assert_allclose(solid.outside(points), np.where(inside, -apart, apart), atol=1e-5)
