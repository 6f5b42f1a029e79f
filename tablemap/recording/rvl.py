"""Depth images compressed by runs and variable-length differences (RVL).

Wilson, "Fast lossless depth image compression" (ISS 2017). Runs of zeros and runs of values
alternate. Numbers are run lengths and zigzag-coded differences of successive values. Each is
written in nibbles of three bits and a continuation bit, least significant first. A little-endian
word has eight nibbles, topmost first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Ints

_SPARE_WORDS = 16  # an image takes less than a word a pixel; further words are ignored


def decode_rvl(data: bytes | memoryview, *, pixels: int) -> NDArray[np.uint16]:
    """Return the values (pixels,); raises ValueError if the data has not that many."""
    words = min(len(data) // 4, pixels + _SPARE_WORDS)
    values = _variable_length(np.frombuffer(data, dtype="<u4", count=words))
    starts, lengths, places = [], [], []
    at = filled = 0
    while filled < pixels:
        if at + 2 > len(values):
            raise ValueError("the RVL data ends too early")
        zeros, nonzeros = int(values[at]), int(values[at + 1])
        if not zeros and not nonzeros:
            raise ValueError("an RVL run is empty")
        filled += zeros
        starts.append(at + 2)
        lengths.append(nonzeros)
        places.append(filled)
        filled += nonzeros
        at += 2 + nonzeros
    if filled != pixels or at > len(values):
        raise ValueError("the RVL runs do not fill the image")
    run_starts, run_lengths = np.array(starts, np.int64), np.array(lengths, np.int64)
    within = np.arange(run_lengths.sum()) - np.repeat(
        np.cumsum(run_lengths) - run_lengths, run_lengths
    )
    coded = values[np.repeat(run_starts, run_lengths) + within]
    differences = (coded >> 1) ^ -(coded & 1)
    image = np.zeros(pixels, dtype=np.uint16)
    target = np.repeat(np.array(places, np.int64), run_lengths) + within
    image[target] = (np.cumsum(differences) & 0xFFFF).astype(np.uint16)
    return image


def _variable_length(words: NDArray[np.uint32]) -> Ints:
    """Return all numbers of the stream: a nibble without the continuation bit ends each."""
    shifts = np.arange(28, -4, -4, dtype=np.uint32)
    parted = np.empty((len(words), 8), np.uint8)
    for place, shift in enumerate(shifts):
        parted[:, place] = (words >> shift) & 0xF
    nibbles = parted.ravel()
    # Half as wide as an index by default: a stream of zeros holds millions of numbers.
    ends = np.flatnonzero(nibbles < 8).astype(np.int32)
    if len(ends) == 0:
        return np.zeros(0, np.int64)
    begins = np.concatenate([np.zeros(1, np.int32), ends[:-1] + 1])
    values = np.zeros(len(ends), np.int64)
    longer = np.arange(len(ends), dtype=np.int32)
    for place in range(12):
        longer = longer[begins[longer] + place <= ends[longer]]
        if len(longer) == 0:
            break
        if place > 10:
            raise ValueError("an RVL number is longer than 32 bits")
        values[longer] |= (nibbles[begins[longer] + place] & 7).astype(np.int64) << (3 * place)
    return values
