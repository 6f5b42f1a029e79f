"""Search for a floor that is not at z = 0 of the fixed frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import ndimage

from tablemap.geometry import Floats
from tablemap.stages.calibration.levels import LEAST_UPWARD
from tablemap.stages.snapshots import Snapshot
from tablemap.stages.snapshots.normals import upward_share

STRIDE_PX = 4
BIN_M = 0.01
FARTHEST_M = 3.5
"""Farther away a tilt of one degree moves the floor by more than the width of a level."""
LEAST_SHARE = 0.1
"""A level has at least this share of the widest one's area."""
LEAST_AREA_M2 = 0.3
LEAST_RISE_M = 0.25
"""Height of a surface above a floor; it shows that a level above z = 0 is a floor, not a top."""


def floor_level(snapshots: tuple[Snapshot, ...]) -> float | None:
    """Return the floor's z in the fixed frame in metres: the lowest of the wide levels.

    Returns None if no level is wide, or if a single level above z = 0 could also be a table top
    without a visible floor.
    """
    heights, areas = [], []
    for snapshot in snapshots:
        z, area = _upward(snapshot)
        heights.append(z)
        areas.append(area)
    z = np.concatenate(heights) if heights else np.zeros(0)
    if len(z) == 0:
        return None
    low = float(np.floor(z.min() / BIN_M)) * BIN_M
    index = ((z - low) / BIN_M).astype(np.int64)
    histogram = np.bincount(index, weights=np.concatenate(areas), minlength=int(index.max()) + 1)
    wide = ndimage.uniform_filter1d(histogram, 5, mode="constant") * 5
    levels = np.flatnonzero(wide >= max(LEAST_AREA_M2, LEAST_SHARE * float(wide.max())))
    if len(levels) == 0:
        return None
    # The lowest run of wide bins is one level. Its middle is the bin with most area.
    end = int(np.flatnonzero(np.diff(levels, append=levels[-1] + 9) > 1)[0])
    run = levels[: end + 1]
    best = low + (int(run[np.argmax(wide[run])]) + 0.5) * BIN_M
    near = np.abs(z - best) < 3 * BIN_M
    level = float(np.median(z[near]))
    above = low + (levels + 0.5) * BIN_M > level + LEAST_RISE_M
    return level if level < 0 or bool(above.any()) else None


def lowered(snapshot: Snapshot, level: float) -> Snapshot:
    """Return the snapshot with z counted from a level of the fixed frame."""
    mount = snapshot.base_from_camera.copy()
    mount[2, 3] -= level
    return replace(snapshot, base_from_camera=mount)


def _upward(snapshot: Snapshot) -> tuple[Floats, Floats]:
    """Return z (n,) of level pixels near the camera, and their areas in square metres."""
    depth = snapshot.depth[::STRIDE_PX, ::STRIDE_PX]
    if min(depth.shape) < 16:
        return np.zeros(0), np.zeros(0)
    arms = (snapshot.camera.rays[::STRIDE_PX, ::STRIDE_PX] * depth[..., None]) @ (
        snapshot.base_from_camera[:3, :3].T.astype(np.float32)
    )
    with np.errstate(invalid="ignore"):
        chosen = (
            (upward_share(arms, 2) > LEAST_UPWARD)
            & (np.hypot(arms[..., 0], arms[..., 1]) < FARTHEST_M)
            & (arms[..., 2] < 0)
        )
    z = arms[chosen][:, 2].astype(np.float64)
    steep = np.maximum(np.abs(z) / np.maximum(depth[chosen], 0.05), 0.05)
    area = (STRIDE_PX * depth[chosen]) ** 2 / (snapshot.camera.fx * snapshot.camera.fy * steep)
    return z + float(snapshot.base_from_camera[2, 3]), area.astype(np.float64)
