"""Legs found, missed and invented, and how far each stands from its true place."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from tablemap.evaluation.score import BOUND, Error, LegScore
from tablemap.evaluation.truth import TrueSurface, Truth
from tablemap.geometry import Pose2, wrap_angle
from tablemap.model import Dimension, TableModel, TableSurface
from tablemap.model.shapes import shape_named

LEG_REACH = 0.10
"""A leg farther than this from every true leg counts as invented, metres."""
LARGEST_TURN = float(np.radians(5.0))
"""A top turned more than this against the snapshots is itself wrong, radians."""


def score_legs(model: TableModel, truth: Truth, truth_from_model: Pose2 | None) -> LegScore | None:
    """Pair legs by the least total distance; places are compared in the top's own frame."""
    if truth.legs is None or truth.surface.pose is None:
        return None
    true_pose = truth.surface.pose
    if not truth.legs or not model.legs:
        return LegScore(0, len(truth.legs), len(model.legs), (), ())
    if truth_from_model is None:
        own = model.surface.pose
        truth_from_model = (
            Pose2(true_pose.x, true_pose.y, true_pose.yaw) @ Pose2(own.x, own.y, own.yaw).inverse()
        )
    centroid = truth_from_model.apply([model.surface.pose.x, model.surface.pose.y])
    estimated = truth_from_model.apply([[leg.x, leg.y] for leg in model.legs]) - centroid
    estimated = _turn_of(model.surface, truth.surface, truth_from_model).rotate(estimated)
    true = np.array([[leg.x, leg.y] for leg in truth.legs]) - [true_pose.x, true_pose.y]
    distances = np.hypot(*(estimated[:, None] - true[None]).transpose(2, 0, 1))
    rows, columns = linear_sum_assignment(np.minimum(distances, LEG_REACH))
    places, sizes = [], []
    for i, j in zip(rows.tolist(), columns.tolist(), strict=True):
        if distances[i, j] > LEG_REACH:
            continue
        leg, truth_leg = model.legs[i], truth.legs[j]
        sigma = leg.position_sigma
        distance = float(distances[i, j])
        # 95 % of a two-dimensional normal lie within 2.448 sigma: scaled so that 1.96 is the bound.
        planar = None if sigma is None else sigma * 2.448 / BOUND
        places.append(Error("leg", distance, planar, 0.0, distance, leg.status))
        sizes.append(_leg_size(leg.dimensions, truth_leg.dimensions, leg.status))
    found = len(places)
    return LegScore(
        found,
        len(truth.legs) - found,
        len(model.legs) - found,
        tuple(places),
        tuple(sizes),
    )


def symmetry(surface: TableSurface, true: TrueSurface) -> float:
    """Return the turn, in radians, that tells nothing of a heading; 0 if there is no heading.

    A shape that is known only by its outline has no heading of its own; nor has a circle.
    """
    return min(shape_named(shape).symmetry or 0.0 for shape in (surface.shape, true.shape))


def _turn_of(surface: TableSurface, true: TrueSurface, truth_from_model: Pose2) -> Pose2:
    """Return the turn of the top onto the true top, if its shape has a heading.

    The fit of the snapshots' poses has its own error: a laser that is not at its place in TF turns
    all poses, but does not turn the table.
    """
    period = symmetry(surface, true)
    if not period or true.pose is None:
        return Pose2()
    turn = wrap_angle(true.pose.yaw - truth_from_model.yaw - surface.pose.yaw, period)
    return Pose2(0.0, 0.0, turn if abs(turn) < LARGEST_TURN else 0.0)


def _leg_size(estimated: dict[str, Dimension], true: dict[str, float], status: str) -> Error:
    """Compare the largest dimension of each."""
    figure = max(estimated.values(), key=lambda f: f.value)
    size = max(true.values())
    error = float(figure.value - size)
    return Error("leg size", error, figure.sigma, size, abs(error), status)
