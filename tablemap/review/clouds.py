"""Thinned points and simple lines for the viewer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats


def thinned(points: NDArray[np.floating], cell: float) -> NDArray[np.float32]:
    """Keep one of the finite points (n, 2) or (n, 3) in each cell (metres)."""
    kept = np.asarray(points)[np.isfinite(points).all(axis=1)]
    if len(kept) == 0:
        return np.asarray(kept, dtype=np.float32)
    cells = np.floor((kept - kept.min(axis=0)) / cell).astype(np.int64)
    size = cells.max(axis=0) + 1
    keys = np.ravel_multi_index(tuple(cells.T), tuple(size))
    if (room := int(np.prod(size))) > _MOST_CELLS * len(kept):
        _, first = np.unique(keys, return_index=True)
        return np.asarray(kept[np.sort(first)], dtype=np.float32)
    # Without sorting: of the points of a cell the first is written last.
    number = np.arange(len(kept))
    first = np.empty(room, dtype=np.int64)
    first[keys[::-1]] = number[::-1]
    return np.asarray(kept[first[keys] == number], dtype=np.float32)


_MOST_CELLS = 30  # for each point, in a table of all cells


def raised(points: NDArray[np.floating], height: float) -> NDArray[np.float32]:
    """Return (n, 2) points of a plane as (n, 3) at a height."""
    flat = np.asarray(points, dtype=np.float32).reshape(-1, 2)
    return np.column_stack([flat, np.full(len(flat), height, dtype=np.float32)])


def middles(strips: Sequence[NDArray[np.floating]]) -> NDArray[np.float32]:
    """Return the middle (n, 3) of each of n lines, for its name; nan where it has no points."""
    found = [line.mean(axis=0) if len(line) else np.full(3, np.nan) for line in strips]
    return np.array(found, dtype=np.float32).reshape(-1, 3)


def closed(outline: Floats, height: float) -> NDArray[np.float32]:
    """Return an (n, 2) outline as a closed (n + 1, 3) line at a height."""
    ring = raised(outline, height)
    return np.concatenate([ring, ring[:1]]) if len(ring) else ring
