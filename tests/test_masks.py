"""Masks grown, shrunk and opened by shifts are those of the filters of scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from tablemap.geometry import Bools
from tablemap.masks import counted, crowded, grown, opened, shrunk


@pytest.fixture(params=[(48, 64), (7, 9), (1, 5), (3, 3), (2, 2)])
def shape(request: pytest.FixtureRequest) -> tuple[int, int]:
    """Images wider and narrower than the windows."""
    size: tuple[int, int] = request.param
    return size


@pytest.fixture(params=[0.02, 0.5, 0.97])
def mask(request: pytest.FixtureRequest, shape: tuple[int, int]) -> Bools:
    """A sparse, an even and a dense mask."""
    return np.asarray(np.random.default_rng(0).random(shape) < request.param)


@pytest.mark.parametrize("size", [1, 2, 3, 5, 9, 11])
def test_grown_and_shrunk(mask: Bools, size: int) -> None:
    """They are the largest and the smallest value in the window, cut off at the border."""
    values = mask.view(np.uint8)
    np.testing.assert_array_equal(grown(mask, size), ndimage.maximum_filter(values, size) > 0)
    np.testing.assert_array_equal(shrunk(mask, size), ndimage.minimum_filter(values, size) > 0)


@pytest.mark.parametrize("size", [1, 2, 3, 5, 9])
def test_nothing_is_outside(mask: Bools, size: int) -> None:
    """What touches the border shrinks from there too, if asked for."""
    expected = ndimage.minimum_filter(mask.view(np.uint8), size, mode="constant") > 0
    np.testing.assert_array_equal(shrunk(mask, size, outside=False), expected)


@pytest.mark.parametrize("size", [3, 5])
def test_opened(mask: Bools, size: int) -> None:
    """An opening loses what the window does not fit in."""
    expected = ndimage.binary_opening(mask, np.ones((size, size)))
    np.testing.assert_array_equal(opened(mask, size), expected)


@pytest.mark.parametrize("size", [1, 3, 9, 17])
def test_counted(mask: Bools, size: int) -> None:
    """The sum over the window, with nothing beyond the border."""
    expected = ndimage.convolve(mask.astype(int), np.ones((size, size), int), mode="constant")
    np.testing.assert_array_equal(counted(mask, size), expected)


@pytest.mark.parametrize("least", [4, 5])
def test_crowded(mask: Bools, least: int) -> None:
    """A share of the nine pixels, the border's own repeated beyond it."""
    share = ndimage.uniform_filter(mask.astype(np.float32), 3, mode="nearest")
    np.testing.assert_array_equal(crowded(mask, least), share > (least - 0.5) / 9)
