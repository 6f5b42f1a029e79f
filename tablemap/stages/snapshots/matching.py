"""The width of the window in which a depth camera compares its images, as the noise shows it.

A camera that triangulates compares a window round each pixel. Pixels whose windows overlap share
a part of their noise, in proportion to the overlap: along a row, the correlation of the noise falls
in a straight line, to 0 at the width of the window. An edge of depth lies anywhere within about
half of a window from the true one, as the brighter side of it wins (Okutomi and Kanade, "A
Locally Adaptive Window for Signal Matching", IJCV 1992), and a crease is rounded over a window.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats

_ROWS, _COLUMNS = 12, 96  # of a block, pixels
_NEAREST, _FARTHEST = 0.8, 3.0  # metres
_MOST_RESIDUAL = 0.02  # share of the distance: more is no single surface
_MOST_BLOCKS, _FEWEST_BLOCKS = 96, 8
_LAGS = np.arange(1, 25)
_WIDEST = 24
_LEAST_SHARE = 0.3  # of the noise: less is no window, and other noise hides it


def matching_window(depths: Sequence[NDArray[np.float32]]) -> float:
    """Return the width of the matching window in pixels by single images (height, width), metres.

    0 where the noise of neighbouring pixels is independent, or too few surfaces were seen.
    """
    blocks = [block for depth in depths for block in _blocks(depth)]
    if len(blocks) < _FEWEST_BLOCKS:
        return 0.0
    chosen = np.unique(np.linspace(0, len(blocks) - 1, _MOST_BLOCKS).astype(np.int64))
    seen = np.median([_correlation(blocks[k]) for k in chosen], axis=0)
    expected = _expected()
    shares = expected @ seen / np.einsum("ij,ij->i", expected, expected)
    misfits = np.sum((seen - shares[:, None] * expected) ** 2, axis=1)
    best = int(np.argmin(misfits))
    return float(best + 2) if shares[best] > _LEAST_SHARE else 0.0


def _blocks(depth: NDArray[np.float32]) -> Iterator[Floats]:
    """Yield the noise (rows, columns) of the inverse depth in blocks that show one surface."""
    down, across = depth.shape[0] // _ROWS, depth.shape[1] // _COLUMNS
    cut = depth[: down * _ROWS, : across * _COLUMNS]
    tiles = cut.reshape(down, _ROWS, across, _COLUMNS).swapaxes(1, 2)
    blocks = tiles.reshape(-1, _ROWS, _COLUMNS)
    whole = ((blocks > _NEAREST) & (blocks < _FARTHEST)).all(axis=(1, 2))  # NaN compares false
    for block in blocks[whole]:
        inverse = 1.0 / block.astype(np.float64)
        noise = inverse - inverse @ _trend()
        if 0 < noise.std() < _MOST_RESIDUAL * inverse.mean():
            yield noise


@cache
def _trend() -> Floats:
    """Return the matrix (columns, columns) that maps a row to its own parabola."""
    along = np.linspace(-1.0, 1.0, _COLUMNS)
    basis, _ = np.linalg.qr(np.column_stack([np.ones(_COLUMNS), along, along**2]))
    trend: Floats = basis @ basis.T
    return trend


def _correlation(noise: Floats) -> Floats:
    """Return the correlation (lags,) along the rows, at each of `_LAGS`."""
    products = [np.mean(noise[:, lag:] * noise[:, :-lag]) for lag in _LAGS]
    correlation: Floats = np.array(products) / np.mean(noise**2)
    return correlation


@cache
def _expected() -> Floats:
    """Return the correlations (windows, lags) of noise by windows of 2, 3, ... pixels.

    Taking a parabola from each row lowers them.
    """
    apart = np.abs(np.subtract.outer(np.arange(_COLUMNS), np.arange(_COLUMNS)))
    left = np.eye(_COLUMNS) - _trend()
    rows = []
    for window in range(2, _WIDEST + 1):
        shared = left @ np.maximum(1.0 - apart / window, 0.0) @ left
        rows.append([np.diagonal(shared, lag).mean() for lag in _LAGS])
        rows[-1] = [value / np.diagonal(shared).mean() for value in rows[-1]]
    return np.array(rows)
