"""Which sides of an outline are measured, inferred or unseen, and priors for the unseen ones."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.spatial import cKDTree

from tablemap.config import SurfaceConfig
from tablemap.geometry import Floats
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.joint import Anchor, JointFit
from tablemap.stages.surface.shapes.sides import INFERRED, MEASURED, UNSEEN, Sight
from tablemap.stages.surface.shapes.straight import Sided

_STEP = 0.01  # metres between samples of a side
_REACH = 0.015  # metres: a sample with an edge point this near is seen
_LEAST_LENGTH = 4 * _REACH  # metres: one point alone shows half of it
_BOTH_ENDS = 2 / 3  # of its length: a side with a smaller spread was seen at one end only


@lru_cache(maxsize=16)  # a fit's sides are asked for by several steps, one after the other
def sights(fit: JointFit, evidence: Evidence, config: SurfaceConfig) -> tuple[Sight, ...]:
    """Return how much of each side the edge points of all views show.

    ``beyond`` is found only where the side's status depends on it.
    """
    result = []
    shown = (fit.side >= 0) & (np.abs(fit.distance) < 0.02) & (fit.misfit < 5)
    for index, piece in enumerate(fit.shape.pieces()):
        mine = fit.points[shown & (fit.side == index)]
        if not len(mine):
            result.append(Sight(0.0, 0.0, 0.0))
            continue
        samples, outward = _sampled(piece)
        near = cKDTree(mine).query(samples, distance_upper_bound=_REACH)[0] < _REACH
        seen = np.flatnonzero(near)
        spread = (seen[-1] - seen[0] + 1) / len(samples) if len(seen) else 0.0
        length = float(np.linalg.norm(np.diff(piece, axis=0), axis=1).sum())
        fraction = float(near.mean())
        sight = Sight(fraction, float(spread), fraction * length)
        if not _is_measured(sight, config) and _is_seen_in_part(sight, config):
            sight = replace(sight, beyond=_top_beyond(samples, outward, evidence))
        result.append(sight)
    return tuple(result)


def _is_measured(sight: Sight, config: SurfaceConfig) -> bool:
    return sight.fraction >= config.measured_fraction and sight.spread >= _BOTH_ENDS


def _is_seen_in_part(sight: Sight, config: SurfaceConfig) -> bool:
    return sight.fraction >= config.inferred_fraction and sight.length >= _LEAST_LENGTH


def _top_beyond(samples: Floats, outward: Floats, evidence: Evidence) -> float:
    """Return the share of a side's samples beyond which the top was seen."""
    if not len(evidence.top):
        return 0.0
    beyond = np.ones(len(samples), dtype=bool)
    for away in _BEYOND:
        distance, _ = evidence.top_tree.query(samples + away * outward)
        beyond &= distance < evidence.cell
    return float(beyond.mean())


_BEYOND = (0.03, 0.05)  # metres: farther out than poses and votes err


def _sampled(piece: Floats) -> tuple[Floats, Floats]:
    """Return places along a side and their outward normals, each (n, 2)."""
    step = np.linalg.norm(np.diff(piece, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(step)])
    count = max(int(along[-1] / _STEP), 3)
    at = (np.arange(count) + 0.5) * (along[-1] / count)
    places = np.stack(
        [np.interp(at, along, piece[:, 0]), np.interp(at, along, piece[:, 1])], axis=1
    )
    segment = np.clip(np.searchsorted(along, at, side="right") - 1, 0, len(step) - 1)
    tangent = np.diff(piece, axis=0)[segment] / np.maximum(step[segment], 1e-9)[:, None]
    return places, np.column_stack([tangent[:, 1], -tangent[:, 0]])


def own_statuses(seen: tuple[Sight, ...], config: SurfaceConfig) -> tuple[str, ...]:
    """Return each side's status by itself: measured, inferred or unseen.

    A point or two beside a corner belong to any of its sides: they show none. Nor do a few points
    show a side where the top was seen to go on beyond more of it.
    """
    own = []
    for sight in seen:
        if _is_measured(sight, config):
            own.append(MEASURED)
        elif _is_seen_in_part(sight, config) and sight.beyond <= sight.fraction:
            own.append(INFERRED)
        else:
            own.append(UNSEEN)
    return tuple(own)


def hold_unseen(fit: JointFit, evidence: Evidence, config: SurfaceConfig) -> tuple[Anchor, ...]:
    """Anchor each straight side without edge points between the last top and the first free cell.

    Without an anchor such a side drifts by decimetres.
    """
    shape = fit.shape
    if not isinstance(shape, Sided):
        return ()
    anchors = []
    statuses = own_statuses(sights(fit, evidence, config), config)
    for index, (status, piece) in enumerate(zip(statuses, shape.pieces(), strict=True)):
        if status != UNSEEN or len(piece) > 2:
            continue
        length = float(np.linalg.norm(piece[1] - piece[0]))
        along = (piece[1] - piece[0]) / max(length, 1e-9)
        outward = np.array([along[1], -along[0]])
        top = _within(evidence.top, piece, along, 0.0)
        free = _within(evidence.free, piece, along, 0.1)
        here = float(piece[0] @ outward)
        edge = _within(fit.points[fit.side >= 0], piece, along, -0.05)
        seen = np.concatenate([top, edge])
        close = np.abs(seen @ outward - here) < 0.3
        if len(shape.corners) > 4 and close.any():
            # In a polygon with arms, only the top near this side counts.
            seen = seen[close]
        last = _last(seen @ along, seen @ outward, evidence.cell) if len(seen) else here
        depth = free @ outward
        depth = depth[(depth > last - evidence.cell) & (depth < last + 0.6)]
        middle = piece.mean(axis=0)
        foot = middle + outward * (last - here)
        if len(depth) >= 3:
            first = max(float(np.percentile(depth, 5)), last)
            between = max(first - last, evidence.cell)
            anchors.append(Anchor(index, foot + outward * (first - last) / 2, between / 12**0.5))
        else:
            anchors.append(Anchor(index, foot, 0.1, is_bounded=False))
    return tuple(anchors)


def _last(along: Floats, outward: Floats, cell: float) -> float:
    """Return how far outward the top was seen: most columns across a side end there or before."""
    _, column = np.unique(np.floor(along / cell), return_inverse=True)
    farthest = np.full(column.max() + 1, -np.inf)
    np.maximum.at(farthest, column, outward)
    return float(np.percentile(farthest, 70)) + cell / 2


def _within(points: Floats, piece: Floats, along: Floats, margin: float) -> Floats:
    low, high = float(piece[0] @ along), float(piece[1] @ along)
    inset = margin * (high - low)
    at = points @ along
    return points[(at > low + inset) & (at < high - inset)]
