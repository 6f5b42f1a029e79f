"""The top's height: one joint figure of all views, and each view's own plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from tablemap.config import SegmentationConfig, SensorsConfig
from tablemap.geometry import Bools, Floats
from tablemap.masks import crowded, opened, shrunk
from tablemap.robust import geman_mcclure, tukey
from tablemap.stages.segmentation.result import TableCandidate
from tablemap.stages.segmentation.surfaces import convex
from tablemap.stages.segmentation.views import LEAST_UPWARD, SampledView, inside, tolerance

BIN_M = 0.002
SEARCH_M = 0.06
KNOWN_M = 0.012
_APART_M, _APART_SIGMAS = 0.012, 3.0
LEAST_PIXELS = 150
BLOCK_PX = 32.0
_GATE = 0.025  # metres: a view's top lies at least within this distance of the joint height


@dataclass(frozen=True)
class Plane:
    """The top in one view, in its base: z = height + a (x - x0) + b (y - y0).

    (x0, y0) is the middle of the part that the view saw; a and b are small.
    """

    height: float
    a: float
    b: float
    x0: float = 0.0
    y0: float = 0.0

    def at(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the plane's (h, w) height at the places of (h, w, 3) points."""
        x, y = points[..., 0] - np.float32(self.x0), points[..., 1] - np.float32(self.y0)
        return np.float32(self.height) + np.float32(self.a) * x + np.float32(self.b) * y


@dataclass(frozen=True)
class Height:
    """A height in metres with its standard deviation, and the views' own planes by snapshot index.

    ``scatter`` is the standard deviation between views, metres. ``other_level`` is the height of a
    second level, a little lower, that may be the top instead; None if there is none.
    ``other_outline`` (n, 2), metres in the map, has what was seen of it. ``elsewhere`` has the
    heights in the views whose surface at the table's place is at another one.
    """

    value: float
    sigma: float
    planes: dict[int, Plane]
    scatter: float
    other_level: float | None = None
    other_outline: Floats | None = None
    elsewhere: tuple[float, ...] = ()


def region(view: SampledView, candidate: TableCandidate, reach: float, among: Bools) -> Bools:
    """Return which of the pixels ``among`` lie within reach of the candidate, by localisation."""
    base_from_map = view.snapshot.map_from_base.inverse()
    hull = np.asarray(base_from_map.apply(candidate.hull))
    area = shapely.MultiPoint(hull).convex_hull.buffer(reach, quad_segs=2)
    return inside(area, view.points, among)


def joint_height(
    views: list[SampledView],
    candidate: TableCandidate,
    config: SegmentationConfig,
    sensors: SensorsConfig,
) -> Height | None:
    """Estimate the height from all views: the histogram's mode, then each view, then their mean.

    Pixels nearer to a thing that lies on the surface than to the surface are left out. Returns None
    if no view shows enough of the surface.
    """
    samples, places = [], []
    clear = SEARCH_M if candidate.rise is None else min(0.5 * candidate.rise, SEARCH_M)
    for view in views:
        flat = _level_about(view, candidate.height, SEARCH_M)
        flat &= view.points[..., 2] < np.float32(candidate.height + clear)
        samples.append(region(view, candidate, config.reach, flat))
        places.append(region(view, candidate, 0.0, samples[-1]))
    mode = _joint_mode(views, samples, candidate.height)
    if mode is None:
        return None
    level = _lowest_level(views, samples, places, mode)
    samples = [
        near & (view.points[..., 2] < np.float32(level.height + level.clear))
        for view, near in zip(views, samples, strict=True)
    ]
    planes: dict[int, Plane] = {}
    weights: list[float] = []
    elsewhere: list[float] = []
    for view, near, place in zip(views, samples, places, strict=True):
        found = _view_height(view, near, place, level.height, sensors)
        if found is None:
            elsewhere += _level_elsewhere(view, candidate)
        else:
            planes[view.snapshot.index], sigma, pixels = found
            weights.append(min(pixels, 20_000) / (sigma**2 + 0.002**2))
    if not planes:
        return None
    heights = np.array([plane.height for plane in planes.values()])
    weight = np.array(weights)
    value = float(np.average(heights, weights=weight))
    for gate in (0.02, 0.012, 0.008):  # a view on another surface must not pull the rest
        robust = geman_mcclure(((heights - value) / gate) ** 2, weight)
        value = float(np.average(heights, weights=robust))
    effective = float(robust.sum() ** 2 / np.square(robust).sum())
    scatter = float(np.sqrt(np.average((heights - value) ** 2, weights=robust)))
    # If a view's height is off by more than this, the view measured a thing on the top: a book, a
    # tray.
    apart = max(_APART_SIGMAS * scatter, _APART_M)
    elsewhere += [float(each) for each in heights if abs(each - value) >= apart]
    planes = {i: plane for i, plane in planes.items() if abs(plane.height - value) < apart}
    noise = [
        float(np.nanmedian(v.sigma[m])) for v, m in zip(views, samples, strict=True) if m.any()
    ]
    blocks = sum(int(m.sum()) * v.stride**2 for v, m in zip(views, samples, strict=True))
    floor = float(np.median(noise)) / np.sqrt(max(blocks / BLOCK_PX**2, 1.0)) if noise else 0.0
    between = scatter / np.sqrt(max(effective - 1.0, 1.0))
    return Height(
        value=value,
        sigma=float(np.hypot(between, floor)),
        planes=planes,
        scatter=scatter,
        other_level=level.other,
        other_outline=level.other_outline,
        elsewhere=tuple(elsewhere),
    )


def _level_about(view: SampledView, height: float, within: float) -> Bools:
    """Return the pixels of level surfaces within so many metres of a height."""
    with np.errstate(invalid="ignore"):
        near = np.abs(view.points[..., 2] - np.float32(height)) < within
        level: Bools = near & (view.upward > LEAST_UPWARD)
    return level


def _level_elsewhere(view: SampledView, candidate: TableCandidate) -> list[float]:
    """Return the height of what is level at the candidate's place, if the view sees plenty."""
    place = region(view, candidate, 0.0, _level_about(view, candidate.height, _RAISED_M))
    if int(place.sum()) * view.stride**2 < _PLENTY:
        return []
    return [float(np.median(view.points[..., 2][place]))]


_RAISED_M = 0.3
_PLENTY = 1000  # pixels of a level surface


def _joint_mode(views: list[SampledView], samples: list[Bools], height: float) -> float | None:
    """Return the height on which most pixels of all views agree; every view counts the same."""
    bins = round(2 * SEARCH_M / BIN_M)
    total = np.zeros(bins)
    widths = []
    for view, near in zip(views, samples, strict=True):
        if int(near.sum()) < LEAST_PIXELS:
            continue
        z = view.points[..., 2][near]
        index = np.clip(((z - height + SEARCH_M) / BIN_M).astype(np.int64), 0, bins - 1)
        histogram = np.bincount(index, minlength=bins).astype(np.float64)
        total += histogram / np.sqrt(histogram.sum())
        widths.append(float(np.median(view.sigma[near])))
    if not widths:
        return None
    width = max(0.004, 1.5 * float(np.median(widths))) / BIN_M
    smooth = ndimage.gaussian_filter1d(total, width, mode="constant")
    # The candidate's own height is known to a centimetre or two. A book that covers most of a small
    # top lies higher than that, and so does not win.
    offset = (np.arange(bins) + 0.5) * BIN_M - SEARCH_M
    smooth = smooth * np.exp(-0.5 * (offset / KNOWN_M) ** 2)
    return float(height - SEARCH_M + (int(np.argmax(smooth)) + 0.5) * BIN_M)


@dataclass(frozen=True)
class _Level:
    """The height of the top, how far above it a pixel may be of the top, and a doubtful level."""

    height: float
    clear: float = SEARCH_M
    other: float | None = None
    other_outline: Floats | None = None


def _lowest_level(
    views: list[SampledView], samples: list[Bools], places: list[Bools], mode: float
) -> _Level:
    """Return the level of the top near a mode.

    A tray or a book may cover most of a small top, a centimetre above it. Then each view shows two
    levels with hardly a pixel between them, as a bent depth image does not. The lower one is the
    top if what is seen of it lies all round the things on it. If it lies at one end of the table's
    ``places``, it may also be another surface, and is doubtful.
    """
    bins = round(2 * _LEVELS_M / _FINE_M)
    shares, seen = [], []
    for view, near in zip(views, samples, strict=True):
        offset = view.points[..., 2][near].astype(np.float64) - mode + _LEVELS_M
        index = (offset / _FINE_M).astype(np.int64)[(offset >= 0) & (offset < 2 * _LEVELS_M)]
        if len(index) < LEAST_PIXELS:
            continue
        share = np.bincount(index, minlength=bins) / len(index)
        width = max(_FINE_M, float(np.median(view.sigma[near]))) / _FINE_M
        shares.append(ndimage.gaussian_filter1d(share, width, mode="constant"))
        seen.append((view, near))
    if len(shares) < _LEAST_VIEWS:
        return _Level(mode)
    together = np.array(shares)
    total = together.mean(axis=0)
    peaks = 1 + np.flatnonzero((total[1:-1] > total[:-2]) & (total[1:-1] >= total[2:]))
    peaks = peaks[total[peaks] > _LEAST_SHARE * total.max()]
    heights = mode - _LEVELS_M + (peaks + 0.5) * _FINE_M
    doubtful = None
    for k in range(len(peaks) - 1):
        if not shows_both(together, int(peaks[k]), int(peaks[k + 1])):
            continue
        low, high = float(heights[k]), float(heights[k + 1])
        if _is_round(seen, low, high):
            return _Level(low, 0.5 * (high - low))
        if low < mode - _LEVEL_M and _is_within(views, samples, places, low):
            doubtful = low
    if doubtful is None:
        return _Level(mode)
    within = [(v, near & place) for v, near, place in zip(views, samples, places, strict=True)]
    outline = shapely.get_coordinates(convex(_places_at(within, doubtful)))
    return _Level(mode, other=doubtful, other_outline=outline)


def shows_both(shares: Floats, low: int, high: int) -> bool:
    """Tell whether most views (n, bins) have two levels with a gap between them.

    Both must be levels of that view: not a few stray pixels beside a far larger level of its own.
    """
    near = max(1, (high - low) // 3)
    lower = shares[:, max(low - near, 0) : low + near + 1].max(axis=1)
    upper = shares[:, high - near : high + near + 1].max(axis=1)
    smaller = np.minimum(lower, upper)
    gap = shares[:, low : high + 1].min(axis=1)
    both = (smaller > _LEAST_SHARE * shares.max(axis=1)) & (gap < _GAP_SHARE * smaller)
    return int(both.sum()) >= max(_LEAST_VIEWS, len(shares) / 2)


def _is_round(seen: list[tuple[SampledView, Bools]], low: float, high: float) -> bool:
    """Tell whether the lower level reaches round the upper one, over all views, in the map.

    A thing at the rim hides a corner of the top. A level at two opposite ends is that of leaves.
    """
    extents, levels = [], []
    for height in (low, high):
        points = _places_at(seen, height)
        if not len(points):
            return False
        levels.append(points)
        extents.append(convex(points))
    lower, upper = extents
    if lower.buffer(_ROUND_M).intersection(upper).area <= _ROUND_SHARE * upper.area:
        return False
    return _gaps(levels[0] - shapely.get_coordinates(upper.centroid)) < 2


def _places_at(seen: Sequence[tuple[SampledView, Bools]], height: float) -> Floats:
    """Return places (n, 2) in the map of some pixels of a level, as localised."""
    places = []
    for view, near in seen:
        level = _at(view, near, height)
        few = view.points[level][:: max(1, int(level.sum()) // 500), :2]
        places.append(view.snapshot.map_from_base.apply(few.astype(np.float64)))
    return np.concatenate(places)


def _gaps(places: Floats) -> int:
    """Count the wide sectors about the origin in which none of the places (n, 2) lies."""
    turn = np.arctan2(places[:, 1], places[:, 0])
    sector = ((turn + np.pi) / (2 * np.pi) * _SECTORS).astype(int) % _SECTORS
    empty = np.bincount(sector, minlength=_SECTORS) < _EMPTY_SHARE * len(places)
    wide = np.array([np.roll(empty, -k)[:_WIDE_GAP].all() for k in range(_SECTORS)])
    return int((wide & ~np.roll(wide, 1)).sum())


_SECTORS, _WIDE_GAP = 36, 7  # a gap of 70 degrees
_EMPTY_SHARE = 0.0005


def _is_within(
    views: list[SampledView], samples: list[Bools], places: list[Bools], height: float
) -> bool:
    """Tell whether most of a level lies within the table's place."""
    inside = whole = 0
    for view, near, place in zip(views, samples, places, strict=True):
        level = _at(view, near, height)
        inside, whole = inside + int((level & place).sum()), whole + int(level.sum())
    return inside > _WITHIN_SHARE * whole


def _at(view: SampledView, near: Bools, height: float) -> Bools:
    """Return the pixels of a level, without single ones."""
    with np.errstate(invalid="ignore"):
        level = near & (np.abs(view.points[..., 2] - np.float32(height)) < _LEVEL_M)
    clustered: Bools = crowded(level, 4) & level
    return clustered


_LEVELS_M, _FINE_M = 0.03, 0.001
_LEVEL_M = 0.003  # metres about a level that belong to it
_LEAST_VIEWS = 2
_LEAST_SHARE = 0.15  # of the largest level's pixels: fewer are no level
_GAP_SHARE = 0.5  # of the smaller level's pixels: more between two levels make them one
_ROUND_M = 0.02
_ROUND_SHARE, _WITHIN_SHARE = 0.8, 0.7


def _view_height(
    view: SampledView,
    near: Bools,
    place: Bools,
    mode: float,
    sensors: SensorsConfig,
) -> tuple[Plane, float, int] | None:
    """Return one view's plane, the noise and the number of its pixels; None if there are too few.

    Only the connected surface that covers most of the table's ``place`` counts: a seat beside the
    table may have more pixels if it is close to the camera.
    """
    z = view.points[..., 2]
    gate = tolerance(view.sigma, _GATE)
    with np.errstate(invalid="ignore"):
        close = near & (np.abs(z - np.float32(mode)) < gate)
    labels, count = ndimage.label(opened(close, 3))
    if count == 0:
        return None
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    surface = labels > 0
    numbers, area = labels[surface], view.area_of(surface)
    at_place = area * place[surface]
    covered = 0.0 + np.bincount(numbers, weights=at_place, minlength=count + 1)
    covered += 0.1 * np.bincount(numbers, weights=area, minlength=count + 1)
    covered[sizes < LEAST_PIXELS] = 0.0
    best = int(np.argmax(covered))
    if covered[best] <= 0.0:
        return None
    mine = labels == best
    # The rim contains side faces and mixed pixels: leave it out if enough pixels remain.
    core = shrunk(mine, 5, outside=False)
    if int(core.sum()) >= LEAST_PIXELS:
        mine = core
    points = view.points[mine].astype(np.float64)
    noise = float(np.median(view.sigma[mine]))
    return _plane(points, noise, sensors), noise, int(mine.sum())


def _plane(points: Floats, noise: float, sensors: SensorsConfig) -> Plane:
    """Fit a plane to (n, 3) points, robustly, with a prior of zero tilt."""
    middle = np.median(points[:, :2], axis=0)
    arms = points[:, :2] - middle
    heights = points[:, 2]
    fit = np.array([float(np.median(heights)), 0.0, 0.0])
    rows = np.concatenate([np.ones((len(arms), 1)), arms], axis=1)
    gate = max(6 * noise, 0.008)
    tilt = np.deg2rad(sensors.calibrated_view_tilt_sigma_deg)
    # Errors of neighbouring pixels are correlated: a hundred count as one against the prior.
    prior = np.diag([0.0, 1 / tilt**2, 1 / tilt**2]) * 100 * (noise**2 + 0.002**2)
    for _ in range(6):
        residual = heights - rows @ fit
        weight = tukey(residual / gate)
        if weight.sum() < 1.0:
            break
        normal = rows.T @ (rows * weight[:, None]) + prior
        fit = np.linalg.solve(normal, rows.T @ (weight * heights))
    return Plane(float(fit[0]), float(fit[1]), float(fit[2]), float(middle[0]), float(middle[1]))
