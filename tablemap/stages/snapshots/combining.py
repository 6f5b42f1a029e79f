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
    most = len(images)
    # A missing value is the largest one, so that it comes last.
    ordered = _sorted(np.fmin(np.stack(images), np.float32(np.inf)))
    valid = np.isfinite(ordered).sum(axis=0, dtype=np.int16)
    enough = 2 * valid > most
    # Most pixels have a value in all images, and so one rank for all of them.
    ranks = ordered.reshape(most, -1)
    lacking = np.flatnonzero(valid < most)
    last, whole = np.maximum(valid.ravel()[lacking] - 1, 0), np.array([most - 1])

    def quantile(numerator: int) -> NDArray[np.float32]:
        picked: NDArray[np.float32] = ranks[_rank(numerator, whole)][0]
        picked[lacking] = ranks[_rank(numerator, last), lacking]
        return picked.reshape(valid.shape)

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
    mean = total / np.maximum(number, 1)
    combined = np.where(steady & (number > 0), mean, np.nan).astype(np.float32)
    split = 2 * valid == most
    if most == 2:
        split |= enough & ~steady
    np.copyto(combined, images[0], where=split)
    return combined


def _rank(numerator: int, last: NDArray[np.integer]) -> NDArray[np.integer]:
    """Return the rank of a quartile among the ranks up to the ``last`` one.

    Ranks are rounded outward on both sides, so that one outlier does not decide.
    """
    return last * numerator // 4 if numerator <= 2 else last - last * (4 - numerator) // 4


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
