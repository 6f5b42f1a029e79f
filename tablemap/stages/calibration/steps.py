"""A step of the floor about the table: a rug under it, or a platform."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from tablemap.errors import ProcessWarning
from tablemap.geometry import Bools, Floats, Ints, Pose2
from tablemap.robust import mad_sigma
from tablemap.stages.calibration.levels import LEAST_UPWARD, STRIDE_PX, arms_of
from tablemap.stages.snapshots import Snapshot
from tablemap.stages.snapshots.normals import upward_share

_CELL = 0.1  # metres
_CELLS = 44  # along each side of the map
_BAND = 0.06  # metres about the floor
_LEAST_PIXELS = 10  # of a view in a cell
_STARTS = (0.6, 0.9, 1.3)  # metres: radii of discs about the table from which the search begins
_LEAST_STEP = 0.005  # metres: floors wave by 2 to 3 mm
_LEAST_SHARE = 0.8  # of the places along the border jump by most of the step
_LEAST_BORDER = 20  # such places
_MOST_COST = 0.6  # of the residuals without a step are left with one
_LEAST_AREA = 0.4  # square metres of each level


@dataclass(frozen=True)
class FloorStep:
    """Two levels of the floor.

    rise: metres, of the floor under the table above the floor around it
    area: square metres that were seen of the level under the table
    """

    rise: float
    area: float

    @property
    def sigma(self) -> float:
        """How far the one level that was fitted to both may be from each, metres."""
        return abs(self.rise) / 2

    def warning(self) -> ProcessWarning:
        """Say how high the step is, and what the height refers to."""
        higher = "higher" if self.rise > 0 else "lower"
        return ProcessWarning(
            "accuracy.floor_step",
            "calibration",
            f"The floor under the table lies {1e3 * abs(self.rise):.0f} mm {higher} than the floor "
            f"around it, over {self.area:.1f} square metres that were seen: a rug or a platform. "
            "Heights are measured from a level between the two.",
        )


def find_step(
    snapshots: Sequence[Snapshot], poses: Mapping[int, Pose2], top: Floats
) -> FloorStep | None:
    """Look for two levels of the floor about the table; return None for a single one.

    snapshots: the calibrated ones, z counted from the floor
    poses: of the views' bases in the map, by snapshot
    top: (n, 2), places of the top in the map

    What waves, or bends with the depth image, is smooth. A rug has an edge: the step is fitted
    together with a surface of second degree, the cells of each level are chosen anew with each fit,
    and the height must jump nearly everywhere along the border between the levels.
    """
    if not len(top):
        return None
    centre = np.median(top, axis=0)
    height = _cells(snapshots, poses, centre)
    known = np.isfinite(height)
    if known.sum() * _CELL**2 < 2 * _LEAST_AREA:
        return None
    grid = (np.arange(_CELLS) + 0.5 - _CELLS / 2) * _CELL
    x, y = np.meshgrid(grid, grid, indexing="ij")
    basis = np.stack([np.ones_like(x), x, y, x * x, y * y, x * y])
    base = _cost(_fit(height, known, basis)[1])
    trials = [_levels(height, known, basis, np.hypot(x, y) < radius) for radius in _STARTS]
    inner, step, cost = min(trials, key=lambda trial: trial[2])
    jumps = _jumps(height, inner) * np.sign(step)
    areas = [float((inner & known).sum()), float((~inner & known).sum())]
    if (
        abs(step) < _LEAST_STEP
        or cost > _MOST_COST * base
        or min(areas) * _CELL**2 < _LEAST_AREA
        or len(jumps) < _LEAST_BORDER
        or float(np.mean(jumps > abs(step) / 2)) < _LEAST_SHARE
    ):
        return None
    places = _places(top, centre)
    under = inner[places[:, 0], places[:, 1]].mean() > 0.5
    rise, area = (step, areas[0]) if under else (-step, areas[1])
    return FloorStep(rise=float(rise), area=area * _CELL**2)


def _places(points: Floats, centre: Floats) -> Ints:
    """Return the cells of points (n, 2) in the map, those outside moved to the border."""
    cell = np.floor((points - centre) / _CELL + _CELLS / 2).astype(np.int64)
    return np.clip(cell, 0, _CELLS - 1)


def _cells(snapshots: Sequence[Snapshot], poses: Mapping[int, Pose2], centre: Floats) -> Floats:
    """Return the floor's height in cells of the map: the median of the views' medians."""
    images = []
    for snapshot in snapshots:
        if snapshot.index not in poses or min(snapshot.depth.shape) <= 31 * STRIDE_PX:
            continue
        arms = arms_of(snapshot)
        z = arms[..., 2] + np.float32(snapshot.base_from_camera[2, 3])
        with np.errstate(invalid="ignore"):
            floor = np.abs(z) < _BAND
            if not floor.any():
                continue
            floor &= upward_share(arms, 4) > LEAST_UPWARD
        here = arms[floor][:, :2].astype(np.float64) + snapshot.base_from_camera[:2, 3]
        place = poses[snapshot.index].apply(here)
        inside = np.abs(place - centre).max(axis=1, initial=0.0) < _CELL * _CELLS / 2
        images.append(_medians(_places(place[inside], centre), z[floor][inside]))
    if not images:
        return np.full((_CELLS, _CELLS), np.nan)
    stack = np.stack(images)
    seen = np.isfinite(stack).any(axis=0)
    height = np.full((_CELLS, _CELLS), np.nan)
    height[seen] = np.nanmedian(stack[:, seen], axis=0)
    return height


def _medians(place: Ints, z: Floats) -> Floats:
    """Return the median of the heights in each cell, NaN where there are too few."""
    result = np.full(_CELLS * _CELLS, np.nan)
    cell = place[:, 0] * _CELLS + place[:, 1]
    order = np.lexsort((z, cell))
    found, first, count = np.unique(cell[order], return_index=True, return_counts=True)
    enough = count >= _LEAST_PIXELS
    result[found[enough]] = z[order][(first + count // 2)[enough]]
    return result.reshape(_CELLS, _CELLS)


def _fit(height: Floats, known: Bools, terms: Floats) -> tuple[Floats, Floats]:
    """Fit terms (k, cells, cells) robustly; return coefficients (k,) and residuals (n,)."""
    rows, target = terms[:, known].T, height[known]
    weight = np.ones(len(target))
    values, residual = np.zeros(len(terms)), target
    for _ in range(4):
        values[:] = np.linalg.lstsq(rows * weight[:, None], target * weight, rcond=None)[0]
        residual = target - rows @ values
        scale = 3 * max(mad_sigma(residual), 5e-4)
        weight = 1 / (1 + (residual / scale) ** 2)
    return values, residual


def _cost(residual: Floats) -> float:
    return float(np.sum(np.minimum(np.abs(residual), 0.01) ** 2))


def _levels(
    height: Floats, known: Bools, basis: Floats, inner: Bools
) -> tuple[Bools, float, float]:
    """Alternate the fit of a step and the choice of its cells; return cells, step and cost."""
    around = np.ones((3, 3))
    count = ndimage.convolve(known.astype(np.float64), around, mode="constant")
    for _ in range(8):
        values, residual = _fit(height, known, np.concatenate([basis, inner[None]]))
        left = height - np.einsum("kij,k->ij", basis, values[:-1])
        with np.errstate(invalid="ignore"):
            nearer = known & (np.abs(left - values[-1]) < np.abs(left))
        share = ndimage.convolve(nearer.astype(np.float64), around, mode="constant")
        chosen = np.where(count > 0, share > 0.5 * count, inner)
        if (chosen == inner).all():
            break
        inner = chosen
    return inner, float(values[-1]), _cost(residual)


def _jumps(height: Floats, inner: Bools) -> Floats:
    """Return the rise into the inner level over two cells, wherever these are on two levels."""
    found = []
    for level, label in ((height, inner), (height.T, inner.T)):
        rise = level[2:] - level[:-2]
        into = label[2:].astype(np.float64) - label[:-2]
        crossing = (into != 0) & np.isfinite(rise)
        found.append((rise * into)[crossing])
    return np.concatenate(found)
