"""A snapshot prepared for segmentation: points, the noise of their heights, and level pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import PIL.Image
import PIL.ImageDraw
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from tablemap.geometry import Bools
from tablemap.stages.snapshots import Snapshot
from tablemap.stages.snapshots.normals import upward_share

COARSE_SIGMA_M = 0.008
_NEAR = 25.0  # per cent of the pixels, those with the least noise
NORMAL_WINDOW_PX, COARSE_WINDOW_PX = 4, 9
CELL_M = 0.01

LEAST_UPWARD = np.cos(np.deg2rad(30.0))
"""Least cosine between the vertical and a pixel's normal on a level surface: noisy depth tilts
normals by so much."""

_TOLERANCE_SIGMAS = 3.0  # sigmas of a pixel's own noise


@dataclass(frozen=True, eq=False)
class SampledView:
    """One snapshot at every ``stride``-th pixel.

    - ``points``: (h, w, 3) float32, metres in the base, NaN where missing
    - ``sigma``: (h, w) metres, of the points' heights
    - ``upward``: (h, w), absolute vertical component of the normal
    - ``area``: (h, w) square metres that a pixel covers on a horizontal surface
    - ``is_coarse``: whether its depth comes in coarse steps
    """

    snapshot: Snapshot
    stride: int
    points: NDArray[np.float32]
    sigma: NDArray[np.float32]
    upward: NDArray[np.float32]
    area: NDArray[np.float32]
    is_coarse: bool = False


def look(snapshot: Snapshot, *, stride: int, coarser: SampledView | None = None) -> SampledView:
    """Prepare a snapshot at every ``stride``-th pixel.

    Normals are costly and smooth: if given, those of a ``coarser`` view of the snapshot are used.
    """
    depth = snapshot.depth[::stride, ::stride]
    turned = snapshot.camera.rays[::stride, ::stride] @ (
        snapshot.base_from_camera[:3, :3].T.astype(np.float32)
    )
    points = turned * depth[..., None] + snapshot.base_from_camera[:3, 3].astype(np.float32)
    steep = np.abs(turned[..., 2])
    noise = snapshot.noise.sigma(depth)
    if coarser is None:
        valid = np.isfinite(noise)
        # Coarse depth steps need wide windows; fine noise does not. Noise grows with the distance,
        # and a table is nearer than most of a room.
        coarse = bool(valid.any() and float(np.percentile(noise[valid], _NEAR)) > COARSE_SIGMA_M)
        upward = upward_share(points, COARSE_WINDOW_PX if coarse else NORMAL_WINDOW_PX)
    else:
        coarse = coarser.is_coarse
        times = coarser.stride // stride
        upward = np.repeat(np.repeat(coarser.upward, times, axis=0), times, axis=1)
        upward = upward[: depth.shape[0], : depth.shape[1]]
    pixel = stride**2 * depth**2 / (snapshot.camera.fx * snapshot.camera.fy)
    return SampledView(
        snapshot=snapshot,
        stride=stride,
        points=points,
        sigma=noise * steep,
        upward=upward,
        is_coarse=coarse,
        area=(pixel / np.maximum(steep, 0.1)).astype(np.float32),
    )


def tolerance(sigma: NDArray[np.float32], least: float) -> NDArray[np.float32]:
    """Return the largest height difference, metres, to a plane for a pixel with this noise."""
    width: NDArray[np.float32] = np.maximum(
        np.float32(least), np.float32(_TOLERANCE_SIGMAS) * sigma
    )
    return width


def inside(area: shapely.Geometry, points: NDArray[np.float32], among: Bools) -> Bools:
    """Return which of the pixels ``among`` lie in a polygon in the base, to half a cell."""
    result = np.zeros_like(among)
    if area.geom_type != "Polygon" or area.is_empty:
        return result
    left, bottom, right, top = area.bounds
    x, y = points[..., 0], points[..., 1]
    with np.errstate(invalid="ignore"):
        boxed = among & (x > left) & (x < right) & (y > bottom) & (y < top)
    cells = (int((right - left) / CELL_M) + 2, int((top - bottom) / CELL_M) + 2)
    raster = PIL.Image.new("1", cells)
    ring = (np.array(area.exterior.coords) - (left, bottom)) / CELL_M
    PIL.ImageDraw.Draw(raster).polygon([(float(u), float(v)) for u, v in ring], fill=1)
    grid = np.array(raster, dtype=bool)
    u = ((x[boxed] - np.float32(left)) / np.float32(CELL_M)).astype(np.int32)
    v = ((y[boxed] - np.float32(bottom)) / np.float32(CELL_M)).astype(np.int32)
    result[boxed] = grid[np.clip(v, 0, cells[1] - 1), np.clip(u, 0, cells[0] - 1)]
    return result


def is_parted(first: Bools, second: Bools, through: Bools) -> bool:
    """Tell whether the shortest way between two surfaces mostly crosses pixels of a gap.

    All arguments are masks of one image; both surfaces have pixels.
    """
    rows, columns = ndimage.distance_transform_edt(
        ~second, return_distances=False, return_indices=True
    )
    v, u = np.nonzero(first)
    pick = np.linspace(0, len(v) - 1, min(len(v), 40)).astype(np.int64)
    v, u = v[pick], u[pick]
    fraction = np.linspace(0, 1, 48)[None, :]
    line_v = np.round(v[:, None] + fraction * (rows[v, u] - v)[:, None]).astype(np.int64)
    line_u = np.round(u[:, None] + fraction * (columns[v, u] - u)[:, None]).astype(np.int64)
    return float(through[line_v, line_u].any(axis=1).mean()) >= 0.5
