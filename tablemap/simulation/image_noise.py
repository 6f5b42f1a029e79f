"""Noise that neighbouring pixels share, and single bad pixels."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from tablemap.geometry import Bools, Floats
from tablemap.simulation.lens import Lens


def window_noise(lens: Lens, rng: np.random.Generator) -> Floats:
    """Return (n, 2) of unit noise that neighbouring pixels share, as matching windows do."""
    white = rng.standard_normal((2, lens.height, lens.width), dtype=np.float32)
    smooth = ndimage.uniform_filter(white, size=(1, 3, 3), mode="wrap") * 3.0
    return np.asarray(smooth.reshape(2, -1).T, dtype=np.float64)


def blobs(lens: Lens, rng: np.random.Generator) -> Floats:
    """Return a patchy (n,) field, uniform in 0 to 1, of patches about 40 pixels wide."""
    rows, columns = max(lens.height // 8, 2), max(lens.width // 8, 2)
    field = ndimage.gaussian_filter(rng.standard_normal((rows, columns)), 2.5, mode="wrap")
    order = np.empty(field.size)
    order[np.argsort(field, axis=None)] = (np.arange(field.size) + 0.5) / field.size
    v = lens.pixels[:, 1] / lens.height * (rows - 1)
    u = lens.pixels[:, 0] / lens.width * (columns - 1)
    return np.asarray(ndimage.map_coordinates(order.reshape(field.shape), [v, u], order=1))


def with_bad_pixels(
    lens: Lens, depth: Floats, missing: Bools, rng: np.random.Generator
) -> tuple[Floats, Bools]:
    """Return depths (n,) as the driver smooths them, with single wrong and single lost pixels."""
    settings = lens.settings
    if settings.smoothing_px > 1:
        depth = _smoothed(lens, depth, missing, settings.smoothing_px)
    if settings.specks:
        wrong = rng.random(len(depth)) < settings.specks
        depth = np.where(wrong, rng.uniform(*_SPECKS_M, len(depth)), depth)
        missing = missing & ~wrong
    if settings.salt:
        missing = missing | (rng.random(len(depth)) < settings.salt)
    return depth, missing


_SPECKS_M = (0.3, 6.0)


def _smoothed(lens: Lens, depth: Floats, missing: Bools, width_px: int) -> Floats:
    """Return the mean of the measured depths in a window round each pixel."""
    shape = lens.height, lens.width
    known = (~missing).astype(np.float64).reshape(shape)
    total = ndimage.uniform_filter(np.where(missing, 0.0, depth).reshape(shape), width_px)
    share = np.maximum(ndimage.uniform_filter(known, width_px), 1e-6)
    return np.where(missing, depth, (total / share).ravel())
