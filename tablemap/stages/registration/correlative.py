"""A search for a stop's place that needs no good start: a likelihood field, coarse to fine.

After Olson, Real-time correlative scan matching, ICRA 2009.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from tablemap.geometry import Floats, Pose2, wrap_angle

_CELL = 0.05
_FINE_CELL = 0.02
_COARSE_TURN = np.radians(1.0)
_FINE_TURN = np.radians(1.0 / 3.0)
_SIGMA = 0.05
_POINTS = 180
_LARGEST_FIELD = 1500  # cells a side
_APART = 0.25  # metres (and ten degrees): a peak further off counts as another answer
_APART_TURN = np.radians(10.0)


@dataclass(frozen=True)
class Match:
    """The best pose found, its score in [0, 1], and the score's margin over any other peak."""

    pose: Pose2
    score: float
    margin: float


def likelihood(points: Floats, tree: cKDTree, pose: Pose2) -> float:
    """Return the mean likelihood in [0, 1] of (n, 2) points at a pose among the tree's points."""
    if len(points) == 0 or tree.n == 0:
        return 0.0
    distance, _ = tree.query(pose.apply(points), distance_upper_bound=4 * _SIGMA)
    return float(np.exp(-0.5 * np.square(np.minimum(distance, 10.0) / _SIGMA)).mean())


def likelihood_at(points: Floats, field_points: Floats, pose: Pose2) -> float:
    """Return the `likelihood` of (n, 2) points at a pose among (m, 2) field points."""
    return likelihood(points, cKDTree(field_points), pose)


def search(
    points: Floats, field_points: Floats, start: Pose2, *, radius: float, turn: float
) -> Match:
    """Find where (n, 2) points fit best among (m, 2) others, within a radius round a start."""
    thinned = points[:: max(1, len(points) // _POINTS)]
    tree = cKDTree(field_points)
    field, corner = _field(field_points, thinned, start, radius)
    reach = int(np.ceil(radius / _CELL))
    shifts = np.arange(-reach, reach + 1) * _CELL
    turns = np.arange(-np.ceil(turn / _COARSE_TURN), np.ceil(turn / _COARSE_TURN) + 1)
    turns = turns * _COARSE_TURN
    scores = np.empty((len(turns), len(shifts), len(shifts)))
    cells = np.round(shifts / _CELL).astype(np.int64)
    for k, angle in enumerate(turns):
        placed = Pose2(start.x, start.y, start.yaw + angle).apply(thinned)
        index = np.floor((placed - corner) / _CELL).astype(np.int64)
        rows = np.clip(index[:, 1, None] + cells, 0, field.shape[0] - 1)
        columns = np.clip(index[:, 0, None] + cells, 0, field.shape[1] - 1)
        scores[k] = field[rows[:, :, None], columns[:, None, :]].mean(axis=0)
    best = np.unravel_index(int(np.argmax(scores)), scores.shape)
    at = np.array([shifts[best[2]], shifts[best[1]], turns[best[0]]])
    other = (
        (np.abs(turns - at[2])[:, None, None] > _APART_TURN)
        | (np.abs(shifts - at[1])[None, :, None] > _APART)
        | (np.abs(shifts - at[0])[None, None, :] > _APART)
    )
    second = float(scores[other].max()) if other.any() else 0.0
    margin = float(scores[best]) - second
    coarse = Pose2(start.x + at[0], start.y + at[1], wrap_angle(start.yaw + at[2]))
    fine = _refine(thinned, tree, coarse)
    return Match(fine, likelihood(points, tree, fine), margin)


def _field(
    field_points: Floats, points: Floats, start: Pose2, radius: float
) -> tuple[Floats, Floats]:
    """Return the likelihood of each cell of 5 cm round the start, and the grid's lower corner."""
    # Points turned about the start stay within this reach. A border of empty cells stands for
    # everything outside the grid.
    reach = float(np.linalg.norm(points, axis=1).max()) + radius + 4 * _SIGMA
    reach = min(reach, _CELL * _LARGEST_FIELD / 2)
    corner = start.translation - reach
    side = int(np.ceil(2 * reach / _CELL)) + 2
    index = np.floor((field_points - corner) / _CELL).astype(np.int64)
    inside = ((index >= 1) & (index < side - 1)).all(axis=1)
    empty = np.ones((side, side), dtype=bool)
    empty[index[inside, 1], index[inside, 0]] = False
    if empty.all():
        return np.zeros((side, side)), corner
    distance = distance_transform_edt(empty) * _CELL
    return np.exp(-0.5 * np.square(distance / _SIGMA)), corner


def _refine(points: Floats, tree: cKDTree, coarse: Pose2) -> Pose2:
    steps = np.arange(-3, 4)
    best, best_score = coarse, -1.0
    for turn in steps * _FINE_TURN:
        turned = Pose2(0.0, 0.0, coarse.yaw + turn).apply(points)
        dx, dy = np.meshgrid(steps * _FINE_CELL, steps * _FINE_CELL)
        shift = np.stack([dx.ravel(), dy.ravel()], axis=1) + coarse.translation
        distance, _ = tree.query(turned[None] + shift[:, None], distance_upper_bound=4 * _SIGMA)
        scores = np.exp(-0.5 * np.square(np.minimum(distance, 10.0) / _SIGMA)).mean(axis=1)
        k = int(np.argmax(scores))
        if scores[k] > best_score:
            best_score = float(scores[k])
            best = Pose2(float(shift[k, 0]), float(shift[k, 1]), wrap_angle(coarse.yaw + turn))
    return best
