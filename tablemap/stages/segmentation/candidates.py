"""Surfaces of several views grouped into one, and the choice of the table among them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import shapely

from tablemap.config import SegmentationConfig
from tablemap.errors import EstimationError
from tablemap.geometry import Floats
from tablemap.stages.segmentation.result import TableCandidate
from tablemap.stages.segmentation.surfaces import CELL_M, MERGE_HEIGHT, Patch, find_patches
from tablemap.stages.segmentation.views import SampledView, look
from tablemap.stages.snapshots import Snapshot

STRIDE_PX = 2
_MOST_CANDIDATES = 12  # surfaces that are reported: further ones are hardly tables
_FULL_AREA = 0.15  # square metres in one view: from here on a surface counts as well seen
_GAZE = 0.8  # metres beside the optical axis: there a look counts by a third
# Limits for patches of different views to be one surface, if heights agree (`MERGE_HEIGHT`).
_MERGE_OVERLAP = 0.15  # least share of the smaller patch that the other covers
_MERGE_GAP = 0.1  # metres, largest gap between two ends of a surface


@dataclass(eq=False)
class _Group:
    """Patches that probably are one surface; ``shape`` is their common hull."""

    patches: list[Patch] = field(default_factory=list)
    shape: shapely.Geometry = field(default_factory=shapely.Polygon)

    @property
    def height(self) -> float:
        """The area-weighted mean height in metres."""
        areas = [p.area for p in self.patches]
        return float(np.average([p.height for p in self.patches], weights=areas))

    def add(self, patch: Patch) -> None:
        """Take in one more patch."""
        self.patches.append(patch)
        self.shape = shapely.unary_union([self.shape, _hull(patch.cells)]).convex_hull


def find_tables(
    snapshots: tuple[Snapshot, ...], *, config: SegmentationConfig
) -> tuple[TableCandidate, ...]:
    """Return all candidate tables, best first, the first marked as chosen.

    Raises `EstimationError` if no view shows a horizontal surface at a table's height.
    """
    return rank_tables([look(s, stride=STRIDE_PX) for s in snapshots], config)


def rank_tables(views: list[SampledView], config: SegmentationConfig) -> tuple[TableCandidate, ...]:
    """Do the same as `find_tables`, with prepared views."""
    patches = [patch for view in views for patch in find_patches(view, config)]
    if not patches:
        raise EstimationError(
            f"Expected a horizontal surface between {config.lowest} and {config.highest} m above "
            f"the floor, found none in {len(views)} views; point the camera at the table, or "
            "widen segmentation.lowest and segmentation.highest"
        )
    weighed = [_weigh(group, config) for group in _group(patches)]
    candidates = sorted((_lying_on(c, weighed) for c in weighed), key=lambda c: -c.weight)
    best = replace(candidates[0], chosen=True)
    return (best, *candidates[1:_MOST_CANDIDATES])


def _lying_on(candidate: TableCandidate, others: list[TableCandidate]) -> TableCandidate:
    """Lower the weight of a surface that lies on another one, like the lid of a box on a table."""
    mine = shapely.Polygon(candidate.hull)
    for other in others:
        if not _LEAST_RISE < candidate.height - other.height < _LARGEST_RISE:
            continue
        below = shapely.Polygon(other.hull).buffer(_BESIDE)
        if len(other.views) >= 2 and below.intersection(mine).area > _ON_SHARE * mine.area:
            reason = f"it lies on a surface that is {other.height:.2f} m high"
            reasons = "; ".join(each for each in (candidate.reason, reason) if each)
            return replace(candidate, weight=_ON_WEIGHT * candidate.weight, reason=reasons)
    return candidate


_LEAST_RISE, _LARGEST_RISE = 0.015, 0.35  # metres: heights of things on a table
_BESIDE = 0.08  # metres: errors of localised poses widen a surface by so much
_ON_SHARE, _ON_WEIGHT = 0.7, 0.1


def _hull(points: Floats) -> shapely.Geometry:
    return shapely.MultiPoint(points).convex_hull.buffer(CELL_M / 2)


def _group(patches: list[Patch]) -> list[_Group]:
    """Group patches that overlap in the map at one height, largest first.

    The poses are those of the localisation, with errors of centimetres to decimetres. A patch joins
    the group that it overlaps most. In the end, groups that overlap widely are joined. Patches that
    one view saw apart, such as a seat at the table, stay apart.
    """
    groups: list[_Group] = []
    for patch in sorted(patches, key=lambda p: -p.area):
        shape = _hull(patch.cells)
        best, best_overlap = None, _MERGE_OVERLAP
        for group in groups:
            if abs(group.height - patch.height) > MERGE_HEIGHT:
                continue
            overlap = _overlap(group.shape, shape)
            if overlap > best_overlap and not _apart(group.patches, [patch]):
                best, best_overlap = group, overlap
        if best is None:
            best = _Group()
            groups.append(best)
        best.add(patch)
    joined = True
    while joined:
        joined = False
        for i, first in enumerate(groups):
            for second in groups[i + 1 :]:
                if _are_one(first, second):
                    for patch in second.patches:
                        first.add(patch)
                    groups.remove(second)
                    joined = True
                    break
            if joined:
                break
    return groups


def _are_one(first: _Group, second: _Group) -> bool:
    """Tell whether two groups are one surface: they overlap, or they touch and no gap was seen.

    Opposite views of a long table may each show one end, and clutter may divide the table in every
    view. Two surfaces stay apart if a view saw through a gap between them.
    """
    if abs(first.height - second.height) > MERGE_HEIGHT:
        return False
    if _apart(first.patches, second.patches):
        return False
    if _overlap(first.shape, second.shape) > 2 * _MERGE_OVERLAP:
        return True
    return float(first.shape.distance(second.shape)) < _MERGE_GAP


def _apart(first: list[Patch], second: list[Patch]) -> bool:
    """Tell whether views of both groups saw through a gap between most pairs of patches."""
    pairs = [(p, q) for p in first for q in second if p.view == q.view]
    return 2 * sum(q.number in p.parted for p, q in pairs) > len(pairs)


def _overlap(first: shapely.Geometry, second: shapely.Geometry) -> float:
    """Return the share of the smaller shape that lies in the other."""
    smaller = min(first.area, second.area)
    return float(first.intersection(second).area / smaller) if smaller > 0 else 0.0


def _weigh(group: _Group, config: SegmentationConfig) -> TableCandidate:
    """Weigh a surface by the views of it, their spread round it, and its likeness to a table."""
    cells = _common_cells(group)
    shape = _hull(cells)
    centre = np.array(shape.centroid.coords[0])
    views = sorted({p.view for p in group.patches})
    looks, bearings, opens, walls, areas = [], [], [], [], []
    for view in views:
        mine = [p for p in group.patches if p.view == view]
        area = sum(p.area for p in mine)
        gaze = min(p.gaze for p in mine)
        looks.append(min(area / _FULL_AREA, 1.0) * np.exp(-((gaze / _GAZE) ** 2)))
        away = mine[0].camera - centre
        bearings.append(away / max(float(np.linalg.norm(away)), 1e-6))
        largest = max(mine, key=lambda p: p.area)
        if largest.open_share is not None:
            opens.append(largest.open_share)
        walls.append(largest.walled_share)
        areas.append(area)
    looked = np.array(looks) + 1e-3
    mean_bearing = (np.array(bearings) * looked[:, None]).sum(axis=0) / looked.sum()
    spread = float(1.0 - np.linalg.norm(mean_bearing)) if len(views) > 1 else 0.0
    openness = float(np.median(opens)) if opens else None
    walled = float(np.median(walls))
    is_closed = openness is not None and openness < _CLOSED
    reasons, likeness = _likeness(openness, walled, max(areas), group.height, config)
    weight = float(looked.sum() * (0.5 + spread) * likeness)
    ring = np.array(shapely.geometry.polygon.orient(shape).exterior.coords)[:-1]
    return TableCandidate(
        x=float(centre[0]),
        y=float(centre[1]),
        height=group.height,
        area=float(len(cells) * CELL_M**2),
        views=tuple(views),
        spread=spread,
        weight=weight,
        hull=ring,
        chosen=False,
        reason="; ".join(reasons) or None,
        is_closed=is_closed,
    )


_CLOSED = 0.25  # a smaller open share of the space under a surface is a front


def _common_cells(group: _Group) -> Floats:
    """Return the cells (n, 2) that at least two views saw; all cells of fewer than three views."""
    views = {p.view for p in group.patches}
    keys = np.concatenate(
        [np.unique(np.floor(p.cells / CELL_M).astype(np.int64), axis=0) for p in group.patches]
    )
    cells, counts = np.unique(keys, axis=0, return_counts=True)
    agreed = cells[counts >= 2] if len(views) >= 3 else cells
    if len(agreed) < 10:
        agreed = cells
    places: Floats = (agreed + 0.5) * CELL_M
    return places


def _likeness(
    openness: float | None, walled: float, area: float, height: float, config: SegmentationConfig
) -> tuple[list[str], float]:
    """Return the reasons against a table, and a factor from 0 to 1 on the weight."""
    reasons = []
    likeness = 1.0
    if openness is None:
        likeness *= 0.6
        reasons.append("the space under it was not seen")
    else:
        likeness *= 0.1 + 0.9 * min(1.0, openness / 0.5)
        if openness < _CLOSED:
            reasons.append(f"a front closes the space under it (open share {openness:.2f})")
    if walled > 0.35:
        likeness *= max(0.15, 1.35 - walled)
        reasons.append(f"something rises at {walled:.0%} of its rim, as at a seat or a shelf")
    if area < config.small_area:
        likeness *= area / config.small_area
        reasons.append(f"small: {area:.2f} m2")
    if height > config.high:
        likeness *= 0.5
        reasons.append(f"high: {height:.2f} m")
    return reasons, float(likeness)
