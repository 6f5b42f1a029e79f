"""The depth that a camera sends where it measured nothing, learnt from its own images.

ROS asks for zero or NaN there (REP 118). Some drivers fill in the end of their range instead: 4.095
m of twelve bits, or the nearest distance. Taken as a wall it hides what lies behind, and taken as a
thing it hides the table. No wall is as far to the last digit in images from all over the drive,
with nothing just before it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_FEWEST_IMAGES = 3
_LEAST_SHARE = 0.002  # of an image's pixels that measured something or have the number
_ALONE = 0.1  # what comes next within `_NEXT` of the number is less than this share of its pixels
_NEXT = 0.03
_SAME = 1e-5  # a share: decoders round


def filler_of(depths: Sequence[NDArray[np.float32]]) -> tuple[float, float] | None:
    """Return the number in metres that stands for nothing measured, and its share of the pixels.

    ``depths`` are images (height, width) as decoded. Returns None if there is no such number.
    """
    if len(depths) < _FEWEST_IMAGES:
        return None
    known = [depth[np.isfinite(depth)] for depth in depths]
    if any(values.size == 0 for values in known):
        return None
    for end in (np.max, np.min):
        number = float(end(known[0]))
        shares = [_share(values, number) for values in known]
        if min(shares) >= _LEAST_SHARE and all(_is_alone(values, number) for values in known):
            return number, float(np.mean(shares))
    return None


def removed(depth: NDArray[np.float32], number: float | None) -> NDArray[np.float32]:
    """Return an image with NaN where it has the number that stands for nothing."""
    if number is None:
        return depth
    return np.where(_is(depth, number), np.float32(np.nan), depth)


def _is(values: NDArray[np.float32], number: float) -> NDArray[np.bool_]:
    return np.asarray(np.abs(values - np.float32(number)) <= _SAME * number)


def _share(values: NDArray[np.float32], number: float) -> float:
    return float(np.mean(_is(values, number)))


def _is_alone(values: NDArray[np.float32], number: float) -> bool:
    same = _is(values, number)
    beside = ~same & (np.abs(values - np.float32(number)) < _NEXT * number)
    return bool(np.count_nonzero(beside) < _ALONE * np.count_nonzero(same))
