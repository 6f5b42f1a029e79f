"""Normals of the surfaces in an organised image, without a search for neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage


def upward_share(points: NDArray[np.float32], half_window_px: int) -> NDArray[np.float32]:
    """Return (height, width) |n_z| of the surface normals of (height, width, 3) points.

    The points are averaged over a window, without missing ones, and the normal is computed from
    neighbouring windows: this is robust to noise and coarse depth steps. The result is NaN where
    too little of the window was measured; close to depth edges it is unreliable.
    """
    size = 2 * half_window_px + 1
    missing = ~np.isfinite(points[..., 2])
    weight = ndimage.uniform_filter((~missing).astype(np.float32), size, mode="constant")
    filled = np.where(missing[..., None], np.float32(0), points)
    mean = np.empty_like(filled)
    for axis in range(3):
        mean[..., axis] = ndimage.uniform_filter(filled[..., axis], size, mode="constant")
    with np.errstate(invalid="ignore", divide="ignore"):
        mean /= weight[..., None]
    mean[weight < 0.3] = np.nan
    step = half_window_px
    along_v = np.full_like(mean, np.nan)
    along_u = np.full_like(mean, np.nan)
    along_v[step:-step] = mean[2 * step :] - mean[: -2 * step]
    along_u[:, step:-step] = mean[:, 2 * step :] - mean[:, : -2 * step]
    x = along_u[..., 1] * along_v[..., 2] - along_u[..., 2] * along_v[..., 1]
    y = along_u[..., 2] * along_v[..., 0] - along_u[..., 0] * along_v[..., 2]
    z = along_u[..., 0] * along_v[..., 1] - along_u[..., 1] * along_v[..., 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        share: NDArray[np.float32] = np.abs(z) / np.sqrt(x * x + y * y + z * z)
    return share
