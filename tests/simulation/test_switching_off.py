"""Each error can be switched off by itself, and a seed draws all others as before."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tablemap.errors import ConfigError
from tablemap.simulation import Simulation, error_names, load_scenario, simulate, without
from tablemap.simulation.scenario import Scenario, ScenarioSection
from tablemap.simulation.switching_off import ERRORS
from tablemap.structs import fields_of

SCENARIO = load_scenario("bent_corners")
DRAWN = {
    "camera.scale_sigma": ("depth_scale",),
    "camera.pitch_sigma_deg": ("pitch",),
    "camera.roll_sigma_deg": ("roll",),
    "camera.mount_sigma": ("camera_x", "camera_y"),
    "camera.mount_yaw_sigma_deg": ("camera_yaw",),
    "camera.mount_height_sigma": ("camera_z",),
    "camera.bend_percent": ("bend",),
    "camera.bend_growth": ("bend",),
    "camera.warming_sigma": ("warming",),
    "camera.corner_nearer": ("corners",),
    "head.pan_sigma_deg": ("encoders",),
    "head.tilt_sigma_deg": ("encoders",),
    "ground.lean_sigma_deg": ("lean",),
    "laser.scale_sigma": ("laser_range_scale",),
    "laser.bias_sigma": ("laser_range_bias",),
    "laser.bias_slope_sigma": ("laser_range_bias_slope",),
    "laser.bend_sigma": ("laser_bend",),
    "laser.dark_sigma": ("laser_dark",),
}
"""What each changes of the truth's ``sensor``; the rest changes nothing there."""


def world(simulated: Simulation) -> list[Any]:
    """Everything of a world and a drive that is no error."""
    truth: Any = simulated.truth()
    surface = {key: value for key, value in truth["surface"].items() if key != "relief"}
    places = [each["map_from_base"] for each in truth["snapshots"]]
    return [surface, truth["legs"], places, simulated.drive.tilts.tolist()]


@pytest.fixture(scope="module")
def all_on() -> Simulation:
    """The scenario as it is."""
    return simulate(SCENARIO, seed=7)


@pytest.mark.parametrize("error", error_names())
def test_an_error_goes_alone(error: str, all_on: Simulation) -> None:
    """World, drive and every other drawn error are the same to the last bit."""
    simulated = simulate(without(SCENARIO, error), seed=7)
    assert world(simulated) == world(all_on)
    before: Any = all_on.truth()["sensor"]
    after: Any = simulated.truth()["sensor"]
    changed = tuple(key for key in before if before[key] != after[key])
    assert changed == DRAWN.get(error, ())
    moved = (all_on.belief.map_from_base != simulated.belief.map_from_base).any()
    assert moved == error.startswith("localisation.")
    turned = (all_on.belief.odom_from_base != simulated.belief.odom_from_base).any()
    assert turned == error.startswith("wheels.")


def test_an_error_s_drawn_value_is_nought_when_it_is_off() -> None:
    """All off together leave a perfect sensor."""
    truth: Any = simulate(without(SCENARIO, *error_names()), seed=7).truth()
    sensor = truth["sensor"]
    assert (sensor.pop("depth_scale"), sensor.pop("focal_scale")) == (1.0, 1.0)
    assert sensor.pop("laser_range_scale") == 1.0
    assert sensor.pop("bend") is None
    assert not np.any([np.any(np.hstack([*nested(value)])) for value in sensor.values()])
    assert truth["floor"] is None
    assert truth["surface"]["relief"] is None


def nested(value: Any) -> list[Any]:
    """Return the numbers in a value of the truth file."""
    if isinstance(value, dict):
        return [np.ravel(each) for each in value.values()]
    return [np.ravel(value)]


def test_every_sigma_is_an_error() -> None:
    """A setting named after a spread that draws a sensor's error is in the list."""
    for name, field in fields_of(Scenario).items():
        section = field.type
        if not (isinstance(section, type) and issubclass(section, ScenarioSection)):
            continue
        for setting in fields_of(section):
            if "sigma" in setting:
                assert setting in ERRORS[name], f"{name}.{setting}"


def test_an_unknown_error_is_refused() -> None:
    """In one sentence that says which there are."""
    with pytest.raises(ConfigError, match=r"no error named 'camera\.blur'; there are table\.slope"):
        without(SCENARIO, "camera.blur")
