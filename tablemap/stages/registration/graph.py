"""A pose graph in SE(2) with robust edges, solved densely: there are only tens of poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from tablemap.geometry import Floats, Ints, Pose2, wrap_angles

_ITERATIONS = 12
# Robust kernels begin nearly quadratic and are tightened step by step (graduated non-convexity).
# So the start does not decide which of two disagreeing pairs wins.
_SCALES = (64.0, 16.0, 4.0, 1.0, 1.0)
_TINY = 1e-9


@dataclass(frozen=True, eq=False)
class GraphEdge:
    """A measured relative pose of two nodes.

    - ``target_from_source``: the measured pose of the source in the target's frame
    - ``information``: (3, 3) of x, y and yaw, in the target's frame
    - ``robust``: squared Mahalanobis length above which the edge loses weight (None: never)
    - ``turns_with_scale``: whether the graph's common yaw scale acts on it, as on wheel odometry
    """

    source: int
    target: int
    target_from_source: Pose2
    information: Floats
    robust: float | None = None
    turns_with_scale: bool = False


@dataclass(frozen=True, eq=False)
class GraphAnchor:
    """The localised pose of a node, with ``information`` (3, 3) in the map."""

    index: int
    pose: Pose2
    information: Floats
    robust: float | None = None


@dataclass(frozen=True, eq=False)
class GraphSolution:
    """The solved graph.

    - ``poses``: (n, 3) x, y, yaw in metres and radians
    - ``edge_weights``, ``anchor_weights``: in [0, 1], what the robust kernel left to each
    - ``covariance``: (3n, 3n), right if the informations of edges and anchors are right
    - ``yaw_scale``: the odometry's, a share
    """

    poses: Floats
    edge_weights: Floats
    anchor_weights: Floats
    covariance: Floats
    yaw_scale: float


def solve_graph(
    initial: Floats,
    edges: Sequence[GraphEdge],
    anchors: Sequence[GraphAnchor],
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
            poses[:, 2] = wrap_angles(poses[:, 2])
            scale += float(step[-1])
            if np.abs(step).max() < 1e-7:
                break
    covariance = cho_solve(cho_factor(system), np.eye(len(system)))[:-1, :-1]
    _, edge_weights = _edge_terms(poses, scale, edges, 1.0)
    _, anchor_weights = _anchor_terms(poses, anchors, 1.0)
    return GraphSolution(poses, edge_weights, anchor_weights, covariance, scale)


def edge_errors(poses: Floats, edges: Sequence[GraphEdge]) -> Floats:
    """Return (e, 3): the residuals of the edges at ``poses`` (n, 3), metres and radians."""
    return _edge_terms(poses, 0.0, edges, 1.0)[0]


def edge_weights(poses: Floats, edges: Sequence[GraphEdge]) -> Floats:
    """Return (e,): the robust weight in [0, 1] of each edge at ``poses`` (n, 3)."""
    return _edge_terms(poses, 0.0, edges, 1.0)[1]


def edge_error(poses: Floats, edge: GraphEdge) -> Floats:
    """Return (3,): the residual of the edge at ``poses`` (n, 3), metres and radians."""
    error, _ = _edge_terms(poses, 0.0, [edge], 1.0)
    return np.asarray(error[0], dtype=np.float64)


def _edge_terms(
    poses: Floats, scale: float, edges: Sequence[GraphEdge], factor: float
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
    error[:, 2] = wrap_angles(error[:, 2])
    return error, _weights(error, edges, factor)


def _anchor_terms(
    poses: Floats, anchors: Sequence[GraphAnchor], factor: float
) -> tuple[Floats, Floats]:
    if not anchors:
        return np.zeros((0, 3)), np.zeros(0)
    at = poses[[anchor.index for anchor in anchors]]
    error = at - np.array([anchor.pose.as_array() for anchor in anchors])
    error[:, 2] = wrap_angles(error[:, 2])
    return error, _weights(error, anchors, factor)


def _weights(
    error: Floats, terms: Sequence[GraphEdge] | Sequence[GraphAnchor], factor: float
) -> Floats:
    information = np.stack([term.information for term in terms])
    squared = np.einsum("ni,nij,nj->n", error, information, error)
    limit = np.array([np.inf if t.robust is None else t.robust for t in terms]) * factor
    ratio = np.where(np.isfinite(limit), squared / np.where(np.isfinite(limit), limit, 1.0), 0.0)
    return np.square(1.0 / (1.0 + ratio))


def _normal_equations(
    poses: Floats,
    scale: float,
    edges: Sequence[GraphEdge],
    anchors: Sequence[GraphAnchor],
    yaw_scale_sigma: float,
    factor: float,
) -> tuple[Floats, Floats]:
    size = 3 * len(poses) + 1
    system = np.zeros((size, size))
    gradient = np.zeros(size)
    if edges:
        error, weight = _edge_terms(poses, scale, edges, factor)
        jacobian, columns = edge_jacobians(poses, edges)
        information = weight[:, None, None] * np.stack([edge.information for edge in edges])
        accumulate(system, gradient, jacobian, columns, information, error)
    error, weight = _anchor_terms(poses, anchors, factor)
    for k, anchor in enumerate(anchors):
        rows = slice(3 * anchor.index, 3 * anchor.index + 3)
        system[rows, rows] += weight[k] * anchor.information
        gradient[rows] += weight[k] * anchor.information @ error[k]
    system[-1, -1] += 1.0 / yaw_scale_sigma**2
    gradient[-1] += scale / yaw_scale_sigma**2
    # This keeps a node without edges and anchors where it is.
    system[np.diag_indices(size)] += _TINY * max(1.0, float(np.trace(system)) / size)
    return system, gradient


def edge_jacobians(poses: Floats, edges: Sequence[GraphEdge]) -> tuple[Floats, Ints]:
    """Return the derivatives (e, 3, 7) of the edges' residuals, and their columns (e, 7).

    The columns are x, y, yaw of the source, then of the target, and last the yaw scale.
    """
    source = np.array([edge.source for edge in edges], dtype=np.int64)
    target = np.array([edge.target for edge in edges], dtype=np.int64)
    measured = np.array([edge.target_from_source.as_array() for edge in edges])
    scaled = np.array([edge.turns_with_scale for edge in edges])
    cos, sin = np.cos(poses[target, 2]), np.sin(poses[target, 2])
    dx, dy = (poses[source] - poses[target])[:, :2].T
    jacobian = np.zeros((len(edges), 3, 7))
    jacobian[:, 0, 0], jacobian[:, 0, 1] = cos, sin
    jacobian[:, 1, 0], jacobian[:, 1, 1] = -sin, cos
    jacobian[:, :2, 3:5] = -jacobian[:, :2, :2]
    jacobian[:, 0, 5], jacobian[:, 1, 5] = -sin * dx + cos * dy, -cos * dx - sin * dy
    jacobian[:, 2, 2], jacobian[:, 2, 5] = 1.0, -1.0
    half = 0.5 * scaled * measured[:, 2]
    jacobian[:, 0, 6], jacobian[:, 1, 6] = half * measured[:, 1], -half * measured[:, 0]
    jacobian[:, 2, 6] = -(scaled * measured[:, 2])
    first = np.stack([3 * source, 3 * source + 1, 3 * source + 2], axis=1)
    second = np.stack([3 * target, 3 * target + 1, 3 * target + 2], axis=1)
    last = np.full((len(edges), 1), 3 * len(poses), dtype=np.int64)
    return jacobian, np.concatenate([first, second, last], axis=1)


def accumulate(
    system: Floats,
    gradient: Floats,
    jacobian: Floats,
    columns: Ints,
    information: Floats,
    error: Floats,
) -> None:
    """Add the edges' terms to the normal equations, in place."""
    weighted = np.swapaxes(jacobian, 1, 2) @ information
    size = len(system)
    flat = (columns[:, :, None] * size + columns[:, None, :]).ravel()
    parts = np.bincount(flat, weights=(weighted @ jacobian).ravel(), minlength=size * size)
    system += parts.reshape(size, size)
    pulls = (weighted @ error[:, :, None])[..., 0]
    gradient += np.bincount(columns.ravel(), weights=pulls.ravel(), minlength=size)


def relative_covariance(poses: Floats, covariance: Floats) -> Floats:
    """Return the covariance (3n, 3n) with the mean pose of all nodes fixed, by least squares.

    The common motion of all nodes in the map is projected out: a shift in x, a shift in y, and a
    turn about the centroid. The result has rank 3n - 3.
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
