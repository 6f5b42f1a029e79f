"""The place in the map is as certain as the localisation that gives it, and not more."""

from __future__ import annotations

import numpy as np
import pytest

from tablemap.geometry import Floats, wrap_angle
from tablemap.stages.registration.placement import place_in_map

RUNS = 120


def ring(stops: int) -> Floats:
    """Return the poses (n, 3) of a ring of stops that face its middle."""
    turns = np.arange(stops) * 2 * np.pi / max(stops, 8)
    return np.column_stack([1.3 * np.cos(turns), 1.3 * np.sin(turns), turns + np.pi])


def wander(rng: np.random.Generator, stops: int, sigma: float, correlation: float) -> Floats:
    """Draw errors (n, 3) of a localisation, correlated from stop to stop."""
    errors = rng.normal(size=(stops, 3))
    for i in range(1, stops):
        errors[i] = correlation * errors[i - 1] + np.sqrt(1 - correlation**2) * errors[i]
    return errors * [sigma, sigma, sigma / 1.4]


@pytest.mark.parametrize("sigma", [0.06, 0.15])
@pytest.mark.parametrize("correlation", [0.0, 0.7])
@pytest.mark.parametrize("stops", [3, 4, 8, 20])
def test_the_stated_covariance_holds(stops: int, correlation: float, sigma: float) -> None:
    """Few stops, a wandering localisation and one that is worse than usual: two sigmas hold."""
    rng = np.random.default_rng(stops)
    relative = ring(stops)
    middle = relative[:, :2].mean(axis=0)
    scores = []
    for _ in range(RUNS):
        fit, covariance = place_in_map(relative, relative + wander(rng, stops, sigma, correlation))
        off = [*(fit.apply(middle[None])[0] - middle), wrap_angle(fit.yaw)]
        scores.append(np.array(off) / np.sqrt(np.diag(covariance)))
    z = np.array(scores)
    assert np.mean(np.abs(z) < 2) > 0.85
    assert 0.35 < np.sqrt(np.mean(z**2)) < 1.6


def test_fewer_stops_are_not_more_certain() -> None:
    """Half of a lap leaves more open in the map than all of it, whichever half."""
    rng = np.random.default_rng(3)
    relative = ring(8)
    less = more = 0.0
    for _ in range(40):
        localised = relative + wander(rng, 8, 0.06, 0.5)
        less += np.sqrt(place_in_map(relative, localised)[1][0, 0])
        for part in (slice(0, 4), slice(4, 8), slice(0, 8, 2)):
            more += np.sqrt(place_in_map(relative[part], localised[part])[1][0, 0]) / 3
    assert more > 1.2 * less


def test_a_pose_that_jumped_counts_little() -> None:
    """One of eight is a metre off: the rest place the drive, and the sigma hardly grows."""
    relative = ring(8)
    localised = relative + wander(np.random.default_rng(1), 8, 0.03, 0.0)
    plain, before = place_in_map(relative, localised)
    localised[3] += [1.0, -0.5, 0.8]
    jumped, after = place_in_map(relative, localised)
    assert jumped.as_array() == pytest.approx(plain.as_array(), abs=0.02)
    assert np.sqrt(after[0, 0]) < 2.5 * np.sqrt(before[0, 0])
