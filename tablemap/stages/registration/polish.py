"""Refinement of all stops at once, point to line, with the laser's range bias as a nuisance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import cKDTree

from tablemap.geometry import Floats, Pose2, wrap_angles
from tablemap.robust import kernel_weight
from tablemap.stages.registration.graph import GraphEdge, accumulate, edge_errors, edge_jacobians
from tablemap.stages.registration.result import StopScan

_ITERATIONS_A_GATE = 6
_SOURCE_POINTS = 400
_NORMAL_COSINE = 0.9
_LOOSE = 1e-2  # information that keeps the whole in place: the polish is about relative poses
_LEAST_SIGMA = 5e-4


@dataclass(frozen=True, eq=False)
class Polished:
    """The refined poses.

    - ``poses``: (n, 3) x, y, yaw in metres and radians
    - ``covariance``: (3n, 3n), with the common motion of all poses nearly free
    - ``range_bias``: the nuisance, in the unit of its prior
    - ``rms``: metres, of the residuals
    - ``matched``: (n,), how many correspondences each stop has
    """

    poses: Floats
    covariance: Floats
    range_bias: float
    rms: float
    matched: Floats


def polish(
    stops: Sequence[StopScan | None],
    poses: Floats,
    pairs: Sequence[tuple[int, int]],
    edges: Sequence[GraphEdge],
    *,
    gates: Sequence[float],
    kernel: float,
    correlation: float,
    bias_sigma: float,
    settled: float = 1e-6,
) -> Polished:
    """Refine all poses (n, 3) by one Gauss-Newton over the points of all pairs, both ways.

    The ``edges`` (odometry) bind directions that the scans leave open; ``stops`` without a scan are
    None. The points are paired within each of the ``gates`` in turn, metres, and weighed by a
    Geman-McClure kernel of at least ``kernel`` metres. ``bias_sigma`` is the nuisance's prior:
    metres if the ``directions`` are unit vectors, a share if they are whole offsets. The iteration
    at a gate ends with a step below ``settled`` (metres, radians). The covariance counts each beam
    once, however many pairs use it, and ``correlation`` beams as one.
    """
    scans = {i: stop for i, stop in enumerate(stops) if stop is not None and len(stop.points)}
    trees = {i: cKDTree(stop.points) for i, stop in scans.items()}
    both = [(a, b) for a, b in pairs if a in scans and b in scans]
    ordered = sorted({*both, *((b, a) for a, b in both)})
    poses = poses.astype(np.float64).copy()
    size = 3 * len(poses) + 1
    bias, sigma = 0.0, kernel
    sums = _Sums(np.zeros((size, size)), np.zeros(size), 0.0, 0.0, np.zeros(len(poses)))
    # Every beam is in up to 2 (n - 1) residuals, and neighbours err together.
    repeats = max(2.0 * len(ordered) / max(2 * len(scans), 1), 1.0)
    thinning = np.mean([_every(stop) for stop in scans.values()]) if scans else 1.0
    effective = repeats * max(correlation / float(thinning), 1.0)
    for gate in gates:
        width = max(kernel, gate / 5)
        for _ in range(_ITERATIONS_A_GATE):
            sums = _correspond(scans, trees, ordered, poses, bias, gate, width)
            sigma = max(float(np.sqrt(sums.squared / max(sums.weight, 1e-9))), _LEAST_SIGMA)
            variance = sigma**2 * effective
            system, gradient = sums.system / variance, sums.gradient / variance
            _add_priors(system, gradient, poses, bias, edges, bias_sigma)
            step = cho_solve(cho_factor(system), -gradient)
            poses += step[:-1].reshape(-1, 3)
            poses[:, 2] = wrap_angles(poses[:, 2])
            bias += float(step[-1])
            if np.abs(step).max() < settled:
                break
    system = sums.system / (sigma**2 * effective)
    _add_priors(system, np.zeros(size), poses, bias, edges, bias_sigma)
    covariance = cho_solve(cho_factor(system), np.eye(size))[:-1, :-1]
    return Polished(poses, covariance, bias, sigma, sums.matched)


@dataclass(frozen=True, eq=False)
class _Sums:
    system: Floats
    gradient: Floats
    squared: float
    weight: float
    matched: Floats


def _every(stop: StopScan) -> int:
    return max(1, -(-len(stop.points) // _SOURCE_POINTS))


def _correspond(
    scans: dict[int, StopScan],
    trees: dict[int, cKDTree],
    ordered: Sequence[tuple[int, int]],
    poses: Floats,
    bias: float,
    gate: float,
    kernel: float,
) -> _Sums:
    """Accumulate the normal equations of n_t . (P_s p - P_t q) over all ordered pairs."""
    size = 3 * len(poses) + 1
    system, gradient = np.zeros((size, size)), np.zeros(size)
    squared = total = 0.0
    matched = np.zeros(len(poses))
    for s, t in ordered:
        source, target = scans[s], scans[t]
        every = _every(source)
        in_map, in_target_map = Pose2.from_array(poses[s]), Pose2.from_array(poses[t])
        target_from_source = in_target_map.inverse() @ in_map
        corrected = source.points[::every] + bias * source.directions[::every]
        distance, index = trees[t].query(
            target_from_source.apply(corrected), distance_upper_bound=gate
        )
        found = np.isfinite(distance)
        index = np.where(found, index, 0)
        normals = target_from_source.rotate(source.normals[::every])
        found &= np.einsum("ij,ij->i", normals, target.normals[index]) > _NORMAL_COSINE
        if not found.any():
            continue
        index = index[found]
        p = in_map.rotate(corrected[found])
        q = in_target_map.rotate(target.points[index] + bias * target.directions[index])
        n = in_target_map.rotate(target.normals[index])
        apart = p + poses[s, :2] - q - poses[t, :2]
        residual = np.einsum("ij,ij->i", n, apart)
        along = in_map.rotate(source.directions[::every][found])
        along -= in_target_map.rotate(target.directions[index])
        rows = np.empty((len(index), 7))
        rows[:, 0:2], rows[:, 3:5] = n, -n
        rows[:, 2] = n[:, 1] * p[:, 0] - n[:, 0] * p[:, 1]
        rows[:, 5] = -(n[:, 1] * q[:, 0] - n[:, 0] * q[:, 1])
        rows[:, 5] += n[:, 0] * apart[:, 1] - n[:, 1] * apart[:, 0]
        rows[:, 6] = np.einsum("ij,ij->i", n, along)
        weight = kernel_weight(residual, kernel)
        columns = np.array([3 * s, 3 * s + 1, 3 * s + 2, 3 * t, 3 * t + 1, 3 * t + 2, size - 1])
        weighted = rows.T * weight
        system[np.ix_(columns, columns)] += weighted @ rows
        gradient[columns] += weighted @ residual
        squared += float(weight @ residual**2)
        total += float(weight.sum())
        matched[s] += float(weight.sum())
    return _Sums(system, gradient, squared, total, matched)


def _add_priors(
    system: Floats,
    gradient: Floats,
    poses: Floats,
    bias: float,
    edges: Sequence[GraphEdge],
    bias_sigma: float,
) -> None:
    if edges:
        jacobian, columns = edge_jacobians(poses, edges)
        # The last column is the range bias here, and edges do not depend on it.
        jacobian[:, :, 6] = 0.0
        information = np.stack([edge.information for edge in edges])
        accumulate(system, gradient, jacobian, columns, information, edge_errors(poses, edges))
    loose = np.arange(len(system) - 1)
    system[loose, loose] += _LOOSE
    system[-1, -1] += 1.0 / bias_sigma**2
    gradient[-1] += bias / bias_sigma**2
