"""Labels for every pixel of a view, relative to the chosen top."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from tablemap.config import SegmentationConfig
from tablemap.geometry import Bools, Floats, Ints
from tablemap.masks import crowded, grown, shrunk
from tablemap.stages.segmentation.height import Plane, region
from tablemap.stages.segmentation.result import Label, TableCandidate, ViewSegmentation
from tablemap.stages.segmentation.surfaces import convex
from tablemap.stages.segmentation.views import (
    LEAST_UPWARD,
    SampledView,
    inside,
    is_parted,
    tolerance,
    ways_to,
)
from tablemap.words import counted

FLOOR_M = 0.04
_LEAST_TOLERANCE, _MOST_TOLERANCE = 0.006, 0.035  # metres round the top's plane
STANDING_M = 0.06  # metres: a thing on the top begins less than this above it
RIM_M = 0.04
# The least share of level normals in a surface: few near its edges are level, and none on a wall.
_LEVEL_SHARE = 0.2
# The share of a surface that must lie within reach of the table's place to be part of the same top:
# if clutter connects it to the top, and if there is only missing depth between.
BRIDGED_SHARE, NEAR_SHARE = 0.3, 0.5
GAP_STEP_PX = 2
_PLACE_M = 0.05  # metres round the candidate's hull that are its place
_LEAST_PIXELS = 60
_OPENING_PX = 5  # takes two pixels from the rim of a surface, which are then given back
_TOUCHING_PX = 9  # a thing has pixels this close to the top that it stands on
MOST_SEEDS, SEED_SHARE = 3, 0.25  # surfaces that start a top: number, share of the best score


def label_view(
    view: SampledView, plane: Plane, candidate: TableCandidate, config: SegmentationConfig
) -> ViewSegmentation:
    """Label one view, given the top's plane in it; pixels between the view's are as these."""
    z = view.points[..., 2]
    valid = np.isfinite(z)
    band_width = np.minimum(
        tolerance(view.sigma, _LEAST_TOLERANCE),
        np.float32(_MOST_TOLERANCE),
    )
    above_plane = z - plane.at(view.points)
    with np.errstate(invalid="ignore"):
        in_band = np.abs(above_plane) <= band_width
        over = above_plane > band_width
        below = above_plane < -band_width
        floor = z < np.maximum(np.float32(FLOOR_M), 4 * view.sigma)
    surfaces = _surfaces(view, in_band)
    labels = np.full(z.shape, Label.UNKNOWN, dtype=np.uint8)
    labels[valid] = Label.FRONT
    labels[below] = Label.BEHIND
    labels[below & floor] = Label.FLOOR
    labels[in_band & grown(surfaces > 0, view.window(_OPENING_PX))] = Label.OTHER_TOP
    top = _top(view, surfaces, over, below, candidate, config)
    if view.snapshot.base_from_camera[2, 3] <= plane.height + 0.05:
        top = np.zeros_like(valid)
        reason: str | None = "the camera was not above the top"
    elif not top.any():
        reason = "no surface at the table's height near its place"
    else:
        top = in_band & grown(top, view.window(_OPENING_PX))
        share, pixels = float(top.mean()), int(top.sum()) * view.stride**2
        reason = (
            None
            if share >= config.least_top_share
            else f"only {counted(pixels, 'pixel')} ({100 * share:.2f} %) of the top could be seen"
        )
    if top.any():
        labels[top] = Label.TOP
        labels[_standing(view, top, over, above_plane)] = Label.ON_TOP
    return ViewSegmentation(
        index=view.snapshot.index,
        labels=view.whole(labels),
        sees_table=reason is None,
        reason=reason,
        height=plane.height if reason is None else None,
        top_pixels=int(top.sum()) * view.stride**2,
        tolerance=view.whole(band_width),
    )


def _surfaces(view: SampledView, in_band: Bools) -> NDArray[np.int32]:
    """Label the connected surfaces in the band, without walls and slivers (0)."""
    filled = crowded(in_band, 5) & in_band
    opening = view.window(_OPENING_PX)
    labels, count = ndimage.label(grown(shrunk(filled, opening), opening) & in_band)
    if count == 0:
        return np.zeros(in_band.shape, dtype=np.int32)
    inner = labels > 0
    numbers, upward = labels[inner], view.upward[inner]
    with np.errstate(invalid="ignore"):
        level = upward > LEAST_UPWARD
    sizes = np.bincount(numbers, minlength=count + 1)
    levels = np.bincount(numbers[level], minlength=count + 1)
    knowns = np.bincount(numbers[np.isfinite(upward)], minlength=count + 1)
    keep = (sizes >= _LEAST_PIXELS / view.stride**2) & (
        levels >= _LEVEL_SHARE * np.maximum(knowns, 1)
    )
    keep[0] = False
    kept: NDArray[np.int32] = np.where(keep[labels], labels, 0).astype(np.int32)
    return kept


def _top(
    view: SampledView,
    surfaces: NDArray[np.int32],
    over: Bools,
    below: Bools,
    candidate: TableCandidate,
    config: SegmentationConfig,
) -> Bools:
    """Return the surfaces of this top: the one at its place, and parts that clutter cut off.

    If the view saw through a gap between two surfaces of one height, the second one is another
    table. If clutter or missing depth lies between them, they are one top.
    """
    none = np.zeros(surfaces.shape, dtype=bool)
    count = int(surfaces.max()) if surfaces.size else 0
    if count == 0:
        return none
    known = surfaces > 0
    numbers, area = surfaces[known], view.area_of(known)

    def on(part: Bools) -> Floats:
        """Return the square metres (count + 1,) of each surface on a part of the image."""
        weights = area * part[known]
        return np.asarray(np.bincount(numbers, weights=weights, minlength=count + 1), np.float64)

    around = region(view, candidate, config.reach, known)
    place = region(view, candidate, min(_PLACE_M, config.reach), around)
    inside, near = on(place), on(around)
    whole = np.bincount(numbers, weights=area, minlength=count + 1)
    # Nearly all of the table's own surface lies within reach of its place; a neighbour's does not.
    score = (inside + 0.5 * near) * near / np.maximum(whole, 1e-9)
    if score.max() <= 0.0:
        return none
    close = np.flatnonzero(near > BRIDGED_SHARE * np.maximum(whole, 1e-9))
    if len(close) <= 1:
        top: Bools = surfaces == int(np.argmax(score))
        return top
    step = max(1, GAP_STEP_PX // view.stride)
    thin = surfaces[::step, ::step]
    thing = region(view, candidate, config.reach, over)
    bridges, _ = ndimage.label(grown(known | thing, view.window(_OPENING_PX))[::step, ::step])
    # One pixel below the plane is noise; four in a square are a gap.
    through = shrunk(below[::step, ::step], 2)
    seeds = np.argsort(-score)[:MOST_SEEDS]
    sets = []
    for seed in seeds[score[seeds] > SEED_SHARE * score.max()]:
        joined = _joined(int(seed), close, thin, bridges, through, near < NEAR_SHARE * whole)
        sets.append((float(score[joined].sum()), joined))
    _, best = max(sets, key=lambda entry: entry[0])
    result: Bools = np.isin(surfaces, best)
    return result


def _joined(
    main: int,
    close: Ints,
    thin: NDArray[np.int32],
    bridges: NDArray[np.int32],
    through: Bools,
    is_far: Bools,
) -> list[int]:
    """Return the surface ``main`` and those of ``close`` without a gap between.

    All images are thinned in the same way. ``is_far`` (by label) marks surfaces that only clutter
    may join.
    """
    top = thin == main
    result = [main]
    if not top.any():
        return result
    to_top = ways_to(top)
    bridge = np.bincount(bridges[top], minlength=2)
    bridge[0] = 0
    for k in close:
        other = thin == k
        if k == main or not other.any():
            continue
        led_over = float((bridges[other] == int(np.argmax(bridge))).mean()) > 0.5
        if is_far[k] and not led_over:
            continue
        # A cup in front of a chair touches both in the image: the pixels elsewhere between decide.
        gap = through & (thin == 0)
        if not is_parted(other, to_top, gap) and not is_parted(top, ways_to(other), gap):
            result.append(int(k))
    return result


def _standing(
    view: SampledView,
    top: Bools,
    over: Bools,
    above_plane: NDArray[np.float32],
) -> Bools:
    """Return the pixels above the plane that belong to things standing on the top."""
    rows, columns = np.nonzero(top)
    few = slice(None, None, max(1, len(rows) // 4000))
    thinned = view.points[rows[few], columns[few], :2].astype(np.float64)
    if len(thinned) < 3:
        return np.zeros_like(top)
    hull = convex(thinned)
    if hull.geom_type != "Polygon":
        return np.zeros_like(top)
    within_hull = inside(hull.buffer(RIM_M, quad_segs=2), view.points, over)
    if not within_hull.any():
        return np.zeros_like(top)
    depth = view.depth
    gap = np.float32(0.02) + np.float32(0.02) * depth
    with np.errstate(invalid="ignore"):
        cut = np.zeros_like(top)
        cut[:, 1:] |= np.abs(np.diff(depth, axis=1)) > gap[:, 1:]
        cut[1:] |= np.abs(np.diff(depth, axis=0)) > gap[1:]
    labels, count = ndimage.label(over & ~cut)
    if count == 0:
        return np.zeros_like(top)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    numbers = labels[within_hull]
    within = np.bincount(numbers, minlength=count + 1)
    with np.errstate(invalid="ignore"):
        low = (above_plane < STANDING_M) & grown(top, view.window(_TOUCHING_PX))
    touching = np.bincount(labels[low], minlength=count + 1)
    stands = (within >= 0.5 * sizes) & (touching > 0)
    stands[0] = False
    on_top = np.zeros_like(top)
    on_top[within_hull] = stands[numbers]
    near = view.window(_OPENING_PX)
    # Pixels on the cuts between regions follow their neighbours.
    standing: Bools = on_top | (over & within_hull & (labels == 0) & grown(on_top, near))
    return standing
