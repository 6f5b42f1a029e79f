"""Random numbers by purpose: the draws for one purpose do not depend on the others."""

from __future__ import annotations

import zlib
from collections.abc import Callable

import numpy as np

from tablemap.geometry import Floats

Generators = Callable[[str], np.random.Generator]
"""Returns the generator of a purpose, with the same numbers at each call."""

_MOST = 2.5


def generators(name: str, seed: int) -> Generators:
    """Return the generators of a scenario of this name."""
    start = zlib.crc32(name.encode())
    return lambda purpose: np.random.default_rng([start, seed, zlib.crc32(purpose.encode())])


def clipped_normal(rng: np.random.Generator, size: int | tuple[int, ...]) -> Floats:
    """Draw unit normals, none of them more than 2.5."""
    return np.clip(rng.normal(size=size), -_MOST, _MOST)
