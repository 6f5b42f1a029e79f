"""Lines through windows of a scan, all windows at once."""

from __future__ import annotations

import numpy as np

from tablemap.geometry import Floats, Ints


def fit_windows(points: Floats, first: Ints, last: Ints) -> tuple[Floats, Floats, Floats]:
    """Fit a line to each window ``points[first[i]:last[i]]`` of (n, 2) finite points.

    Returns unit normals (m, 2) of either sign, and the points' variances along and across the
    lines, (m,) square metres each. Windows may overlap: running sums give all moments.
    """
    x, y = (points - points.mean(axis=0)).T
    terms = np.stack([x, y, x * x, y * y, x * y])
    sums = np.concatenate([np.zeros((5, 1)), np.cumsum(terms, axis=1)], axis=1)
    mx, my, xx, yy, xy = (sums[:, last] - sums[:, first]) / np.maximum(last - first, 1)
    xx, yy, xy = xx - mx * mx, yy - my * my, xy - mx * my
    tangent = 0.5 * np.arctan2(2 * xy, xx - yy)
    normals = np.stack([-np.sin(tangent), np.cos(tangent)], axis=1)
    trace, root = xx + yy, np.hypot(xx - yy, 2 * xy)
    return normals, np.maximum(trace + root, 0.0) / 2, np.maximum(trace - root, 0.0) / 2
