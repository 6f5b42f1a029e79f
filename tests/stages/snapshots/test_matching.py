"""The width of the window that a depth camera compares is told by its noise along the rows."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from tablemap.config import SensorsConfig
from tablemap.stages.snapshots.matching import matching_window

FLOOR = np.repeat(np.linspace(2.8, 0.9, 240)[:, None], 320, axis=1)
"""A floor that runs away from the camera, (240, 320) metres."""


def matched(window: int, *, steps: float, seed: int = 0) -> NDArray[np.float32]:
    """Return a floor whose disparity is the mean of a window, in ``steps`` of a pixel."""
    rng = np.random.default_rng([seed, window])
    noise = uniform_filter(rng.normal(0, 1, FLOOR.shape), window)
    disparity = 40.0 / FLOOR + 0.06 * noise / noise.std()
    return (40.0 / (np.rint(disparity / steps) * steps)).astype(np.float32)


@pytest.mark.parametrize("window", [3, 7, 9, 11, 15, 21])
@pytest.mark.parametrize("steps", [1 / 8, 1 / 32])
def test_the_window_is_told_to_a_pixel(window: int, steps: float) -> None:
    """Whether disparities come in eighths of a pixel or finer."""
    images = [matched(window, steps=steps, seed=seed) for seed in range(3)]
    assert matching_window(images) == pytest.approx(window, abs=1.0)


def test_independent_noise_shows_no_window() -> None:
    """Time of flight measures each pixel by itself; its gaps do not matter."""
    rng = np.random.default_rng(3)
    depth = (FLOOR + rng.normal(0, 0.004, FLOOR.shape)).astype(np.float32)
    depth[rng.uniform(size=depth.shape) < 1e-4] = np.nan
    assert matching_window([depth]) == 0.0


def test_nothing_is_told_of_nothing() -> None:
    """Empty, tiny and noiseless images show no window."""
    assert matching_window([]) == 0.0
    assert matching_window([np.full((4, 6), np.nan, dtype=np.float32)]) == 0.0
    assert matching_window([np.full(FLOOR.shape, 1.5, dtype=np.float32)] * 2) == 0.0


def test_a_wider_window_makes_edges_less_certain() -> None:
    """Edges err by a share of the window; without one, and where more is believed, nothing is."""
    plain = SensorsConfig()
    assert plain.of_window(0.0) == plain
    narrow, wide = plain.of_window(9.0), plain.of_window(15.0)
    for name in ("near_edge_bias", "top_widening_sigma_px", "edge_bias_sigma"):
        assert getattr(plain, name) < getattr(narrow, name) < getattr(wide, name)
    certain = SensorsConfig(top_widening_sigma_px=5.0).of_window(9.0)
    assert certain.top_widening_sigma_px == 5.0
    assert SensorsConfig(matching_window_px=7.0).of_window(15.0) == plain.of_window(7.0)
