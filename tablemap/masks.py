"""Growing, shrinking and opening of masks by square windows.

Whole images are shifted and combined: twenty times as fast as filters that go from pixel to pixel.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Bools


def grown(mask: Bools, size_px: int) -> Bools:
    """Return where the window round a pixel has any pixel of the (h, w) mask.

    The window is ``size_px`` wide and high. An even one begins half its size before the pixel.
    """
    if size_px <= 1:
        return mask.copy()
    before = size_px // 2
    rows, columns = mask.shape
    window = np.zeros((rows + size_px - 1, columns + size_px - 1), dtype=np.uint8)
    window[before : before + rows, before : before + columns] = mask
    window = _any_of_rows(_any_of_rows(window, size_px).T, size_px).T
    return np.ascontiguousarray(window).view(np.bool_)


def shrunk(mask: Bools, size_px: int, *, outside: bool = True) -> Bools:
    """Return where all pixels of the window lie in the mask; ``outside``: beyond the image too."""
    smaller = ~grown(~mask, size_px)
    if not outside and size_px > 1:
        before = size_px // 2
        after = size_px - 1 - before
        smaller[:before] = smaller[:, :before] = False
        if after:
            smaller[-after:] = smaller[:, -after:] = False
    return smaller


def opened(mask: Bools, size_px: int) -> Bools:
    """Return the mask without what is narrower than the window; what is outside is not in it."""
    return grown(shrunk(mask, size_px, outside=False), size_px)


def counted(mask: Bools, size_px: int) -> NDArray[np.unsignedinteger]:
    """Return how many pixels of the (h, w) mask the window round each pixel has.

    The window is odd; what is outside is not in the mask.
    """
    padded: NDArray[np.unsignedinteger] = np.pad(mask, size_px // 2).astype(
        np.uint8 if size_px < 16 else np.uint16
    )
    return np.ascontiguousarray(_sum_of_rows(_sum_of_rows(padded, size_px).T, size_px).T)


def _sum_of_rows(window: NDArray[np.unsignedinteger], size_px: int) -> NDArray[np.unsignedinteger]:
    """Add to each row the next ones, ``size_px`` in all; there are so many fewer of them."""
    rows = len(window) - size_px + 1
    total = np.zeros_like(window[:rows])
    begin, width = 0, 1
    while True:
        if size_px & width:
            total += window[begin : begin + rows]
            begin += width
        if begin == size_px:
            return total
        window, width = window[:-width] + window[width:], 2 * width


def crowded(mask: Bools, least: int) -> Bools:
    """Return where a pixel and its eight neighbours have at least so many pixels of the mask.

    At the image's border the border's own pixels stand for those beyond.
    """
    padded = np.pad(mask.view(np.uint8), 1, mode="edge")
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    counts = rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]
    return np.asarray(counts >= least)


def _any_of_rows(window: NDArray[np.uint8], size_px: int) -> NDArray[np.uint8]:
    """Combine each row with the next ones, ``size_px`` in all; there are so many fewer of them."""
    width = 1
    while width < size_px:
        step = min(width, size_px - width)
        window = window[:-step] | window[step:]
        width += step
    return window
