"""The horizontal surfaces of one view, with signs that tell a table from other furniture."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from tablemap.config import SegmentationConfig
from tablemap.geometry import Bools, Floats, Ints
from tablemap.masks import grown, opened, shrunk
from tablemap.stages.segmentation.views import (
    LEAST_UPWARD,
    SampledView,
    is_parted,
    tolerance,
    ways_to,
)

BIN_M = 0.005
MOST_LEVELS = 8
CELL_M = 0.04
FARTHEST_M = 6.0
GAP_STEP_PX = 2

MERGE_HEIGHT = 0.04
"""Largest difference, metres, of one surface's heights between patches and between views."""

_TOLERANCE = 0.015  # metres round a surface's height, at least
_LEAST_AREA, _LEAST_COARSE_AREA = 0.012, 0.03
"""Square metres of a surface in one view; of depth in coarse steps, smaller ones are rims."""


@dataclass(frozen=True, eq=False)
class Patch:
    """A connected horizontal surface in one view.

    - ``cells``: (n, 2) metres in the map, thinned points
    - ``camera``: (2,) metres in the map, the camera's place
    - ``gaze``: metres between the patch and the optical axis, at the patch's height
    - ``open_share``: share of cells seen under the patch among these and the cells of a front;
      None if neither was seen
    - ``walled_share``: share of the rim where something rises
    - ``number``: counts the patches of a view
    - ``parted``: numbers of patches at about this height that a gap separates from this one
    """

    view: int
    height: float
    area: float
    cells: Floats
    camera: Floats
    gaze: float
    open_share: float | None
    walled_share: float
    number: int
    parted: frozenset[int] = frozenset()

    @cached_property
    def shape(self) -> shapely.Geometry:
        """The convex hull of the cells in the map, half a cell wider than their centres."""
        return hull(self.cells)


def hull(points: Floats) -> shapely.Geometry:
    """Return the convex hull of cells' centres (n, 2), half a cell wider on all sides."""
    return convex(points).buffer(CELL_M / 2)


def find_patches(view: SampledView, config: SegmentationConfig) -> list[Patch]:
    """Return the surfaces of a view, largest level first: height histogram, then connection."""
    z = view.points[..., 2]
    with np.errstate(invalid="ignore"):
        candidate = (
            (view.upward > LEAST_UPWARD)
            & (z > config.lowest)
            & (z < config.highest)
            & (np.hypot(view.points[..., 0], view.points[..., 1]) < FARTHEST_M)
        )
    band = tolerance(view.sigma, _TOLERANCE)
    least = _LEAST_COARSE_AREA if view.is_coarse else _LEAST_AREA
    patches: list[Patch] = []
    masks: list[Bools] = []
    left = candidate.copy()
    for _ in range(MOST_LEVELS):
        level = _fullest_level(z[left], view.area[left], least, config)
        if level is None:
            break
        with np.errstate(invalid="ignore"):
            in_band = np.abs(z - np.float32(level)) <= band
        near = left & in_band
        left &= ~near
        # Normals are poor near edges, and between things on a top all pixels may be near edges. So
        # pixels at its height that border on the surface are part of it. If depth comes in coarse
        # steps, the band is as wide as a side face is high: then they are not.
        if not view.is_coarse:
            near = in_band & grown(near, _RIM_PX)
        labels, count = ndimage.label(opened(near, 3))
        if count == 0:
            continue
        areas = np.bincount(labels.ravel(), weights=view.area.ravel(), minlength=count + 1)
        areas[0] = 0.0
        for k in np.flatnonzero(areas >= least):
            masks.append(labels == k)
            patches.append(_describe(view, masks[-1], float(areas[k]), len(patches)))
    return _told_apart(view, patches, masks)


def _told_apart(view: SampledView, patches: list[Patch], masks: list[Bools]) -> list[Patch]:
    """Note for each patch the others at about its height that a gap separates from it."""
    parted: list[set[int]] = [set() for _ in patches]
    thin = [mask[::GAP_STEP_PX, ::GAP_STEP_PX] for mask in masks]
    z = view.points[::GAP_STEP_PX, ::GAP_STEP_PX, 2]

    @cache
    def towards(i: int) -> NDArray[np.int32]:
        return ways_to(thin[i])

    for i, first in enumerate(patches):
        for j, second in enumerate(patches[:i]):
            if abs(first.height - second.height) > MERGE_HEIGHT:
                continue
            if not thin[i].any() or not thin[j].any():
                continue
            with np.errstate(invalid="ignore"):
                below = z < min(first.height, second.height) - MERGE_HEIGHT
            # One pixel below is noise; four in a square are a gap.
            gap = shrunk(below, 2)
            if is_parted(thin[i], towards(j), gap) or is_parted(thin[j], towards(i), gap):
                parted[i].add(j)
                parted[j].add(i)
    return [replace(p, parted=frozenset(q)) for p, q in zip(patches, parted, strict=True)]


def _fullest_level(
    heights: NDArray[np.float32],
    areas: NDArray[np.float32],
    least: float,
    config: SegmentationConfig,
) -> float | None:
    """Return the height with most area within 2 cm, or None if that is too little."""
    if heights.size == 0:
        return None
    bins = int(np.ceil((config.highest - config.lowest) / BIN_M))
    index = np.clip(((heights - config.lowest) / BIN_M).astype(np.int64), 0, bins - 1)
    histogram = np.bincount(index, weights=areas, minlength=bins)
    smooth = np.convolve(histogram, np.ones(5), mode="same")
    best = int(np.argmax(smooth))
    if smooth[best] < least:
        return None
    around = slice(max(best - 2, 0), best + 3)
    centres = config.lowest + (np.arange(bins)[around] + 0.5) * BIN_M
    return float(np.average(centres, weights=histogram[around]))


def _describe(view: SampledView, mask: Bools, area: float, number: int) -> Patch:
    snapshot = view.snapshot
    inside = view.points[mask]
    height = float(np.median(inside[:, 2]))
    mount = snapshot.base_from_camera
    camera = mount[:2, 3]
    index = np.floor(inside[:, :2] / CELL_M).astype(np.int64)
    low = index.min(axis=0)
    occupied = np.zeros(tuple(index.max(axis=0) - low + 1), dtype=bool)
    occupied[tuple((index - low).T)] = True
    cells = np.argwhere(occupied) + low
    places = (cells + 0.5) * CELL_M
    open_share, walled_share = surroundings(view, places, height)
    return Patch(
        view=snapshot.index,
        height=height,
        area=area,
        cells=snapshot.map_from_base.apply(places),
        camera=snapshot.map_from_base.apply(camera),
        gaze=_gaze(mount, height, places),
        open_share=open_share,
        walled_share=walled_share,
        number=number,
    )


def _gaze(base_from_camera: Floats, height: float, places: Floats) -> float:
    """Return the distance between the optical axis and the surface, metres, at its height."""
    origin, axis = base_from_camera[:3, 3], base_from_camera[:3, 2]
    drop = origin[2] - height
    reach = drop / -axis[2] if axis[2] < -1e-3 and drop > 0 else FARTHEST_M
    target = origin[:2] + axis[:2] * min(float(reach), FARTHEST_M)
    return float(np.linalg.norm(places - target, axis=1).min())


_RIM_PX = 11
_UNDER_M = 0.12  # metres below a top: from here on it is the space under the top


_LEAST_CELLS = 6


def _hit(region: Bools, cells: Ints) -> Ints:
    """Return the cells (n, 2) of a region that occur at least twice among the given cells."""
    hits = np.bincount(cells[:, 0] * region.shape[1] + cells[:, 1], minlength=region.size)
    return np.argwhere(region & (hits.reshape(region.shape) >= 2))


def upright_cells(region: Bools, cells: Ints, heights: NDArray[np.float32]) -> Ints:
    """Return the cells (n, 2) of a region in which the points at some cells stand upright.

    The front of a box fills a range of heights. A seat before a table lies at one height.
    """
    here = region[tuple(cells.T)]
    flat = cells[here, 0] * region.shape[1] + cells[here, 1]
    lowest = np.full(region.size, np.inf, dtype=np.float32)
    highest = np.full(region.size, -np.inf, dtype=np.float32)
    np.minimum.at(lowest, flat, heights[here])
    np.maximum.at(highest, flat, heights[here])
    return np.argwhere((highest - lowest > _UPRIGHT_M).reshape(region.shape))


_LOW_M = 0.08  # metres: what is lower is floor, a rug, or feet
_UPRIGHT_M = 0.05  # metres from the lowest point of a front's cell to the highest: a seat has less


def _beyond(cells: Ints, camera: Floats, surface: Bools) -> Bools:
    """Tell which cells (n, 2) the camera sees over the surface: on the way there, it lies below.

    ``camera`` (2,), in cells. A body hides its own sides that face away from the camera: what is
    seen there is another thing, like a chair at the far side of a table.
    """
    way = camera - (cells + 0.5)
    length = np.maximum(np.hypot(*way.T), 1e-6)
    steps = np.arange(1, int(np.hypot(*surface.shape)) + 1)
    taken = np.minimum(steps, length[:, None])[..., None]
    passed = np.floor(cells[:, None] + 0.5 + taken * (way / length[:, None])[:, None]).astype(int)
    inside = ((passed >= 0) & (passed < surface.shape)).all(axis=-1)
    rows, columns = np.where(inside[..., None], passed, 0).reshape(-1, 2).T
    crossed: Bools = (surface[rows, columns].reshape(inside.shape) & inside).any(axis=1)
    return crossed


def convex(points: NDArray[np.number]) -> shapely.Geometry:
    """Return the convex hull of points (n, 2), at least one."""
    # Of a line through the points: many points are many objects.
    return shapely.convex_hull(shapely.linestrings(np.concatenate([points, points[:1]])))


def _convex(grid: Bools) -> Bools:
    """Return the convex hull of a grid's cells."""
    hull = convex(np.argwhere(grid)).buffer(0.5)
    shapely.prepare(hull)
    rows, columns = np.indices(grid.shape)
    inside: Bools = shapely.contains_xy(hull, rows.ravel(), columns.ravel()).reshape(grid.shape)
    return inside


def surroundings(view: SampledView, places: Floats, height: float) -> tuple[float | None, float]:
    """Return a surface's open share below, and the share of its rim where something rises.

    ``places`` (n, 2), metres in the base, are on the surface. The open share is that of cells seen
    under the surface among these and the cells of a front; None if neither was seen. Under a table
    there is a view of what lies behind; a couch, a bench or a cupboard has a front, on a side that
    faces the camera. A backrest, an arm or a wall rises at the rim.
    """
    margin = 5
    cells = np.unique(np.floor(places / CELL_M).astype(np.int64), axis=0)
    low = cells.min(axis=0) - margin
    shape = tuple(int(n) for n in cells.max(axis=0) - low + margin + 1)
    grid = np.zeros(shape, dtype=bool)
    grid[tuple((cells - low).T)] = True
    grid = ndimage.binary_fill_holes(shrunk(grown(grid, 3), 3, outside=False))
    whole = _convex(grid)
    inner = shrunk(whole, 5, outside=False)
    rim = grown(whole, 5) & ~inner
    x, y, z = view.measured
    camera = view.snapshot.base_from_camera[:3, 3]
    lower = z < height - _UNDER_M
    upper = (z > height + 0.10) & (z < height + 0.70)

    def fitting(*places: NDArray[np.floating]) -> tuple[Ints, Bools]:
        """Return the cells of those places x, y that lie in the grid, and which these are."""
        index = [np.floor(each / CELL_M).astype(np.int64) for each in places]
        fits = np.ones(len(places[0]), dtype=bool)
        for axis in (0, 1):
            index[axis] -= low[axis]
            fits &= (index[axis] >= 0) & (index[axis] < shape[axis])
        return np.stack([each[fits] for each in index], axis=1), fits

    def where(mask: Bools) -> tuple[Ints, NDArray[np.float32]]:
        found, fits = fitting(x[mask], y[mask])
        return found, z[mask][fits]

    def crossing(mask: Bools) -> Ints:
        """Return the cells in which the rays to some points pass a plane just under the top."""
        share = (camera[2] - (height - _UNDER_M)) / (camera[2] - z[mask])
        passed = (camera[k] + share * (each[mask] - camera[k]) for k, each in enumerate((x, y)))
        return fitting(*passed)[0]

    under, heights = where(lower)
    # Points seen under the surface count, and rays that pass under it: these met no front, wherever
    # they end.
    through = np.concatenate([under, crossing(lower)]) if camera[2] > height else under
    # Count cells, not pixels: a leg has many pixels in few cells, a front fills all its cells.
    beneath = len(_hit(inner, through))
    high = heights > _LOW_M
    fronts = upright_cells(rim, under[high], heights[high])
    front = int((~_beyond(fronts, camera[:2] / CELL_M - low, inner)).sum())
    rising, _ = where(upper)
    raised = np.zeros(shape, dtype=bool)
    raised[tuple(rising.T)] = True
    # A thing that rises inside of the surface stands on it; a backrest or a wall rises outside.
    raised &= ~whole
    edge = grid & ~shrunk(grid, 3, outside=False)
    near_raised = grown(raised, 5)
    walled = float((edge & near_raised).sum() / max(int(edge.sum()), 1))
    seen = beneath + front
    return (beneath / seen if seen >= _LEAST_CELLS else None), walled
