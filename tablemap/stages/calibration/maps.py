"""The residuals of floor and top over the camera's image, as a review shows them."""

from __future__ import annotations

import numpy as np

from tablemap.geometry import Bools, Floats
from tablemap.stages.calibration.levels import LevelSamples
from tablemap.stages.calibration.result import LevelResiduals

_MAP_SHAPE = (12, 16)  # blocks of the image in which residuals are shown
_SHOWN_M = 0.03  # metres: farther off is another surface
_LEAST_BLOCK = 5  # samples


def residual_maps(
    samples: LevelSamples, first: Floats, last: Floats, chosen: Bools
) -> LevelResiduals | None:
    """Average the residuals of all views in blocks of the image; None if nothing is to be shown.

    ``first`` and ``last`` (n,), metres, are the samples' residuals before and after the adjustment,
    and ``chosen`` (n,) are those of one surface.
    """
    near = chosen & (np.abs(last) < _SHOWN_M)
    if not near.any():
        return None
    rows, columns = _MAP_SHAPE
    u, v = samples.terms[1][near], samples.terms[2][near]
    block = np.clip(((v + 1) / 2 * rows).astype(np.int64), 0, rows - 1) * columns
    block += np.clip(((u + 1) / 2 * columns).astype(np.int64), 0, columns - 1)
    count = np.bincount(block, minlength=rows * columns).astype(np.float64)
    count[count < _LEAST_BLOCK] = np.nan

    def mean(values: Floats) -> Floats:
        total = np.bincount(block, weights=values[near], minlength=rows * columns)
        return (total / count).reshape(rows, columns)

    return LevelResiduals(before=mean(first), after=mean(last))
