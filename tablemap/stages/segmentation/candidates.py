"""The choice of the table among the surfaces that the views show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from tablemap.config import SegmentationConfig
from tablemap.errors import EstimationError
from tablemap.geometry import Floats
from tablemap.stages.segmentation.groups import Group, grouped
from tablemap.stages.segmentation.result import TableCandidate
from tablemap.stages.segmentation.surfaces import CELL_M, find_patches, hull, surroundings
from tablemap.stages.segmentation.views import SampledView, look
from tablemap.stages.snapshots import Snapshot
from tablemap.words import counted

STRIDE_PX = 2
TIE = 0.7  # of the best candidate's weight: from here on another one is nearly as likely
_MOST_CANDIDATES = 12  # surfaces that are reported: further ones are hardly tables
_FULL_AREA = 0.15  # square metres in one view: from here on a surface counts as well seen
_GAZE = 0.8  # metres beside the optical axis: there a look counts by a third


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
            f"the floor, found none in {counted(len(views), 'view')}; point the camera at the "
            "table, or widen segmentation.lowest and segmentation.highest"
        )
    groups = grouped(patches)
    first = [_weigh(group, config) for group in groups]
    below = [_support(k, groups, first) for k in range(len(groups))]
    weighed = []
    for k, (group, candidate) in enumerate(zip(groups, first, strict=True)):
        lower = below[k]
        carried = [other for other, under in zip(groups, below, strict=True) if under == k]
        if lower is not None:
            candidate = _lying_on(candidate, first[lower])
        elif carried and candidate.reason is not None:
            candidate = _weigh(_uncovered(group, carried, views), config)
        rise = min((thing.height - group.height for thing in carried), default=None)
        weighed.append(replace(candidate, rise=rise))
    weighed = [_at_a_table(candidate, weighed) for candidate in weighed]
    candidates = likeliest_first(weighed)
    best = replace(candidates[0], chosen=True)
    return (best, *candidates[1:_MOST_CANDIDATES])


def likeliest_first(candidates: list[TableCandidate]) -> list[TableCandidate]:
    """Sort candidates by weight; of nearly equal ones, the first has no front below it."""
    ranked = sorted(candidates, key=lambda c: -c.weight)
    if ranked[0].is_closed:
        open_ones = [c for c in ranked if not c.is_closed and c.weight >= TIE * ranked[0].weight]
        ranked = open_ones[:1] + [c for c in ranked if c not in open_ones[:1]]
    return ranked


def _support(k: int, groups: list[Group], candidates: list[TableCandidate]) -> int | None:
    """Return the surface on which the k-th one lies, like the lid of a box on a table, if any.

    A box that covers most of a small top leaves slivers of it. They lie all round the box, and in
    each view near it. A top over seats is open below, and a box is not.
    """
    upper, mine = candidates[k], shapely.Polygon(candidates[k].hull)
    for index, (group, lower) in enumerate(zip(groups, candidates, strict=True)):
        rise = upper.height - lower.height
        if not _LEAST_RISE < rise < _LARGEST_RISE or len(lower.views) < 2:
            continue
        extents = [shapely.Polygon(lower.hull)]
        seen = sum(patch.area for patch in group.patches)
        covering = sum(patch.area for patch in groups[k].patches)
        if (rise < _FLAT or (rise < _BOX and upper.is_closed)) and seen > _LEAST_SHOWN * covering:
            extents.append(group.shape)
        inside = max(e.buffer(_BESIDE).intersection(mine).area for e in extents)
        if inside > _ON_SHARE * mine.area:
            return index
    return None


def _lying_on(candidate: TableCandidate, lower: TableCandidate) -> TableCandidate:
    """Lower the weight of a surface that lies on another one."""
    reason = f"it lies on a surface that is {lower.height:.2f} m high"
    reasons = "; ".join(each for each in (candidate.reason, reason) if each)
    return replace(candidate, weight=_ON_WEIGHT * candidate.weight, reason=reasons)


def _at_a_table(candidate: TableCandidate, others: list[TableCandidate]) -> TableCandidate:
    """Lower the weight of a seat: a small or doubtful surface beside the larger top of a table.

    A camera that looks at the table from near by sees all of a seat, while the larger top is cut by
    the image's border. So the seat would be the better seen one.
    """
    if candidate.reason is None and candidate.area > _SEAT_AREA:
        return candidate
    mine = shapely.Polygon(candidate.hull)
    for other in others:
        rise = other.height - candidate.height
        is_table = other.reason is None and other.area > _TABLE_AREAS * candidate.area
        if not (is_table and _SEAT_UNDER[0] < rise < _SEAT_UNDER[1]):
            continue
        if mine.distance(shapely.Polygon(other.hull)) < _SEAT_BESIDE:
            weight = _SEAT_WEIGHT * candidate.weight
            if candidate.reason is None:
                return replace(candidate, weight=weight)
            beside = f"it lies as a seat does beside a larger surface, {other.height:.2f} m high"
            return replace(candidate, weight=weight, reason=f"{candidate.reason}; {beside}")
    return candidate


def seats_beside(seat: TableCandidate, table: TableCandidate) -> bool:
    """Tell whether a surface is as small and low as a seat at the other one.

    However little was seen of the other one: a camera that looks at a chair hardly sees its table.
    """
    rise = table.height - seat.height
    if seat.area > _SEAT_AREA or not _SEAT_UNDER[0] < rise < _SEAT_UNDER[1]:
        return False
    return bool(
        not table.is_closed
        and shapely.Polygon(seat.hull).distance(shapely.Polygon(table.hull)) < _SEAT_BESIDE
    )


_SEAT_UNDER = (0.15, 0.45)  # metres from a seat up to the top of its table
_SEAT_BESIDE = 0.5  # metres from the table: chairs are pushed back
_SEAT_AREA = 0.28  # square metres: a larger surface, against which nothing speaks, is no seat
_TABLE_AREAS, _SEAT_WEIGHT = 2.0, 0.3


def _uncovered(group: Group, carried: list[Group], views: list[SampledView]) -> Group:
    """Judge a surface as if nothing lay on it: what lies on it hides it, and rises at its slivers.

    Each view gets one patch: all cells of the surface, and of the things, that views agree on.
    """
    cells = np.concatenate([_common_cells(each) for each in (group, *carried)])
    shape = hull(cells)
    whole = Group()
    for view in views:
        mine = [patch for patch in group.patches if patch.view == view.snapshot.index]
        if mine:
            here = view.snapshot.map_from_base.inverse().apply(cells)
            open_share, walled = surroundings(view, here, group.height)
            whole.add(
                replace(
                    max(mine, key=lambda patch: patch.area),
                    area=float(shape.area),
                    cells=cells,
                    gaze=min(patch.gaze for patch in mine),
                    open_share=open_share,
                    walled_share=walled,
                )
            )
    return whole


_LEAST_RISE, _LARGEST_RISE = 0.012, 0.35  # metres: heights of things on a table
_FLAT, _BOX = 0.06, 0.2  # metres: lower than any seat under a top, and lower than a usual one
_LEAST_SHOWN = 0.25  # of what covers a top: so much of the top itself is seen
_BESIDE = 0.08  # metres: errors of localised poses widen a surface by so much
_ON_SHARE, _ON_WEIGHT = 0.7, 0.1


def _weigh(group: Group, config: SegmentationConfig) -> TableCandidate:
    """Weigh a surface by the views of it, their spread round it, and its likeness to a table."""
    cells = _common_cells(group)
    shape = hull(cells)
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
_OPEN = 0.5  # a larger one is a table's: chairs and legs hide some of it
_FRONTED = 0.02  # share of tables among surfaces with a front down to the floor


def _common_cells(group: Group) -> Floats:
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
        likeness *= max(_FRONTED, min(1.0, openness / _OPEN) ** 2)
        if openness < _CLOSED:
            reasons.append(f"a front closes the space under it (open share {openness:.2f})")
    if walled > 0.35:
        likeness *= max(0.15, 1.35 - walled)
        reasons.append(
            f"something rises at {100 * walled:.0f} % of its rim, as at a seat or a shelf"
        )
    if area < config.small_area:
        likeness *= area / config.small_area
        reasons.append(f"small: {area:.2f} m2")
    if height > config.high:
        likeness *= 0.5
        reasons.append(f"high: {height:.2f} m")
    return reasons, float(likeness)
