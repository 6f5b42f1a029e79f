"""What stands on a top: enough of it, at the rim too, and never one thing in another."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from msgspec import structs

from tablemap.simulation import load_scenario, simulate
from tablemap.simulation.scenario import Clutter


@pytest.mark.parametrize("name", ["circle", "square", "desk"])
def test_a_crowd_covers_half_of_the_top(name: str) -> None:
    """Within the top, apart from each other, and at the rim too."""
    for seed in range(3):
        scenario = load_scenario(name)
        crowded = structs.replace(scenario, clutter=Clutter(rim=4, cover=0.5))
        world = simulate(crowded, seed=seed).world
        table = world.map_from_table.inverse()
        outlines = [
            shapely.MultiPoint(table.apply(part.mesh.vertices[:, :2])).convex_hull
            for part in world.parts[1:]
            if abs(part.mesh.vertices[:, 2].min() - world.top.height) < 1e-6
        ]
        top = world.top.polygon
        assert all(top.contains(outline) for outline in outlines)
        alone = sum(outline.area for outline in outlines)
        assert shapely.union_all(outlines).area == pytest.approx(alone, rel=1e-6)
        assert 0.44 < alone / top.area < 0.6
        gaps = np.array([outline.distance(top.exterior) for outline in outlines])
        assert (gaps < 0.021).sum() >= 3
        assert gaps.min() > 0.0


def test_a_crowd_is_drawn_apart_from_the_rest() -> None:
    """Room, table and drive are those of the same seed without it."""
    scenario = load_scenario("circle")
    crowded = structs.replace(scenario, clutter=Clutter(rim=4, cover=0.5))
    alone, among = simulate(scenario, seed=5), simulate(crowded, seed=5)
    assert alone.world.top.dimensions == among.world.top.dimensions
    assert (alone.drive.distances == among.drive.distances).all()
    assert alone.world.path.equals_exact(among.world.path, 0.0)
