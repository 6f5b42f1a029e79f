"""Normals of the surfaces in an organised image, without a search for neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from tablemap.masks import counted


def upward_share(points: NDArray[np.float32], half_window_px: int) -> NDArray[np.float32]:
    """Return (height, width) |n_z| of the surface normals of (height, width, 3) points.

    The points are averaged over a window, without missing ones, and the normal is computed from
    neighbouring windows: this is robust to noise and coarse depth steps. The result is NaN where
    too little of the window was measured; close to depth edges it is unreliable.
    """
    size = 2 * half_window_px + 1
    missing = ~np.isfinite(points[..., 2])
    weight = counted(~missing, size).astype(np.float32) / np.float32(size**2)
    weight[weight < 0.3] = np.nan
    # Each coordinate is an image of its own: arithmetic on these is several times as fast.
    along_u, along_v = [], []
    for axis in range(3):
        filled = np.where(missing, np.float32(0), points[..., axis])
        mean = ndimage.uniform_filter(filled, size, mode="constant")
        mean /= weight
        along_u.append(_across(mean, half_window_px))
        along_v.append(_across(mean.T, half_window_px).T)
    x = along_u[1] * along_v[2] - along_u[2] * along_v[1]
    y = along_u[2] * along_v[0] - along_u[0] * along_v[2]
    z = along_u[0] * along_v[1] - along_u[1] * along_v[0]
    with np.errstate(invalid="ignore", divide="ignore"):
        share: NDArray[np.float32] = np.abs(z) / np.sqrt(x * x + y * y + z * z)
    return share


def _across(image: NDArray[np.float32], step: int) -> NDArray[np.float32]:
    """Return the differences of pixels ``step`` to the right and to the left, NaN at the border."""
    apart = np.full_like(image, np.nan)
    np.subtract(image[:, 2 * step :], image[:, : -2 * step], out=apart[:, step:-step])
    return apart
