"""Single bad pixels of a depth image are mended; depth steps and larger holes stay."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tablemap.stages.snapshots import mending
from tablemap.stages.snapshots.noise import depth_noise

Depth = NDArray[np.float32]
EDGE = 160  # column of the depth step
NOISE_M = 0.002
LOOKED_AT = slice(85, 140), slice(45, 115)


def mended(depth: Depth) -> Depth:
    """Mend an image by its own noise."""
    return mending.mended(depth, depth_noise(depth))


def scene(*, seed: int = 0) -> tuple[Depth, Depth]:
    """Return a noisy image of a sloping top, 0.3 m before a sloping floor, and the truth."""
    rows, columns = np.mgrid[0:240, 0:320]
    top = 1 / (0.9 + 0.002 * (rows - 120) + 0.0005 * (columns - 160))
    true = np.where(columns < EDGE, top, top + 0.3).astype(np.float32)
    noise = NOISE_M * np.random.default_rng(seed).normal(size=true.shape)
    return (true + noise).astype(np.float32), true


@pytest.mark.parametrize("share", [0.05, 0.2, 0.3])
def test_lost_single_pixels_are_filled_from_the_surface(share: float) -> None:
    """Nearly all come back, as exact as measured ones, and nothing else changes."""
    depth, true = scene()
    lost = np.random.default_rng(1).random(depth.shape) < share
    result = mended(np.where(lost, np.float32(np.nan), depth))
    assert np.isfinite(result[lost]).mean() > 0.9
    assert np.nanmax(np.abs(result - true)[lost]) < 4 * NOISE_M
    assert np.array_equal(result[~lost], depth[~lost])


def test_no_pixel_is_filled_from_beyond_a_depth_step() -> None:
    """Where half of the pixels beside a step are lost, none takes a depth between both sides."""
    depth, true = scene()
    rng = np.random.default_rng(2)
    lost = (rng.random(depth.shape) < 0.5) & (np.abs(np.arange(320) - EDGE) < 3)
    result = mended(np.where(lost, np.float32(np.nan), depth))
    assert np.nanmax(np.abs(result - true)) < 5 * NOISE_M


def with_salt(depth: Depth) -> Depth:
    """Lose single pixels all over the image, most of them below, but for where tests look."""
    salted = depth.copy()
    salted[210::3, ::7] = np.nan
    salted[2:210:9, 4::9] = np.nan
    salted[LOOKED_AT] = depth[LOOKED_AT]
    return salted


def test_a_line_of_lost_pixels_along_a_step_stays_lost() -> None:
    """The sensor's shadow at an edge is no hole in a surface, however narrow."""
    depth, _ = scene()
    depth[:, EDGE] = np.nan
    result = mended(with_salt(depth))
    assert np.isnan(result[:, EDGE]).all()
    assert np.isfinite(result[210::3, 7:140:7]).all()


@pytest.mark.parametrize("across", [3, 4, 7, 20])
def test_larger_holes_keep_their_size(across: int) -> None:
    """A hole is what was not measured, and tells where depth is missing."""
    depth, _ = scene()
    depth[100 : 100 + across, 60 : 60 + across] = np.nan
    result = mended(with_salt(depth))
    assert np.array_equal(result[LOOKED_AT], depth[LOOKED_AT], equal_nan=True)


def test_wrong_single_pixels_take_the_depth_of_their_neighbours() -> None:
    """One in a hundred with any depth: hardly any is left, and no good pixel is lost for them."""
    depth, true = scene()
    rng = np.random.default_rng(3)
    wrong = rng.random(depth.shape) < 0.01
    result = mended(np.where(wrong, rng.uniform(0.3, 6.0, depth.shape), depth).astype(np.float32))
    assert np.mean(~(np.abs(result - true)[wrong] < 0.05)) < 0.05
    assert np.array_equal(result[~wrong], depth[~wrong])


def test_thin_things_are_no_outliers() -> None:
    """A bar of one pixel's width before a floor stays, but for its two ends."""
    depth, _ = scene()
    depth[40:200, 60] -= 0.2
    result = mended(with_salt(depth))
    assert np.array_equal(result[41:199, 60], depth[41:199, 60])


def test_an_image_with_hardly_any_bad_pixel_stays_as_it_is() -> None:
    """To the last bit, noise and steps included."""
    depth, _ = scene()
    depth[50:200:10, 50] = np.nan
    depth[50:200:10, 80] = 3.0
    assert np.array_equal(mended(depth), depth, equal_nan=True)
    depth, _ = scene()
    coarse = (np.round(depth / 0.02) * 0.02).astype(np.float32)
    assert np.array_equal(mended(coarse), coarse)


def test_pixels_that_are_lost_in_places_stay_lost() -> None:
    """At a glance and far away most are lost: what is filled there would end within the top."""
    depth, _ = scene()
    rng = np.random.default_rng(4)
    depth[:80][rng.random((80, 320)) < np.linspace(0.6, 0.0, 80)[:, None]] = np.nan
    assert np.array_equal(mended(depth), depth, equal_nan=True)


def test_what_was_mended_is_known() -> None:
    """The pixels that came back, and the wrong ones; an image left as it was has none."""
    depth, _ = scene()
    lost = np.random.default_rng(1).random(depth.shape) < 0.2
    recorded = np.where(lost, np.float32(np.nan), depth)
    result = mended(recorded)
    marked = mending.changed(recorded, result)
    assert marked is not None
    assert np.array_equal(marked, lost & np.isfinite(result))
    assert mending.changed(depth, mended(depth)) is None
