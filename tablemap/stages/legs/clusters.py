"""Things that stand under the top: places where silhouettes meet, and whether the things stayed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from tablemap.config import LegsConfig
from tablemap.geometry import Floats, Ints, wrap_angles
from tablemap.stages.legs.scans import Scans
from tablemap.stages.legs.silhouettes import Segments

_CELL = 0.01
_APART = 0.04  # metres: two narrow things with nearer middles are one
_BESIDE, _ANSWERS = 0.10, 0.8  # metres beside a place, share of beams there that must come back


@dataclass(frozen=True, eq=False)
class Cluster:
    """One thing that segments show.

    - ``centre``: (2,) metres in the map
    - ``size``: metres across
    - ``members``: indices into the segments
    - ``slender``: whether its silhouettes are whole; other things are wide (panels, boxes)
    """

    centre: Floats
    size: float
    members: Ints
    slender: bool


@dataclass(frozen=True)
class Persistence:
    """How many stops and drives hit a place, saw through it, or could not see it.

    ``lost`` counts those whose beams to the place alone came back with nothing: something black or
    bright stands there, or else a hole in what is behind it.
    """

    hit: int
    passed: int
    blocked: int
    lost: int

    @property
    def share(self) -> float:
        """The share that hit, among those that could hit."""
        return self.hit / max(self.hit + self.passed, 1)


def find_clusters(
    scans: Scans, points: Floats, segments: Segments, *, config: LegsConfig
) -> list[Cluster]:
    """Gather segments into things: first slender ones by their middles, then wide ones by touch."""
    usable = ~segments.wall & ~segments.between
    whole = usable & segments.low & segments.high & (segments.width <= config.largest_slender)
    clusters: list[Cluster] = []
    taken = np.zeros(len(segments), dtype=bool)
    wide = usable & (segments.width > config.largest_slender)
    wide_points, wide_rows = _points_of(points, segments, np.flatnonzero(wide))
    wide_tree = cKDTree(wide_points) if len(wide_points) else None
    for peak in _peaks(segments.centre[whole], np.ones(int(whole.sum()))):
        near = usable & ~taken & (np.linalg.norm(segments.centre - peak, axis=1) < 0.12)
        core = near & whole & (np.linalg.norm(segments.centre - peak, axis=1) < _APART)
        if not core.any():
            continue
        size = float(np.median(segments.width[core]))
        centre = np.median(segments.centre[core], axis=0)
        if wide_tree is not None:
            # A panel looks slender from its end, and wide from elsewhere.
            touching = wide_rows[wide_tree.query_ball_point(centre, 0.04)]
            if len(np.unique(segments.view[touching])) > 0.3 * len(np.unique(segments.view[core])):
                continue
        spread = np.linalg.norm(segments.centre - centre, axis=1)
        # The middle of a half hidden segment is off by up to half a width.
        members = near & (spread < np.where(whole, _APART, 0.5 * size + 0.03))
        taken |= members
        clusters.append(Cluster(centre, size, np.flatnonzero(members), slender=True))
    rest = np.flatnonzero(usable & ~taken)
    clusters += _touching(points, segments, rest)
    return clusters


def _peaks(centres: Floats, weight: Floats) -> Floats:
    """Return (k, 2) places where middles gather, densest first."""
    if not len(centres):
        return np.zeros((0, 2))
    corner = centres.min(axis=0) - 10 * _CELL
    cells = np.floor((centres - corner) / _CELL).astype(np.int64)
    shape = tuple(cells.max(axis=0) + 11)
    density = np.zeros(shape)
    np.add.at(density, (cells[:, 0], cells[:, 1]), weight)
    density = ndimage.gaussian_filter(density, 1.2, mode="constant")
    highest = ndimage.maximum_filter(density, size=7, mode="constant")
    at = np.argwhere((density == highest) & (density > 0.05))
    order = np.argsort(-density[at[:, 0], at[:, 1]], kind="stable")
    peaks: Floats = corner + (at[order] + 0.5) * _CELL
    return peaks


def _points_of(points: Floats, segments: Segments, chosen: Ints) -> tuple[Floats, Ints]:
    """Return the beam ends (n, 2) of the chosen segments, and each end's segment (n,)."""
    counts = segments.last[chosen] - segments.first[chosen] + 1
    rows = np.repeat(chosen, counts)
    beam = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return points[segments.view[rows], beam + segments.first[rows]], rows


def _touching(points: Floats, segments: Segments, chosen: Ints) -> list[Cluster]:
    """Join the remaining segments whose points touch: cells of 3 cm, neighbours included."""
    if not len(chosen):
        return []
    ends, rows = _points_of(points, segments, chosen)
    cells = np.floor(ends / 0.03).astype(np.int64)
    cells -= cells.min(axis=0) - 1
    grid = np.zeros(cells.max(axis=0) + 2, dtype=bool)
    grid[cells[:, 0], cells[:, 1]] = True
    labels, count = ndimage.label(grid, structure=np.ones((3, 3)))
    label = labels[cells[:, 0], cells[:, 1]]
    clusters = []
    for k in range(1, count + 1):
        own = ends[label == k]
        size = float(np.linalg.norm(np.ptp(own, axis=0)))
        middle = 0.5 * (own.min(axis=0) + own.max(axis=0))
        clusters.append(Cluster(middle, size, np.unique(rows[label == k]), slender=size < 0.2))
    return clusters


def persistence(scans: Scans, place: Floats, radius: float) -> Persistence:
    """Count the stops and drives whose beams ended at ``place``, passed it, or fell short.

    A scan hits if any beam within a centimetre of the silhouette ends at the place. A scan passes
    if beams through the inner half go on, end farther away, and none hits. A beam that came back
    with nothing says nothing of free space: chrome and black things give no return.
    """
    offset = place - scans.origins
    distance = np.hypot(offset[..., 0], offset[..., 1])
    bearing = np.arctan2(offset[..., 1], offset[..., 0])
    turn = np.abs(wrap_angles(bearing - scans.angles))
    aside = np.where(turn < 0.5, turn, np.inf) * distance
    through = (aside < radius + 0.01) & ~np.isnan(scans.ranges)
    inner = through & (aside < max(0.5 * radius, 0.003))
    off = scans.ranges - distance
    hit = (through & (np.abs(off) < radius + 0.05)).any(axis=1)
    beyond = np.isfinite(scans.ranges) & ~scans.bridged & (off > radius + 0.05)
    passed = (inner & beyond).any(axis=1) & ~hit
    blocked = (inner & (off < -radius - 0.05)).any(axis=1) & ~hit
    silent = (inner & (np.isinf(scans.ranges) | scans.bridged)).any(axis=1) & ~hit & ~passed
    beside = (aside > radius + 0.01) & (aside < radius + _BESIDE) & ~np.isnan(scans.ranges)
    answers = (beside & np.isfinite(scans.ranges)).sum(axis=1)
    lost = silent & (answers > _ANSWERS * beside.sum(axis=1))

    groups = len(scans.group_stops)
    hits = np.bincount(scans.groups, weights=hit, minlength=groups)
    passes = np.bincount(scans.groups, weights=passed, minlength=groups)
    blocks = np.bincount(scans.groups, weights=blocked, minlength=groups)
    losses = np.bincount(scans.groups, weights=lost, minlength=groups)
    seen = hits + passes > 0
    return Persistence(
        hit=int((seen & (hits >= passes)).sum()),
        passed=int((seen & (hits < passes)).sum()),
        blocked=int((~seen & (blocks > 0)).sum()),
        lost=int((~seen & (losses > 0)).sum()),
    )
