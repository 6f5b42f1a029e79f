"""A laser whose ranges are percents too long or short for the camera's depth is doubted."""

from __future__ import annotations

import numpy as np
import pytest

from tablemap.config import SensorsConfig
from tablemap.stages.crosscheck.scale import scale_excess, wrong_scale
from tablemap.stages.crosscheck.solve import MountingSolution

SENSORS = SensorsConfig()


def solution(too_long: float, sigma: float) -> MountingSolution:
    """Return what is solved from evidence of a share and its sigma, and the prior."""
    prior = SENSORS.laser_range_scale_sigma_wide
    variance = 1.0 / (sigma**-2 + prior**-2)
    asked = np.array([0.0, 0.0, 0.0, -too_long * variance / sigma**2])
    return MountingSolution(asked, np.diag([1e-6, 1e-6, 1e-6, variance]), (0.0, 0.1))


@pytest.mark.parametrize(("too_long", "word"), [(0.02, "long"), (-0.045, "short")])
def test_percents_are_said_as_the_evidence_has_them(too_long: float, word: str) -> None:
    """The prior, which believes the laser to permils, is taken out of the answer."""
    (doubt,) = wrong_scale(solution(too_long, 0.003), SENSORS)
    assert doubt.code == "accuracy.laser_scale"
    assert f"{100 * abs(too_long):.1f} % (sigma 0.3) too {word} for" in doubt.message


@pytest.mark.parametrize(("too_long", "sigma"), [(0.005, 0.001), (0.02, 0.006), (0.02, 1e6)])
def test_permils_and_guesses_are_not(too_long: float, sigma: float) -> None:
    """Half a percent is within what lens and depth err by, and three sigmas come by chance."""
    assert wrong_scale(solution(too_long, sigma), SENSORS) == ()


def test_legs_admit_a_scale_beyond_its_sigma() -> None:
    """Five permil at an estimate of three admit permils; one permil admits nothing."""
    assert scale_excess(solution(0.001, 0.003)) == 0.0
    assert 0.001 < scale_excess(solution(0.005, 0.003)) < 0.005
