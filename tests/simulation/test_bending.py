"""Depth bends by a smooth field that grows with the distance, and by nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec import structs

from tablemap.geometry import Floats
from tablemap.simulation import Simulation, load_scenario, simulate
from tablemap.simulation.bending import FAMILIES, REFERENCE, draw_bend
from tablemap.simulation.scenario import CameraSection
from tablemap.simulation.scene import Scene


def simulation(**camera: object) -> Simulation:
    """The exact scenario with errors of a small camera."""
    scenario = load_scenario("exact")
    small = structs.replace(scenario.camera, **{"width": 160, "height": 120, **camera})
    return simulate(structs.replace(scenario, camera=small), seed=2)


def ratio(simulated: Simulation, *, progress: float = 0.5) -> tuple[Floats, Floats]:
    """What the first image's depth is multiplied by, NaN where none, and the true depth."""
    camera = simulated.camera
    pose = simulated.map_from_camera(float(simulated.image_seconds[0]))
    view = camera.view(Scene(simulated.parts(moved=False)), None, pose)
    depth = camera.depth(view, np.random.default_rng(0), progress=progress).ravel() / 1000
    return np.where(depth > 0, depth / view.depth, np.nan), view.depth


@pytest.mark.parametrize("family", FAMILIES)
def test_a_field_is_smooth_and_as_strong_as_stated(family: str) -> None:
    """Its mean is none, its most a third about what is stated, its steps small; seeds differ."""
    camera = CameraSection(bend_percent=1.5, bend_family=family)
    fields = [draw_bend(camera, np.random.default_rng(seed)) for seed in range(12)]
    offsets = np.stack([field.offset for field in fields if field])
    most = np.abs(offsets).max(axis=(1, 2))
    assert offsets.shape == (12, 480, 640)
    assert np.abs(offsets.mean(axis=(1, 2))).max() < 1e-12
    assert most.min() >= 0.01
    assert most.max() <= 0.02
    assert np.ptp(most) > 0.003
    assert np.abs(np.diff(offsets, axis=2)).max() < 3e-4
    likeness = np.corrcoef(offsets.reshape(12, -1))
    assert np.abs(likeness[np.triu_indices(12, 1)]).min() < 0.2


def test_a_field_is_no_low_polynomial() -> None:
    """A cubic fitted to waves and patches leaves a tenth of them and more."""
    v, u = np.mgrid[-0.75:0.75:24j, -1:1:32j]
    powers = [u**i * v**j for i in range(4) for j in range(4) if i + j < 4]
    cubic = np.column_stack([power.ravel() for power in powers])
    for family in ("waves", "patches"):
        left = []
        for seed in range(8):
            camera = CameraSection(bend_percent=1.5, bend_family=family, width=32, height=24)
            field = draw_bend(camera, np.random.default_rng(seed))
            assert field
            offset = field.offset.ravel()
            rest = offset - cubic @ np.linalg.lstsq(cubic, offset)[0]
            left.append(rest.std() / offset.std())
        assert np.median(left) > 0.1


def test_depth_is_multiplied_by_the_field() -> None:
    """Without noise the depth is the true one times the field at its distance, to a millimetre."""
    simulated = simulation(bend_percent=1.5)
    bend = simulated.camera.errors.bend
    assert bend
    factors, true = ratio(simulated)
    seen = np.isfinite(factors)
    expected = 1 + bend.offset.ravel() + bend.growth.ravel() * (np.clip(true, 0, 5) - REFERENCE)
    assert np.nanmax(np.abs(factors - 1)) > 0.005
    assert np.abs((factors - expected) * true)[seen].max() < 6e-4


def test_without_growth_the_field_is_the_same_at_all_distances() -> None:
    """Its growth is a setting of its own."""
    bend = simulation(bend_percent=1.5, bend_growth=0.0).camera.errors.bend
    assert bend
    near, far = (bend.multiplier(np.full(160 * 120, z)) for z in (0.8, 3.0))
    assert near == pytest.approx(far, abs=1e-12)


def test_a_camera_that_warms_up_drifts() -> None:
    """The scale moves over the drive by what was drawn, and is the drawn one in its middle."""
    simulated = simulation(warming_sigma=0.003)
    start, middle, end = (np.nanmedian(ratio(simulated, progress=p)[0]) for p in (0.0, 0.5, 1.0))
    warming = simulated.camera.errors.warming
    assert abs(warming) > 1e-4
    assert end - start == pytest.approx(warming, abs=3e-4)
    assert middle == pytest.approx(1.0, abs=3e-4)


def test_one_error_more_leaves_the_others_as_they_were() -> None:
    """What a seed draws does not hang on which errors are switched on."""
    plain = simulate(load_scenario("bent_rectangle"), seed=4)
    scenario = plain.scenario
    camera = structs.replace(scenario.camera, bend_percent=0.0, warming_sigma=0.0)
    straight = simulate(structs.replace(scenario, camera=camera), seed=4)
    assert straight.camera.errors.bend is None
    assert straight.camera.errors.pitch == plain.camera.errors.pitch
    assert straight.camera.errors.depth_scale == plain.camera.errors.depth_scale
    assert (straight.drive.tilts == plain.drive.tilts).all()
    assert straight.laser_errors == plain.laser_errors
