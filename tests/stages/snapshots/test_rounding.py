"""The steps between depth values, where they are coarse."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tablemap.stages.snapshots.rounding import FINE, REFERENCE_M, find_rounding


def floor_from(height: float) -> NDArray[np.float32]:
    """Return a noisy depth image (240, 320) of a floor, seen from a height in metres."""
    rows = (np.arange(240) - 60) / 270
    depth = np.tile((height / (0.6 + 0.8 * rows))[:, None], (1, 320))
    noisy = depth + np.random.default_rng(3).normal(0, 0.002, depth.shape)
    return np.asarray(noisy, dtype=np.float32)


@pytest.mark.parametrize("step", [0.02, 0.04])
def test_steps_of_a_depth_are_the_same_at_all_distances(step: float) -> None:
    """Centimetres, whatever the distance."""
    images = [np.round(floor_from(h) / step) * step for h in (1.0, 1.3)]
    found = find_rounding([image.astype(np.float32) for image in images])
    assert found.step == pytest.approx(step, rel=0.03)
    assert found.power == 0


@pytest.mark.parametrize("step", [0.03, 0.07])
def test_steps_of_a_disparity_grow_with_the_square_of_the_distance(step: float) -> None:
    """So they do in whole millimetres, as drivers write them."""
    unit = REFERENCE_M**2 / step
    images = [np.round(1e3 * unit / np.floor(unit / floor_from(h))) / 1e3 for h in (1.0, 1.3)]
    found = find_rounding([image.astype(np.float32) for image in images])
    assert found.step == pytest.approx(step, rel=0.1)
    assert found.power == 2


@pytest.mark.parametrize("step", [0.001, 0.008])
def test_fine_steps_count_for_nothing(step: float) -> None:
    """Millimetres hide in the noise, and average out."""
    image = (np.round(floor_from(1.1) / step) * step).astype(np.float32)
    assert find_rounding([image]) == FINE
    assert find_rounding([]) == FINE
    assert find_rounding([np.full_like(image, np.nan)]) == FINE
