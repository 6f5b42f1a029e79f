"""The truth knows what each image shows of the top."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from msgspec import structs

from tablemap.simulation import load_scenario, simulate
from tablemap.simulation.scenario import Clutter


def shares(name: str, *, seed: int = 1, **robot: object) -> np.ndarray[Any, Any]:
    """Return (images, 2): the top's share in the image, and unhidden."""
    scenario = load_scenario(name)
    simulated = simulate(
        structs.replace(scenario, robot=structs.replace(scenario.robot, **robot)), seed=seed
    )
    snapshots: Any = simulated.truth()["snapshots"]
    return np.array([[each["top_in_image"], each["sees_top"]] for each in snapshots])


def test_a_bare_small_top_is_seen_whole() -> None:
    """From every stop, and both images of a stop show the same."""
    seen = shares("circle")
    assert seen == pytest.approx(np.ones((16, 2)), abs=0.005)


def test_images_say_at_which_rest_they_were_taken() -> None:
    """Two images a rest, and none for those on the way."""
    scenario = load_scenario("continuous")
    for each, moving in ((load_scenario("circle"), False), (scenario, True)):
        snapshots: Any = simulate(each, seed=1).truth()["snapshots"]
        rests = [snapshot["rest"] for snapshot in snapshots]
        assert {rest for rest in rests if rest is not None} == set(range(8))
        assert (None in rests) == moving
    assert rests[:2] == [0, 0]


def test_a_large_top_leaves_the_image() -> None:
    """A conference table is in no image whole, and some of it is in each."""
    seen = shares("conference")
    assert seen[:, 0].max() < 0.99
    assert seen.min() > 0.2


def test_things_hide_the_top_and_the_image_does_not_know() -> None:
    """Half of the top lies under things, and they hide more of it from the side."""
    crowded = shares("bent_circle_crowded")
    assert crowded[:, 0].min() > 0.99
    assert crowded[:, 1].min() > 0.05
    assert crowded[:, 1].max() < 0.5


def test_a_head_turned_away_sees_none() -> None:
    """Its images show nothing of the top, and the truth says so."""
    seen = shares("circle", pan_deg=(0.0, 90.0))
    by_rest = seen.reshape(-1, 2, 2, 2)[:, :, 0]
    assert by_rest[:, 0].min() > 0.99
    assert by_rest[:, 1].max() == 0.0


def test_the_share_is_that_of_the_pixels() -> None:
    """Counted in an image, weighted by the area that each pixel covers, it is the same."""
    scenario = load_scenario("exact")
    cluttered = structs.replace(scenario, clutter=Clutter(count=4))
    simulated = simulate(cluttered, seed=3)
    area = simulated.world.top.polygon.area
    for i in (0, 6):
        second = float(simulated.image_seconds[i])
        camera = simulated.camera
        view = camera.view(simulated.scene(second), None, simulated.map_from_camera(second))
        top = (view.parts == 0) & (view.normals[:, 2] > 0.9)
        # A pixel covers z^2 / (fx fy) of a plane that faces the camera, and more of a slanted one.
        rays = np.linalg.norm(camera.directions(camera.pixels), axis=1)
        covered = view.depth**2 / (camera.k[0, 0] * camera.k[1, 1]) / (view.cosine * rays)
        seen = simulated.tops_seen[i].unhidden
        assert covered[top].sum() / area == pytest.approx(seen, abs=0.02)
