"""Robust statistics: a few wrong values hardly move them.

Weights are those of iteratively reweighted least squares; see Z. Zhang, Parameter Estimation
Techniques: A Tutorial with Application to Conic Fitting (1997), table 1.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats, Ints

Real = TypeVar("Real", bound=np.floating)

MAD_TO_SIGMA = 1.4826
"""A normal distribution's standard deviation, in median absolute deviations."""

TUKEY_CUTOFF = 4.685
"""Sigmas at which Tukey's weight ends, for 95 % efficiency on a normal distribution."""

_CHI_SQUARE_MEDIAN = 0.455  # of one degree of freedom


def mad_sigma(deviations: NDArray[np.floating]) -> float:
    """Return the standard deviation that fits the median of (n,) absolute deviations.

    The deviations are those from a fit, or from a median.
    """
    return float(MAD_TO_SIGMA * np.median(np.abs(deviations)))


def medians(rows: NDArray[Real], counts: Ints) -> NDArray[Real]:
    """Return the medians (n,) of rows (n, k) with so many values (n,), the rest NaN; 1 of none."""
    ordered = np.sort(rows, axis=1)  # NaN comes last
    ordered[counts == 0] = 1.0
    most, row = np.maximum(counts, 1), np.arange(len(counts))
    middle: NDArray[Real] = (ordered[row, (most - 1) // 2] + ordered[row, most // 2]) / 2
    return middle


def geman_mcclure(squared: Floats, weight: Floats | float = 1.0) -> Floats:
    """Return (n,) weights for residuals whose squares over the kernel's are given.

    A residual as large as the kernel's scale keeps a quarter of its ``weight``.
    """
    weights: Floats = weight / (1 + squared) ** 2
    return weights


def kernel_weight(residuals: Floats, kernel: float) -> Floats:
    """Return (n,) weights of Geman-McClure for residuals, with the scale ``kernel`` of the loss."""
    weights: Floats = np.square(kernel**2 / (kernel**2 + residuals**2))
    return weights


def tukey(ratio: Floats) -> Floats:
    """Return (n,) Tukey's weights for residuals over the cut-off: 0 from the cut-off on."""
    weights: Floats = np.square(np.clip(1 - np.square(ratio), 0, None))
    return weights


def reduced_chi_square(squared: Floats) -> float:
    """Return the factor on the variances that fits the residuals, from their median.

    ``squared`` (n,) are residuals over their sigmas, squared.
    """
    return float(np.median(squared)) / _CHI_SQUARE_MEDIAN
