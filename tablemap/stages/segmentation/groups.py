"""Surfaces of several views grouped into one, with things that lie on a surface apart from it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely

from tablemap.stages.segmentation.surfaces import MERGE_HEIGHT, Patch

# Limits for patches of different views to be one surface, if heights agree (`MERGE_HEIGHT`).
_MERGE_OVERLAP = 0.15  # least share of the smaller patch that the other covers
_MERGE_GAP = 0.1  # metres, largest gap between two ends of a surface
# Levels within a group: books on a top rise no more than the heights of views may differ.
_LEVEL_STEP, _LEVEL_WIDTH = 0.015, 0.004  # metres between levels, and their width (sigma)
_LEVEL_VIEWS = 2  # so many views must show two levels at once


@dataclass(eq=False)
class Group:
    """Patches that probably are one surface.

    - ``shape``: their common hull in the map
    - ``height``: their area-weighted mean height, metres
    """

    patches: list[Patch] = field(default_factory=list)
    shape: shapely.Geometry = field(default_factory=shapely.Polygon)
    height: float = 0.0

    def add(self, patch: Patch) -> None:
        """Take in one more patch."""
        self.patches.append(patch)
        areas = [p.area for p in self.patches]
        self.height = float(np.average([p.height for p in self.patches], weights=areas))
        self.shape = shapely.unary_union([self.shape, patch.shape]).convex_hull


def grouped(patches: list[Patch]) -> list[Group]:
    """Group patches that overlap in the map at one height, largest first.

    The poses are those of the localisation, with errors of centimetres to decimetres. A patch joins
    the group that it overlaps most. In the end, groups that overlap widely are joined. Patches that
    one view saw apart, such as a seat at the table, stay apart. Last, a group whose patches lie at
    several levels is divided.
    """
    groups: list[Group] = []
    for patch in sorted(patches, key=lambda p: -p.area):
        best, best_overlap = None, _MERGE_OVERLAP
        for group in groups:
            if abs(group.height - patch.height) > MERGE_HEIGHT:
                continue
            overlap = _overlap(group.shape, patch.shape)
            if overlap > best_overlap and not _apart(group.patches, [patch]):
                best, best_overlap = group, overlap
        if best is None:
            best = Group()
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
    return [level for group in groups for level in _levels(group)]


def _levels(group: Group) -> list[Group]:
    """Divide a group into its levels: a top, and flat things that lie on it.

    Errors of a view's height make no levels: two views at least must show both at once.
    """
    heights = np.array([patch.height for patch in group.patches])
    areas = np.array([patch.area for patch in group.patches])
    kernel = np.exp(-0.5 * ((heights[:, None] - heights) / _LEVEL_WIDTH) ** 2)
    density = kernel @ areas
    modes: list[float] = []
    for height in heights[np.argsort(-density, kind="stable")].tolist():
        if all(abs(height - mode) >= _LEVEL_STEP for mode in modes):
            modes.append(height)
    if len(modes) == 1:
        return [group]
    nearest = np.abs(heights[:, None] - np.array(modes)).argmin(axis=1)
    levels: list[Group] = []
    for level_at in np.argsort(modes, kind="stable").tolist():
        own = [p for p, at in zip(group.patches, nearest.tolist(), strict=True) if at == level_at]
        if levels:
            shared = {p.view for p in levels[-1].patches} & {p.view for p in own}
            if len(shared) < _LEVEL_VIEWS:
                own = levels.pop().patches + own
        level = Group()
        for patch in own:
            level.add(patch)
        levels.append(level)
    return levels


def _are_one(first: Group, second: Group) -> bool:
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
