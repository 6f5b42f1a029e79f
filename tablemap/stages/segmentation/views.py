"""A snapshot prepared for segmentation: points, the noise of their heights, and level pixels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

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

Scalar = TypeVar("Scalar", bound=np.generic)

_TOLERANCE_SIGMAS = 3.0  # sigmas of a pixel's own noise


@dataclass(frozen=True, eq=False)
class SampledView:
    """One snapshot at every ``stride``-th pixel.

    - ``points``: (h, w, 3) float32, metres in the base, NaN where missing
    - ``sigma``: (h, w) metres, of the points' heights
    - ``upward``: (h, w), absolute vertical component of the normal
    - ``steep``: (h, w), the fall of the pixels' rays for one metre along the optical axis
    - ``is_coarse``: whether its depth comes in coarse steps
    """

    snapshot: Snapshot
    stride: int
    points: NDArray[np.float32]
    sigma: NDArray[np.float32]
    upward: NDArray[np.float32]
    steep: NDArray[np.float32]
    is_coarse: bool = False

    def window(self, pixels: int) -> int:
        """Return the odd width, in pixels of this view, of a window that wide in the snapshot."""
        return pixels // self.stride // 2 * 2 + 1

    def whole(self, image: NDArray[Scalar]) -> NDArray[Scalar]:
        """Return an image (h, w) of this view at the size of the snapshot, its pixels repeated."""
        if self.stride == 1:
            return image
        repeated = np.empty(self.snapshot.depth.shape, dtype=image.dtype)
        for down, right in np.ndindex(self.stride, self.stride):
            part = repeated[down :: self.stride, right :: self.stride]
            part[:] = image[: part.shape[0], : part.shape[1]]
        return repeated

    @property
    def depth(self) -> NDArray[np.float32]:
        """The (h, w) depth, metres, NaN where missing."""
        return self.snapshot.depth[:: self.stride, :: self.stride]

    @cached_property
    def area(self) -> NDArray[np.float32]:
        """The (h, w) square metres that each pixel covers on a horizontal surface."""
        return self.area_of(np.ones(self.steep.shape, dtype=bool)).reshape(self.steep.shape)

    @cached_property
    def measured(self) -> NDArray[np.float32]:
        """The points that were measured: their x, y and z (3, n), metres in the base."""
        # One axis at a time: short rows of three are slow.
        return np.ascontiguousarray(self.points[np.isfinite(self.points[..., 2])].T)

    def area_of(self, pixels: Bools) -> NDArray[np.float32]:
        """Return the (n,) square metres of some pixels, given as a mask (h, w)."""
        camera = self.snapshot.camera
        facing = self.stride**2 * self.depth[pixels] ** 2 / (camera.fx * camera.fy)
        return (facing / np.maximum(self.steep[pixels], 0.1)).astype(np.float32)


def look(snapshot: Snapshot, *, stride: int, coarser: SampledView | None = None) -> SampledView:
    """Prepare a snapshot at every ``stride``-th pixel.

    Normals are costly and smooth: if given, those of a ``coarser`` view of the snapshot are used.
    """
    depth = snapshot.depth[::stride, ::stride]
    turned = snapshot.camera.rays[::stride, ::stride] @ (
        snapshot.base_from_camera[:3, :3].T.astype(np.float32)
    )
    # Each coordinate is an image of its own: arithmetic on these is several times as fast.
    planes = np.moveaxis(turned, 2, 0) * depth
    planes += snapshot.base_from_camera[:3, 3].astype(np.float32)[:, None, None]
    points = np.moveaxis(planes, 0, 2)
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
        upward = coarser.whole(coarser.upward)[::stride, ::stride]
    return SampledView(
        snapshot=snapshot,
        stride=stride,
        points=points,
        sigma=noise * steep,
        upward=upward,
        steep=steep,
        is_coarse=coarse,
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
    index = np.flatnonzero(among)
    x, y = points[..., 0].ravel()[index], points[..., 1].ravel()[index]
    boxed = (x > left) & (x < right) & (y > bottom) & (y < top)
    index, x, y = index[boxed], x[boxed], y[boxed]
    cells = (int((right - left) / CELL_M) + 2, int((top - bottom) / CELL_M) + 2)
    raster = PIL.Image.new("1", cells)
    ring = (np.array(area.exterior.coords) - (left, bottom)) / CELL_M
    PIL.ImageDraw.Draw(raster).polygon([(float(u), float(v)) for u, v in ring], fill=1)
    grid = np.array(raster, dtype=bool)
    column = ((x - np.float32(left)) / np.float32(CELL_M)).astype(np.int32)
    row = ((y - np.float32(bottom)) / np.float32(CELL_M)).astype(np.int32)
    result.reshape(-1)[index] = grid[
        np.clip(row, 0, cells[1] - 1), np.clip(column, 0, cells[0] - 1)
    ]
    return result


def ways_to(surface: Bools) -> NDArray[np.int32]:
    """Return (2, h, w) row and column of the pixel of a surface (h, w) that is nearest to each."""
    nearest: NDArray[np.int32] = ndimage.distance_transform_edt(
        ~surface, return_distances=False, return_indices=True
    )
    return nearest


def is_parted(first: Bools, to_second: NDArray[np.int32], through: Bools) -> bool:
    """Tell whether the shortest way between two surfaces mostly crosses pixels of a gap.

    ``first`` and ``through``, the gap, are masks of one image, ``to_second`` are the `ways_to` the
    other surface; both surfaces have pixels.
    """
    rows, columns = to_second
    v, u = np.nonzero(first)
    pick = np.linspace(0, len(v) - 1, min(len(v), 40)).astype(np.int64)
    v, u = v[pick], u[pick]
    fraction = np.linspace(0, 1, 48)[None, :]
    line_v = np.round(v[:, None] + fraction * (rows[v, u] - v)[:, None]).astype(np.int64)
    line_u = np.round(u[:, None] + fraction * (columns[v, u] - u)[:, None]).astype(np.int64)
    return float(through[line_v, line_u].any(axis=1).mean()) >= 0.5
