"""Numbers drawn as lines: over an image no text of the viewer can be read in both of its themes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_CORNERS = {"a": (0, 0), "b": (1, 0), "c": (0, 1), "d": (1, 1), "e": (0, 2), "f": (1, 2)}
"""Of a digit, from above: left and right, in half heights."""
_STROKES = {
    "0": "abfea", "1": "bf", "2": "abdcef", "3": "abdcdfe", "4": "acdbf",
    "5": "bacdfe", "6": "baefdc", "7": "abf", "8": "abfeacd", "9": "dcabfe",
}  # fmt: skip
_PITCH = 1.6  # digits' widths


def number(value: int, place: NDArray[np.floating], height: float) -> list[NDArray[np.float32]]:
    """Return the lines (n, 2) of a number; ``place`` (2,) is its corner above on the left."""
    half = height / 2
    return [
        np.array(
            [
                place + half * np.add(_CORNERS[corner], (_PITCH * k, 0.0))
                for corner in _STROKES[digit]
            ],
            dtype=np.float32,
        )
        for k, digit in enumerate(str(value))
    ]
