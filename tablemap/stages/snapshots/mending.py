"""Single bad pixels of a depth image: outliers are taken out, and missing ones filled."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Bools, Floats, Ints
from tablemap.masks import counted, grown
from tablemap.robust import medians
from tablemap.stages.snapshots.noise import DepthNoise

_Pixel = TypeVar("_Pixel", bound=np.generic)

_REACH_PX = 2
_HALF = [(0, 1), (1, -1), (1, 0), (1, 1), (0, 2), (1, -2), (1, 2)] + [
    (2, step) for step in range(-2, 3)
]
_STEPS = np.array(_HALF + [(-down, -right) for down, right in _HALF])  # (24, 2): row, column
_PAIRS = len(_HALF)
_TOUCHING = np.abs(_STEPS).max(axis=1) == 1

_PART_PX, _FEW = 32, 0.2  # parts of the image, and the share of them that may have fewer
_LEAST_SHARE = 0.005  # of a part's pixels; fewer do no harm
_LEAST_PAIRS = 6  # of twelve; the corner of a larger hole has four, its straight border two
_LEAST_TOUCHING = 3  # of eight; the middle of a hole of three by three has none
_PASSES = 3  # a pixel with few measured neighbours is filled once these are
_MOST_SHARE = 0.02  # of the depth: what differs by less from its neighbours is noise
_SIGMAS = 4.0
_LEAST_AGREE = 0.8  # share of the neighbours that lie on one plane
_BLOCK = 20_000  # pixels at once


def mended(depth: NDArray[np.float32], noise: DepthNoise) -> NDArray[np.float32]:
    """Return a depth image (height, width), metres, NaN missing, without single bad pixels.

    ``noise`` is that of the image. One that is left as it was recorded comes back itself.

    A pixel is an outlier if nearly all of its neighbours lie on one plane and it does not: it
    counts as missing. A missing pixel is filled if its neighbours surround it and lie on one plane.
    So a hole of three or more pixels across stays as it is, and so does every pixel at a depth
    step. An image whose bad pixels are few, or in places, stays as it was recorded. The inverse
    depth of a plane is linear in the image, and is what is compared.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = (1 / depth).astype(np.float32)
    padded = np.pad(inverse, _REACH_PX, constant_values=np.nan)
    mended_inverse = padded[_REACH_PX:-_REACH_PX, _REACH_PX:-_REACH_PX]
    suspects = _suspects(padded)
    # Of most images, few pixels can be bad at all: then no plane needs to be fitted.
    if _usual_share(depth, suspects | _is_touched(mended_inverse)) < _LEAST_SHARE:
        return depth
    outliers = _outliers(padded, suspects, noise)
    mended_inverse[outliers] = np.nan
    near = np.ones(depth.shape, dtype=bool)
    for done in range(_PASSES):
        rows, columns, values = _fillings(padded, near, noise)
        if done == 0:
            bad = np.zeros(depth.shape, dtype=bool)
            bad[rows, columns] = True
            if _usual_share(depth, bad) < _LEAST_SHARE:
                return depth
        mended_inverse[rows, columns] = values
        # Only what is filled changes what is said of pixels near it.
        near[:] = False
        near[rows, columns] = True
        near = grown(near, 2 * _REACH_PX + 1)
    result = depth.copy()
    changed = np.isfinite(mended_inverse) != np.isfinite(depth)
    changed[outliers] = True
    result[changed] = 1 / mended_inverse[changed]
    return result


def changed(recorded: NDArray[np.float32], depth: NDArray[np.float32]) -> Bools | None:
    """Return which pixels (height, width) of a recorded image `mended` changed; None for none."""
    if depth is recorded:
        return None
    is_other: Bools = (depth != recorded) & (np.isfinite(depth) | np.isfinite(recorded))
    return is_other


def _usual_share(depth: NDArray[np.float32], bad: Bools) -> float:
    """Return the share of ``bad`` pixels (height, width) that all but a few parts of an image have.

    A driver or low light loses pixels all over the image; at a glance, pixels are lost in places,
    and the more the farther: there, the end of what was filled would look like an end of the top.
    """
    told = _in_parts(np.isfinite(depth)) > _PART_PX**2 // 2
    return float(np.quantile(_in_parts(bad)[told], _FEW) / _PART_PX**2) if told.any() else 0.0


def _in_parts(pixels: Bools) -> Ints:
    """Count the pixels of a mask (height, width) in each part of the image."""
    height, width = pixels.shape
    by_row = np.add.reduceat(pixels, np.arange(0, height, _PART_PX), axis=0, dtype=np.int64)
    parts: Ints = np.add.reduceat(by_row, np.arange(0, width, _PART_PX), axis=1)
    return parts


def _suspects(padded: NDArray[np.float32]) -> Bools:
    """Return which measured pixels (height, width) lie between no two opposite neighbours."""
    middle = padded[_REACH_PX:-_REACH_PX, _REACH_PX:-_REACH_PX]
    suspect: Bools = np.isfinite(middle)
    least = np.float32(_MOST_SHARE) * middle
    with np.errstate(invalid="ignore"):
        for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
            # A pixel between both neighbours of a pair is none; a missing one tells nothing.
            one = _shifted(padded, down, right) - middle
            other = _shifted(padded, -down, -right) - middle
            suspect &= ~(np.abs(one + other) < 2 * least)
    return suspect


def _outliers(padded: NDArray[np.float32], suspects: Bools, noise: DepthNoise) -> tuple[Ints, Ints]:
    """Return the rows and columns of the suspects that differ from all round them."""
    middle = padded[_REACH_PX:-_REACH_PX, _REACH_PX:-_REACH_PX]
    rows, columns = np.nonzero(suspects)
    found = np.zeros(len(rows), dtype=bool)
    for block in _blocks(len(rows)):
        at, own = (rows[block], columns[block]), middle[rows[block], columns[block]]
        plane, agree = _planes(_around(padded, *at), noise)
        off = np.abs(own - plane) > np.maximum(_MOST_SHARE * plane, 2 * _allowance(plane, noise))
        found[block] = agree & off
    return rows[found], columns[found]


def _fillings(
    padded: NDArray[np.float32], near: Bools, noise: DepthNoise
) -> tuple[Ints, Ints, NDArray[np.float32]]:
    """Return the rows, columns and inverse depths of missing pixels that are surrounded.

    ``near`` is a mask (height, width) of those that are looked at.
    """
    rows, columns = np.nonzero(
        near & _is_touched(padded[_REACH_PX:-_REACH_PX, _REACH_PX:-_REACH_PX])
    )
    values = np.full(len(rows), np.nan, dtype=np.float32)
    for block in _blocks(len(rows)):
        around = _around(padded, rows[block], columns[block])
        held = np.isfinite(around)
        pairs = (held[:, :_PAIRS] & held[:, _PAIRS:]).sum(axis=1)
        surrounded = np.flatnonzero(pairs >= _LEAST_PAIRS)
        plane, agree = _planes(around[surrounded], noise)
        values[block][surrounded] = np.where(agree, plane, np.nan)
    good = np.isfinite(values)
    return rows[good], columns[good], values[good]


def _is_touched(image: NDArray[np.float32]) -> Bools:
    """Return which pixels (height, width) are missing, with enough measured ones beside them."""
    known = np.isfinite(image)
    touched: Bools = ~known & (counted(known, 3) >= _LEAST_TOUCHING)
    return touched


def _planes(around: Floats, noise: DepthNoise) -> tuple[Floats, Bools]:
    """Fit a plane to inverse depths (n, 24) round each pixel.

    Returns the plane's inverse depth at the pixels (n,), and whether the neighbours agree on it.
    """
    known = np.isfinite(around)
    values = np.where(known, around, 0.0)
    pair = known[:, :_PAIRS] & known[:, _PAIRS:]
    # Each pair's mean is the plane's value; the median of the means bears outliers.
    means = np.where(pair, (values[:, :_PAIRS] + values[:, _PAIRS:]) / 2, np.nan)
    middle = medians(means, pair.sum(axis=1))
    allowance = _allowance(middle, noise)
    used = known.copy()
    level, slope = _fitted(values, used)
    off = _off_plane(values, known, level, slope)
    for _ in range(3):
        worst = np.max(np.where(used, off, 0.0), axis=1)
        kept = known & (off <= np.maximum(allowance, worst / 2)[:, None])
        # Most pixels lie on a plane at once: only the others are fitted again.
        again = np.flatnonzero((kept != used).any(axis=1))
        used = kept
        level[again], slope[again] = _fitted(values[again], used[again])
        off[again] = _off_plane(values[again], known[again], level[again], slope[again])
    close = known & (off <= allowance[:, None])
    agree = close.sum(axis=1) >= _LEAST_AGREE * known.sum(axis=1)
    agree &= (close[:, :_PAIRS] & close[:, _PAIRS:]).sum(axis=1) >= _LEAST_PAIRS
    # A step beside the pixel puts three of its eight neighbours off.
    touching = (known & ~close)[:, _TOUCHING].sum(axis=1)
    agree &= (touching <= 1) & (np.abs(level - middle) <= allowance)
    return level, agree


def _off_plane(values: Floats, known: Bools, level: Floats, slope: Floats) -> Floats:
    """Return by how much the known values (n, 24) differ from planes."""
    return np.where(known, np.abs(values - level[:, None] - slope @ _STEPS.T), 0.0)


def _fitted(values: Floats, used: Bools) -> tuple[Floats, Floats]:
    """Return level (n,) and slope (n, 2) of the least-squares planes through the used values."""
    design = np.column_stack([np.ones(len(_STEPS)), _STEPS])
    products = (design[:, :, None] * design[:, None, :]).reshape(len(_STEPS), 9)
    normal = (used @ products).reshape(-1, 3, 3) + 1e-9 * np.eye(3)
    right = np.where(used, values, 0.0) @ design
    solved = np.linalg.solve(normal, right[..., None])[..., 0]
    return solved[:, 0], solved[:, 1:]


def _allowance(inverse: Floats, noise: DepthNoise) -> Floats:
    """Return by how much inverse depths may differ from their neighbours' plane."""
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (1 / np.maximum(inverse, 1e-3)).astype(np.float32)
    sigma = noise.sigma(depth).astype(np.float64) * inverse**2
    allowed: Floats = np.minimum(_SIGMAS * sigma, _MOST_SHARE * inverse)
    return allowed


def _around(padded: NDArray[np.float32], rows: Ints, columns: Ints) -> Floats:
    """Return the values (n, 24) of the neighbours in the order of `_STEPS`."""
    at = _STEPS + _REACH_PX
    values = padded[rows[:, None] + at[:, 0], columns[:, None] + at[:, 1]]
    return np.asarray(values, dtype=np.float64)


def _shifted(padded: NDArray[_Pixel], down: int, right: int) -> NDArray[_Pixel]:
    """Return the image whose pixels are the neighbours ``down`` rows and ``right`` columns on."""
    rows, columns = padded.shape
    first, left = _REACH_PX + down, _REACH_PX + right
    return padded[first : first + rows - 2 * _REACH_PX, left : left + columns - 2 * _REACH_PX]


def _blocks(count: int) -> Iterator[slice]:
    return (slice(first, first + _BLOCK) for first in range(0, count, _BLOCK))
