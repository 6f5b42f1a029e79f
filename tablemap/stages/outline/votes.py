"""Thinned points of the plane that a view saw as top, and saw through."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tablemap.config import OutlineConfig
from tablemap.geometry import Floats
from tablemap.masks import shrunk
from tablemap.stages.outline.occupancy import Occupancy
from tablemap.stages.segmentation import Label
from tablemap.stages.snapshots import Snapshot

ERODED_PX = 9
"""Side of a window, pixels, that must be all top: this leaves out side faces that count as top."""


def vote(
    seen: Occupancy,
    snapshot: Snapshot,
    labels: NDArray[np.uint8],
    *,
    config: OutlineConfig,
) -> tuple[Floats, Floats]:
    """Return ``top`` (m, 2) and ``free`` (k, 2), metres in the base, at most one a grid cell."""
    inner = shrunk(seen.top, ERODED_PX, outside=False)
    rows, columns = np.nonzero(inner[::2, ::2])
    top = _on_plane(
        snapshot, seen, rows * 2 + seen.origin[0], columns * 2 + seen.origin[1], config.vote_grid
    )

    stride = 4
    depth = snapshot.depth[::stride, ::stride]
    fall = snapshot.camera.rays[::stride, ::stride] @ seen.normal.astype(np.float32)
    height = depth * fall + np.float32(seen.offset)
    label = labels[::stride, ::stride]
    with np.errstate(invalid="ignore"):
        passed = (height < -2 * config.tolerance_max) & (fall < -1e-3)
    passed &= (label != Label.TOP) & (label != Label.OTHER_TOP)
    rows, columns = np.nonzero(passed)
    free = _on_plane(snapshot, seen, rows * stride, columns * stride, config.vote_grid)
    if len(top) and len(free):
        low, high = top.min(axis=0) - config.free_reach, top.max(axis=0) + config.free_reach
        free = free[np.all((free > low) & (free < high), axis=1)]
    return top, free


def _on_plane(
    snapshot: Snapshot,
    seen: Occupancy,
    rows: NDArray[np.intp],
    columns: NDArray[np.intp],
    grid: float,
) -> Floats:
    """Return the places where the pixels' rays cross the plane, the first one in each grid cell."""
    rays = snapshot.camera.rays[rows, columns].astype(np.float64)
    depth = -seen.offset / np.minimum(rays @ seen.normal, -1e-3)
    pose = snapshot.base_from_camera
    points = depth[:, None] * (rays @ pose[:2, :3].T) + pose[:2, 3]
    points = points[depth < 12.0]
    if len(points) == 0:
        return np.zeros((0, 2))
    cell = np.floor(points / grid).astype(np.int64)
    _, first = np.unique(cell[:, 0] * 1_000_003 + cell[:, 1], return_index=True)
    chosen: Floats = points[np.sort(first)]
    return chosen
