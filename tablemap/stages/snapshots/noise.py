"""The noise and quantisation of a depth image, estimated from the image itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablemap.robust import mad_sigma

ROW_STRIDE_PX = 5
LAG_PX = 4  # structured light correlates neighbouring pixels; at this distance hardly any more
SLAB_M = 0.25
BIN_M = 0.0005
LEAST_SAMPLES = 200
COARSE_SHARE = 0.015
LEAST_SIGMA_M = 0.0005


@dataclass(frozen=True, eq=False)
class DepthNoise:
    """The noise of one depth image, by slabs of ``SLAB_M`` metres of depth.

    - ``sigmas``: (slabs,) standard deviation of a depth in each slab, metres
    - ``coarse_step``: step between depth values, metres, if it is coarse, else 0; steps of a
      disparity, up to a percent of the range, are not coarse: their rounding errors average out
    - ``steps``: (slabs,) the step between the depth values of each slab, metres, 0 where it is fine
    """

    sigmas: NDArray[np.float32]
    coarse_step: float
    steps: NDArray[np.float32]

    def sigma(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the standard deviation (...) of depths (...) of the image, NaN where missing."""
        per_pixel: NDArray[np.float32] = self.sigmas.take(_slabs(depth), mode="clip")
        per_pixel[~np.isfinite(depth)] = np.nan
        return per_pixel

    def step(self, depth: float) -> float:
        """Return the step between depth values at a depth, metres."""
        return float(self.steps[min(int(depth / SLAB_M), len(self.steps) - 1)])


def depth_noise(depth: NDArray[np.float32]) -> DepthNoise:
    """Measure the noise of a depth image (height, width), metres, NaN where missing.

    Each slab of range has two terms: the spread of second differences along the rows (they are zero
    on a plane), and the step between the depth values that occur, as a uniform error of that
    width. A slab with too few pixels gets the noise of a structured-light camera.
    """
    slab = _slabs(depth)
    count = int(slab.max()) + 1 if slab.size else 1
    centres = ((np.arange(count) + 0.5) * SLAB_M).astype(np.float32)
    sigmas = _axial_noise(centres)
    steps = value_steps(depth, count)
    if depth.shape[1] > 2 * LAG_PX:
        rows = depth[::ROW_STRIDE_PX]
        middle = rows[:, LAG_PX:-LAG_PX]
        bend = np.abs(rows[:, : -2 * LAG_PX] - 2 * middle + rows[:, 2 * LAG_PX :])
        smooth = bend < 0.05 * middle  # NaN compares false
        bends, slabs = bend[smooth], slab[::ROW_STRIDE_PX, LAG_PX:-LAG_PX][smooth]
        order = np.argsort(slabs, kind="stable")
        bounds = np.searchsorted(slabs[order], np.arange(count + 1))
        for k in range(count):
            if bounds[k + 1] - bounds[k] >= LEAST_SAMPLES:
                spread = mad_sigma(bends[order[bounds[k] : bounds[k + 1]]])
                sigmas[k] = spread / np.sqrt(6)
    sigmas = np.sqrt(sigmas**2 + steps**2 / 12 + LEAST_SIGMA_M**2)
    pixels = np.bincount(slab.ravel(), minlength=count)
    pixels[0] -= np.count_nonzero(np.isnan(depth))
    return DepthNoise(sigmas, _coarse_step(steps, pixels), steps)


def _axial_noise(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the axial noise in metres of a structured-light camera (Nguyen 2012, frontal)."""
    return (0.0012 + 0.0019 * (depth - 0.4) ** 2).astype(np.float32)


def _slabs(depth: NDArray[np.float32]) -> NDArray[np.int32]:
    """Return the slab of each depth, 0 where it is missing."""
    return np.where(np.isfinite(depth), depth / SLAB_M, 0).astype(np.int32)


def _coarse_step(steps: NDArray[np.float32], pixels: NDArray[np.integer]) -> float:
    """Return the step of the slab that holds the middle pixel, ordered by relative steps."""
    if not pixels.any():
        return 0.0
    relative = steps / ((np.arange(len(steps)) + 0.5) * SLAB_M)
    order = np.argsort(relative)
    half = int(np.searchsorted(np.cumsum(pixels[order]), pixels.sum() / 2))
    middle = order[min(half, len(order) - 1)]
    return float(steps[middle]) if relative[middle] > COARSE_SHARE else 0.0


def value_steps(depth: NDArray[np.float32], slabs: int) -> NDArray[np.float32]:
    """Return the steps (slabs,) between occurring depth values, metres, 0 where they are dense."""
    steps = np.zeros(slabs, dtype=np.float32)
    thin = depth[::2, ::2]
    valid = thin[np.isfinite(thin)]
    if valid.size == 0:
        return steps
    counts = np.bincount((valid / BIN_M).astype(np.int64))
    occupied = np.flatnonzero(counts >= max(3, valid.size // 50_000))
    values = occupied * BIN_M
    for k in range(slabs):
        # A slab's neighbours count too: coarse steps leave few values in one slab.
        near = values[(values >= (k - 1) * SLAB_M) & (values < (k + 2) * SLAB_M)]
        pixels = counts[occupied[(values >= k * SLAB_M) & (values < (k + 1) * SLAB_M)]].sum()
        if len(near) >= 4 and pixels >= LEAST_SAMPLES:
            step = float(np.median(np.diff(near)))
            steps[k] = step if step > 2 * BIN_M else 0.0
    return steps
