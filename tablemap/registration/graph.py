"""A pose graph in SE(2) with robust edges, solved densely: there are only tens of poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from tablemap.geometry import Floats, Pose2

_ITERATIONS = 12
# Robust edges begin nearly quadratic and are tightened step by step (graduated non-convexity), so
# that the start does not decide which of two disagreeing pairs is believed.
_SCALES = (64.0, 16.0, 4.0, 1.0, 1.0)
_TINY = 1e-9


@dataclass(frozen=True, eq=False)
class Edge:
    """``target_from_source`` was measured with ``information`` (3, 3) in the target's frame.

    ``robust`` is the squared Mahalanobis length from which on it is doubted (None: never);
    ``turns_with_scale`` says that the graph's common yaw scale acts on it, as on wheel odometry.
    """

    source: int
    target: int
    target_from_source: Pose2
    information: Floats
    robust: float | None = None
    turns_with_scale: bool = False


@dataclass(frozen=True, eq=False)
class Anchor:
    """The localised pose of a node, with ``information`` (3, 3) in the map."""

    index: int
    pose: Pose2
    information: Floats
    robust: float | None = None


@dataclass(frozen=True, eq=False)
class GraphSolution:
    """``poses`` (n, 3); the weight left to each edge and anchor; ``covariance`` (3n, 3n).

    The covariance takes the informations at their word; ``yaw_scale`` is the odometry's.
    """

    poses: Floats
    edge_weights: Floats
    anchor_weights: Floats
    covariance: Floats
    yaw_scale: float


def solve_graph(
    initial: Floats,
    edges: Sequence[Edge],
    anchors: Sequence[Anchor],
    *,
    yaw_scale_sigma: float = 0.03,
) -> GraphSolution:
    """Minimise the graph's robust squared error from ``initial`` (n, 3) by Gauss-Newton.

    Kernel: Geman-McClure, scaled by each edge's ``robust`` and reduced in steps (Yang et al.,
    Graduated Non-Convexity, RA-L 2020).
    """
    poses = initial.astype(np.float64).copy()
    scale = 0.0
    nodes = len(poses)
    system = np.eye(3 * nodes + 1)
    for factor in _SCALES:
        for _ in range(_ITERATIONS):
            system, gradient = _normal_equations(
                poses, scale, edges, anchors, yaw_scale_sigma, factor
            )
            step = cho_solve(cho_factor(system), -gradient)
            poses += step[:-1].reshape(nodes, 3)
            poses[:, 2] = (poses[:, 2] + np.pi) % (2 * np.pi) - np.pi
            scale += float(step[-1])
            if np.abs(step).max() < 1e-7:
                break
    covariance = cho_solve(cho_factor(system), np.eye(len(system)))[:-1, :-1]
    _, edge_weights = _edge_terms(poses, scale, edges, 1.0)
    _, anchor_weights = _anchor_terms(poses, anchors, 1.0)
    return GraphSolution(poses, edge_weights, anchor_weights, covariance, scale)


def edge_error(poses: Floats, edge: Edge) -> Floats:
    """Return (3,): how far ``poses`` (n, 3) put the source from where the edge has it."""
    error, _ = _edge_terms(poses, 0.0, [edge], 1.0)
    return np.asarray(error[0], dtype=np.float64)


def _edge_terms(
    poses: Floats, scale: float, edges: Sequence[Edge], factor: float
) -> tuple[Floats, Floats]:
    if not edges:
        return np.zeros((0, 3)), np.zeros(0)
    source = poses[[edge.source for edge in edges]]
    target = poses[[edge.target for edge in edges]]
    measured = np.array([edge.target_from_source.as_array() for edge in edges])
    turned = np.array([edge.turns_with_scale for edge in edges]) * scale * measured[:, 2]
    cos, sin = np.cos(target[:, 2]), np.sin(target[:, 2])
    dx, dy = (source - target)[:, 0], (source - target)[:, 1]
    error = np.stack(
        [
            cos * dx + sin * dy - measured[:, 0] + 0.5 * turned * measured[:, 1],
            -sin * dx + cos * dy - measured[:, 1] - 0.5 * turned * measured[:, 0],
            source[:, 2] - target[:, 2] - measured[:, 2] - turned,
        ],
        axis=1,
    )
    error[:, 2] = (error[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return error, _weights(error, edges, factor)


def _anchor_terms(poses: Floats, anchors: Sequence[Anchor], factor: float) -> tuple[Floats, Floats]:
    if not anchors:
        return np.zeros((0, 3)), np.zeros(0)
    at = poses[[anchor.index for anchor in anchors]]
    error = at - np.array([anchor.pose.as_array() for anchor in anchors])
    error[:, 2] = (error[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return error, _weights(error, anchors, factor)


def _weights(error: Floats, terms: Sequence[Edge] | Sequence[Anchor], factor: float) -> Floats:
    information = np.stack([term.information for term in terms])
    squared = np.einsum("ni,nij,nj->n", error, information, error)
    limit = np.array([np.inf if t.robust is None else t.robust for t in terms]) * factor
    ratio = np.where(np.isfinite(limit), squared / np.where(np.isfinite(limit), limit, 1.0), 0.0)
    return np.square(1.0 / (1.0 + ratio))


def _normal_equations(
    poses: Floats,
    scale: float,
    edges: Sequence[Edge],
    anchors: Sequence[Anchor],
    yaw_scale_sigma: float,
    factor: float,
) -> tuple[Floats, Floats]:
    size = 3 * len(poses) + 1
    system = np.zeros((size, size))
    gradient = np.zeros(size)
    error, weight = _edge_terms(poses, scale, edges, factor)
    for k, edge in enumerate(edges):
        at = poses[edge.target]
        cos, sin = np.cos(at[2]), np.sin(at[2])
        dx, dy = poses[edge.source, :2] - at[:2]
        jacobian = np.zeros((3, 7))
        jacobian[:2, 0:2] = [[cos, sin], [-sin, cos]]
        jacobian[:2, 3:5] = [[-cos, -sin], [sin, -cos]]
        jacobian[:2, 5] = [-sin * dx + cos * dy, -cos * dx - sin * dy]
        jacobian[2, 2], jacobian[2, 5] = 1.0, -1.0
        if edge.turns_with_scale:
            measured = edge.target_from_source
            half = 0.5 * measured.yaw
            jacobian[:, 6] = [half * measured.y, -half * measured.x, -measured.yaw]
        s, t = 3 * edge.source, 3 * edge.target
        columns = np.array([s, s + 1, s + 2, t, t + 1, t + 2, size - 1])
        weighted = weight[k] * jacobian.T @ edge.information
        system[np.ix_(columns, columns)] += weighted @ jacobian
        gradient[columns] += weighted @ error[k]
    error, weight = _anchor_terms(poses, anchors, factor)
    for k, anchor in enumerate(anchors):
        rows = slice(3 * anchor.index, 3 * anchor.index + 3)
        system[rows, rows] += weight[k] * anchor.information
        gradient[rows] += weight[k] * anchor.information @ error[k]
    system[-1, -1] += 1.0 / yaw_scale_sigma**2
    gradient[-1] += scale / yaw_scale_sigma**2
    # A node that nothing holds stays where it is.
    system[np.diag_indices(size)] += _TINY * max(1.0, float(np.trace(system)) / size)
    return system, gradient


def relative_covariance(poses: Floats, covariance: Floats) -> Floats:
    """Return the (3n, 3n) covariance with the mean pose of all held (in the least-squares sense).

    The whole's motion in the map is taken out: a shift in x, a shift in y, a turn about the
    centroid. What is left has rank 3n - 3.
    """
    n = len(poses)
    centred = poses[:, :2] - poses[:, :2].mean(axis=0)
    free = np.zeros((n, 3, 3))
    free[:, 0, 0] = free[:, 1, 1] = free[:, 2, 2] = 1.0
    free[:, 0, 2], free[:, 1, 2] = -centred[:, 1], centred[:, 0]
    gauge = free.reshape(3 * n, 3)
    keep = np.eye(3 * n) - gauge @ np.linalg.solve(gauge.T @ gauge, gauge.T)
    held = keep @ covariance @ keep.T
    return 0.5 * (held + held.T)
