"""Combination of several depth images of one stop into one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

_BLOCK_BYTES = 512 * 1024  # of all images' rows at once: these stay in the processor's cache


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
    combined = np.empty(images[0].shape, dtype=np.float32)
    rows = max(1, _BLOCK_BYTES // max(4 * len(images) * combined[0].size, 1))
    for first in range(0, len(combined), rows):
        block = slice(first, first + rows)
        combined[block] = _combined([image[block] for image in images])
    return combined


def _combined(images: Sequence[NDArray[np.float32]]) -> NDArray[np.float32]:
    stack = np.stack(images).astype(np.float32)
    first = stack[0].copy()
    ordered = _sorted(np.where(np.isfinite(stack), stack, np.float32(np.inf)))
    valid = np.isfinite(ordered).sum(axis=0, dtype=np.int16)
    enough = 2 * valid > len(images)

    def quantile(numerator: int) -> NDArray[np.float32]:
        # Ranks are rounded outward on both sides, so that one outlier does not decide.
        last = valid - 1
        rank = last * numerator // 4 if numerator <= 2 else last - last * (4 - numerator) // 4
        picked: NDArray[np.float32] = ordered[0].copy()
        for place in range(1, len(ordered)):
            np.copyto(picked, ordered[place], where=rank == place)
        return picked

    median = np.where(enough, quantile(2), np.float32(np.nan))
    lower, upper = np.where(enough, quantile(1), 0), np.where(enough, quantile(3), 0)
    gate = np.float32(0.01) + np.float32(0.03) * median
    number, total = np.zeros(median.shape, dtype=np.int16), np.zeros(median.shape)
    with np.errstate(invalid="ignore"):
        steady = enough & (upper - lower <= gate)
        for each in ordered:
            close = np.abs(each - median) <= gate
            number += close
            total += np.where(close, each, np.float32(0))
    combined = np.full(median.shape, np.nan, dtype=np.float32)
    kept = steady & (number > 0)
    combined[kept] = total[kept] / number[kept]
    split = 2 * valid == len(images)
    if len(images) == 2:
        split |= enough & ~steady
    combined[split] = np.where(np.isfinite(first), first, np.nan)[split]
    return combined


def _sorted(stack: NDArray[np.float32]) -> NDArray[np.float32]:
    """Sort (images, height, width) values pixel by pixel, in place.

    A network of comparisons takes whole images at a time; sorting each pixel by itself takes four
    times as long. Source: Batcher, Sorting networks and their applications, 1968.
    """
    for low, high in _network(len(stack)):
        smaller = np.minimum(stack[low], stack[high])
        np.maximum(stack[low], stack[high], out=stack[high])
        stack[low] = smaller
    return stack


def _network(count: int) -> Iterator[tuple[int, int]]:
    """Yield the pairs that an odd-even merge sort of ``count`` values compares, in their order."""
    merged = 1
    while merged < count:
        step = merged
        while step >= 1:
            for start in range(step % merged, count - step, 2 * step):
                for low in range(start, min(start + step, count - step)):
                    if low // (2 * merged) == (low + step) // (2 * merged):
                        yield low, low + step
            step //= 2
        merged *= 2
