"""Combination of several depth images of one stop into one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def combine(images: Sequence[NDArray[np.float32]]) -> NDArray[np.float32]:
    """Combine (height, width) depth images in metres, NaN missing, into one.

    A pixel is kept if most images have a value there and the middle half of the values agree. Mixed
    pixels and flicker at depth edges fail this test. The pixel's value is the mean of the values
    close to the median, which is finer than the sensor's depth steps. If the images are evenly
    split, over whether there is a value or over which, the first image decides: a single image
    shows depth edges at their true place. The union or the intersection of two images would move
    each edge by a third of a pixel.
    """
    if len(images) == 1:
        return images[0].astype(np.float32)
    stack = np.stack(images).astype(np.float32)
    stack[~np.isfinite(stack)] = np.inf
    ordered = np.sort(stack, axis=0)
    valid = np.isfinite(ordered).sum(axis=0)
    enough = 2 * valid > len(images)

    def quantile(numerator: int) -> NDArray[np.float32]:
        # Ranks are rounded outward on both sides, so that one outlier does not decide.
        last = valid - 1
        rank = last * numerator // 4 if numerator <= 2 else last - last * (4 - numerator) // 4
        rank = np.clip(rank, 0, None)
        picked: NDArray[np.float32] = np.take_along_axis(ordered, rank[None], axis=0)[0]
        return picked

    median = np.where(enough, quantile(2), np.float32(np.nan))
    lower, upper = np.where(enough, quantile(1), 0), np.where(enough, quantile(3), 0)
    gate = np.float32(0.01) + np.float32(0.03) * median
    with np.errstate(invalid="ignore"):
        close = np.abs(ordered - median) <= gate
        steady = enough & (upper - lower <= gate)
    number = close.sum(axis=0)
    total = np.where(close, ordered, 0).sum(axis=0, dtype=np.float64)
    combined = np.full(median.shape, np.nan, dtype=np.float32)
    kept = steady & (number > 0)
    combined[kept] = total[kept] / number[kept]
    split = 2 * valid == len(images)
    if len(images) == 2:
        split |= enough & ~steady
    combined[split] = np.where(np.isfinite(stack[0]), stack[0], np.nan)[split]
    return combined
