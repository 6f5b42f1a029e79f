"""A laser reads dark legs far, and its ranges bend with the angle."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec import structs

from tablemap.geometry import Floats
from tablemap.simulation import Simulation, load_scenario, simulate
from tablemap.simulation import laser as scanner
from tablemap.simulation.scene import Scene


def ranges(*, reflectance: float | None = None, **laser: object) -> tuple[Floats, Simulation]:
    """Return the first scan of the exact scenario with errors, and the simulation."""
    scenario = load_scenario("exact")
    legs = structs.replace(scenario.table.legs, reflectance=reflectance)
    table = structs.replace(scenario.table, legs=legs)
    errors = structs.replace(scenario.laser, **laser)
    simulated = simulate(structs.replace(scenario, table=table, laser=errors), seed=2)
    scene = Scene(simulated.parts(moved=False))
    scan = scanner.scan(
        scene,
        (),
        simulated.drive,
        simulated.attitude,
        simulated.scan_seconds[:1],
        laser=errors,
        errors=simulated.laser_errors,
        rng=np.random.default_rng(0),
    )[0]
    return scan.astype(float), simulated


def test_dark_legs_read_far() -> None:
    """Further than light ones by what was drawn, and never nearer."""
    light, _ = ranges(reflectance=1.0, dark_sigma=0.006)
    dark, simulated = ranges(reflectance=0.05, dark_sigma=0.006)
    difference = dark - light
    on_legs = np.abs(difference) > 1e-6
    assert on_legs.sum() > 10
    expected = 0.95 * simulated.laser_errors.dark
    assert difference[on_legs] == pytest.approx(expected, abs=1e-5)
    assert expected > 1e-4


def test_ranges_bend_smoothly_with_the_angle() -> None:
    """By millimetres over the whole scan, and hardly from one beam to the next."""
    straight, _ = ranges()
    bent, simulated = ranges(bend_sigma=0.003)
    added = bent - straight
    angles = np.linspace(scanner.ANGLE_MIN, scanner.ANGLE_MAX, scanner.BEAMS)
    assert added == pytest.approx(simulated.laser_errors.bent(angles), abs=1e-5)
    assert 0.001 < added.std() < 0.008
    assert np.abs(np.diff(added)).max() < 2e-4
