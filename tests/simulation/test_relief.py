"""Floors wave, and tops slope and sag, as the truth says."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from msgspec import structs

from tablemap.geometry import Floats, Pose2
from tablemap.simulation import Scenario, load_scenario, simulate
from tablemap.simulation.meshes import plate, prism, refined
from tablemap.simulation.scenario import Ground
from tablemap.simulation.scene import Scene


def exact(name: str = "exact", *, wave: float = 0.0, **table: object) -> Scenario:
    """A scenario with another floor and another top."""
    scenario = load_scenario(name)
    update = {"table": structs.replace(scenario.table, **table), "ground": Ground(wave=wave)}
    return structs.replace(scenario, **update)


def looked_down(scene: Scene, places: Floats) -> Floats:
    """Return how high the scene is at places (n, 2)."""
    above = np.column_stack([places, np.full(len(places), 3.0)])
    return 3.0 - scene.cast(above, np.tile([0.0, 0.0, -1.0], (len(places), 1))).distance


def on_a_grid(polygon: shapely.Polygon, spacing: float = 0.01) -> Floats:
    """Return the points (n, 2) of a grid inside a polygon."""
    low, high = np.reshape(polygon.bounds, (2, 2))
    lines = [np.arange(a, b, spacing) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*lines), axis=-1).reshape(-1, 2)
    return grid[shapely.contains_xy(polygon, grid)]


@pytest.mark.parametrize("name", ["exact", "circle", "l_shape"])
def test_height_is_the_mean_of_a_top_that_slopes_and_sags(name: str) -> None:
    """Over the area; and the truth's slope, in the map, is that of the top."""
    simulated = simulate(exact(name, slope_sigma_deg=0.3, sag=0.004), seed=3)
    surface = simulated.truth()["surface"]
    assert isinstance(surface, dict)
    places = on_a_grid(shapely.Polygon(surface["outline"]).buffer(-1e-3))
    heights = looked_down(Scene(simulated.world.parts[:1]), places)
    assert heights.mean() == pytest.approx(surface["height"], abs=1e-4)
    fit = np.column_stack([places, np.ones(len(places))])
    slope = np.linalg.lstsq(fit, heights)[0][:2]
    stated = surface["relief"]["slope"]
    if name != "l_shape":  # an L's sag slopes by itself
        assert slope == pytest.approx([stated["x"], stated["y"]], abs=1e-4)
    assert np.hypot(*slope) > 1e-3
    assert surface["relief"]["sag"] == 0.004


def test_a_top_sags_in_its_middle() -> None:
    """By what is stated, below the corners of a table and below the rim of a round one."""
    for name, rim in (("exact", "corners"), ("circle", "outline")):
        simulated = simulate(exact(name, sag=0.004), seed=3)
        top, pose = simulated.world.top, simulated.world.map_from_table
        held = pose.apply(0.999 * getattr(top, rim))
        scene = Scene(simulated.world.parts[:1])
        middle = looked_down(scene, pose.apply(np.zeros((1, 2))))[0]
        assert looked_down(scene, held) - middle == pytest.approx(0.004, abs=1e-4)


def test_what_stands_on_a_top_moves_with_it_and_legs_stay_on_the_floor() -> None:
    """Boxes neither float nor sink, and no leg leaves the ground."""
    sloping = simulate(exact("rectangle_default_cluttered", slope_sigma_deg=1.0), seed=3)
    level = simulate(exact("rectangle_default_cluttered"), seed=3)
    assert len(sloping.world.parts) == len(level.world.parts)
    relief = sloping.world.relief
    assert relief
    low = level.world.top.height
    standing = 0
    for moved, part in zip(sloping.world.parts, level.world.parts, strict=True):
        before, after = part.mesh.vertices, moved.mesh.vertices
        bottom = before[:, 2].min()
        if abs(bottom - low) < 1e-9:
            places = sloping.world.map_from_table.inverse().apply(before[:, :2])
            assert after[:, 2] - before[:, 2] == pytest.approx(relief.rises(places), abs=1e-9)
            standing += 1
        elif bottom == 0.0:
            assert after[:, 2].min() == 0.0
    assert standing > 3


def test_a_floor_waves_as_stated() -> None:
    """From trough to crest by some three millimetres, over a metre or two, and nowhere steeply."""
    simulated = simulate(exact(wave=0.003), seed=1)
    waves = simulated.world.waves
    assert waves
    (floor,) = (part for part in simulated.parts(moved=False) if len(part.mesh.vertices) > 5000)
    middle = simulated.world.map_from_table.translation
    places = middle + np.random.default_rng(0).uniform(-3, 3, (4000, 2))
    heights = looked_down(Scene([floor]), places)
    assert heights == pytest.approx(waves.heights(places), abs=1e-4)
    assert heights.std() == pytest.approx(0.003 / np.sqrt(8), rel=0.3)
    step = Pose2(0.3, 0.0, 0.0)
    assert np.abs(waves.heights(places) - waves.heights(step.apply(places))).max() < 0.004
    assert np.abs(heights.mean()) < 4e-4


def test_a_level_floor_and_a_flat_top_are_what_they_were() -> None:
    """Without the settings nothing is split and the truth says neither."""
    simulated = simulate(exact(), seed=1)
    truth = simulated.truth()
    assert truth["floor"] is None
    assert truth["surface"]["relief"] is None  # type: ignore[index]
    assert len(simulated.world.parts[0].mesh.vertices) == 8


def test_splitting_keeps_a_mesh_closed() -> None:
    """No edge is longer than asked, each has two triangles, and volume and place are the same."""
    outline = np.array([[0.0, 0.0], [1.2, 0.0], [1.2, 0.4], [0.5, 0.4], [0.5, 0.9], [0.0, 0.9]])
    for mesh in (
        prism(outline, 0.0, 0.03),
        plate(outline, 0.0, 0.03, edge="rounded", edge_size=0.005),
    ):
        fine = refined(mesh, 0.1)
        corners = fine.vertices[fine.triangles]
        edges = np.roll(corners, -1, axis=1) - corners
        assert np.linalg.norm(edges, axis=2).max() <= 0.1
        pairs = np.stack([fine.triangles, np.roll(fine.triangles, -1, axis=1)], axis=-1)
        _, counts = np.unique(np.sort(pairs.reshape(-1, 2), axis=1), axis=0, return_counts=True)
        assert (counts == 2).all()
        assert volume(fine.vertices[fine.triangles]) == pytest.approx(
            volume(mesh.vertices[mesh.triangles])
        )


def volume(corners: Floats) -> float:
    """Return the volume inside of triangles (n, 3, 3)."""
    return float(np.sum(np.cross(corners[:, 0], corners[:, 1]) * corners[:, 2]) / 6)
