"""What stands under a top and is no leg of it: bins, boxes, the shins of who sits there."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from tablemap.geometry import Floats
from tablemap.simulation import Simulation, load_scenario, simulate


def _under(simulation: Simulation) -> list[Floats]:
    """Return the corners (n, 3) of the parts that stand wholly under the top, without its legs."""
    truth = simulation.truth()
    top = shapely.Polygon(truth["surface"]["outline"])  # type: ignore[index]
    feet = np.array([(leg["x"], leg["y"]) for leg in truth["legs"]])  # type: ignore[union-attr]
    found = []
    for part in simulation.world.parts:
        corners = part.mesh.vertices
        middle = corners[:, :2].mean(axis=0)
        hull = shapely.MultiPoint(corners[:, :2]).convex_hull
        below = corners[:, 2].max() < simulation.world.top.height - 0.1
        if below and top.contains(hull) and np.linalg.norm(feet - middle, axis=1).min() > 0.1:
            found.append(corners)
    return found


@pytest.mark.parametrize("seed", range(3))
def test_things_stand_below_the_top_apart_from_its_legs(seed: int) -> None:
    """Three or four fit; each is on the floor, 30 to 58 cm high, and as slender as a leg may be."""
    things = _under(simulate(load_scenario("things_below"), seed=seed))
    assert 3 <= len(things) <= 4
    for corners in things:
        assert corners[:, 2].min() == 0.0
        assert 0.3 <= corners[:, 2].max() <= 0.58
        assert np.ptp(corners[:, :2], axis=0).max() < 0.2
    middles = np.array([corners[:, :2].mean(axis=0) for corners in things])
    apart = np.linalg.norm(middles[:, None] - middles[None], axis=2)
    assert apart[np.triu_indices(len(things), 1)].min() > 0.2


@pytest.mark.parametrize("seed", range(3))
def test_shins_of_seated_people_stand_under_the_top(seed: int) -> None:
    """Each has two shins of 11 cm that go up to the knees, at least two people sit there."""
    parts = _under(simulate(load_scenario("seated"), seed=seed))
    shins = [corners for corners in parts if corners[:, 2].max() > 0.45]
    assert len(shins) >= 4 and len(shins) % 2 == 0
    for corners in shins:
        assert np.ptp(corners[:, :2], axis=0).max() == pytest.approx(0.11, abs=0.005)
        assert 0.5 <= corners[:, 2].max() <= 0.54
