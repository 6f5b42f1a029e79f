"""Refinement of all stops at once, point to line, with the errors of all ranges as nuisances.

A laser's ranges err by millimetres that change slowly with the beam's angle (Kneip, Tache, Caprari
and Siegwart, "Characterization of the compact Hokuyo URG-04LX 2D laser range finder", ICRA 2009).
Stops that see one wall at different angles show this error: without it the poses take it up, and
the whole ring of stops becomes wider or narrower.

A scan of a moving base that does not say how long it took may have taken a moment or a turn of the
mirror. That share of a turn is a nuisance, too: scans taken on other ways show it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import cKDTree

from tablemap.geometry import Floats, Ints, compose, inverses, wrap_angles
from tablemap.robust import kernel_weight
from tablemap.stages.registration.graph import GraphEdge, accumulate, edge_errors, edge_jacobians
from tablemap.stages.registration.result import StopScan

_ITERATIONS_A_GATE = 6
_SOURCE_POINTS = 400
_NORMAL_COSINE = 0.9
_LOOSE = 1e-2  # information that keeps the whole in place: the polish is about relative poses
_LEAST_SIGMA = 5e-4
_SETTLED_SHARE = 0.01  # of a gate but the last
_SWEEP_SIGMA = 1.0  # of a turn


_HARMONICS = 3  # of the beam's angle: the errors that change with it are smooth


@dataclass(frozen=True)
class RangePrior:
    """What is believed of the errors that all ranges share, as standard deviations.

    - ``bias``: of a constant error: metres where ``directions`` of a stop's scan are unit vectors,
      a share where they are whole offsets
    - ``bend``: metres, of the error that changes with the beam's angle; 0 for none
    """

    bias: float
    bend: float = 0.0

    @property
    def sigmas(self) -> Floats:
        """The standard deviations (k,) of the factors of `modes`."""
        waves = 2 * _HARMONICS if self.bend else 0
        return np.array([self.bias] + [self.bend / np.sqrt(_HARMONICS)] * waves)

    def modes(self, directions: Floats) -> Floats:
        """Return the shapes (n, k) of the error over beams with directions (n, 2).

        First the constant one, then cosine and sine of the beam's angle and of its multiples.
        """
        constant = np.ones((len(directions), 1))
        if not self.bend:
            return constant
        angle = np.arctan2(directions[:, 1], directions[:, 0])
        turns = np.multiply.outer(angle, np.arange(1, _HARMONICS + 1))
        return np.concatenate([constant, np.cos(turns), np.sin(turns)], axis=1)


@dataclass(frozen=True, eq=False)
class Polished:
    """The refined poses.

    - ``poses``: (n, 3) x, y, yaw in metres and radians
    - ``covariance``: (3n, 3n), with the common motion of all poses nearly free
    - ``range_errors``: (k,), the factors of `RangePrior.modes`
    - ``sweep``: the share of a turn that scans took which do not say it, and its sigma; None if
      there is none (`StopScan.sweep`)
    - ``rms``: metres, of the residuals
    - ``matched``: (n,), how many correspondences each stop has
    """

    poses: Floats
    covariance: Floats
    range_errors: Floats
    rms: float
    matched: Floats
    sweep: tuple[float, float] | None = None


def polish(
    stops: Sequence[StopScan | None],
    poses: Floats,
    pairs: Sequence[tuple[int, int]],
    edges: Sequence[GraphEdge],
    *,
    gates: Sequence[float],
    kernel: float,
    correlation: float,
    ranges: RangePrior,
    settled: float = 1e-5,
) -> Polished:
    """Refine all poses (n, 3) by one Gauss-Newton over the points of all pairs, both ways.

    The ``edges`` (odometry) bind directions that the scans leave open; ``stops`` without a scan are
    None. The points are paired within each of the ``gates`` in turn, metres, and weighed by a
    Geman-McClure kernel of at least ``kernel`` metres. ``ranges`` is the prior of the errors that
    all ranges share. The iteration at the last gate ends with a step of the poses below ``settled``
    (metres, radians), and at the wider ones with a step that changes hardly a pair of points.
    The covariance counts each beam once, however many pairs use it, and ``correlation`` beams as
    one.
    """
    scans = {i: stop for i, stop in enumerate(stops) if stop is not None and len(stop.points)}
    both = [(a, b) for a, b in pairs if a in scans and b in scans]
    ordered = sorted({*both, *((b, a) for a, b in both)})
    sources = {t: [s for s, target in ordered if target == t] for _, t in ordered}
    targets = [_Target.of(t, scans, its, ranges) for t, its in sorted(sources.items())]
    poses = poses.astype(np.float64).copy()
    sweeps = any(stop.sweep is not None for stop in scans.values())
    prior = np.append(ranges.sigmas, [_SWEEP_SIGMA] * sweeps)
    last = 3 * len(poses)
    size = last + len(prior)
    errors, sigma = np.zeros(len(prior)), kernel
    sums = _Sums(np.zeros((size, size)), np.zeros(size), 0.0, 0.0, np.zeros(len(poses)))
    # Every beam is in up to 2 (n - 1) residuals, and neighbours err together.
    repeats = max(2.0 * len(ordered) / max(2 * len(scans), 1), 1.0)
    thinning = np.mean([_every(stop) for stop in scans.values()]) if scans else 1.0
    effective = repeats * max(correlation / float(thinning), 1.0)
    for gate in gates:
        width = max(kernel, gate / 5)
        small = settled if gate == gates[-1] else max(settled, _SETTLED_SHARE * gate)
        for _ in range(_ITERATIONS_A_GATE):
            sums = _correspond(targets, poses, errors, gate, width)
            sigma = max(float(np.sqrt(sums.squared / max(sums.weight, 1e-9))), _LEAST_SIGMA)
            variance = sigma**2 * effective
            system, gradient = sums.system / variance, sums.gradient / variance
            _add_priors(system, gradient, poses, errors, edges, prior)
            step = cho_solve(cho_factor(system), -gradient)
            poses += step[:last].reshape(-1, 3)
            poses[:, 2] = wrap_angles(poses[:, 2])
            errors = errors + step[last:]
            if np.abs(step[:last]).max() < small:
                break
    system = sums.system / (sigma**2 * effective)
    _add_priors(system, np.zeros(size), poses, errors, edges, prior)
    covariance = cho_solve(cho_factor(system), np.eye(size))
    sweep = (float(errors[-1]), float(np.sqrt(covariance[-1, -1]))) if sweeps else None
    errors = errors[: len(errors) - sweeps]
    return Polished(poses, covariance[:last, :last], errors, sigma, sums.matched, sweep)


@dataclass(frozen=True, eq=False)
class _Sums:
    """The normal equations, and sums over all residuals; ``matched`` (n,) are weights by stop."""

    system: Floats
    gradient: Floats
    squared: float
    weight: float
    matched: Floats


def _every(stop: StopScan) -> int:
    return max(1, -(-len(stop.points) // _SOURCE_POINTS))


@dataclass(frozen=True, eq=False)
class _Target:
    """One scan, and the points of the scans that are paired with it, one scan after the other.

    A coordinate is a row, as sums over long rows are several times as fast as over short ones.

    - ``index``, ``sources``: (p,), of the stops
    - ``ends``: (p + 1,) where each source's points begin, and the last one's end
    - ``points``, ``normals``, ``directions``: (2, n) of the sources, each in its own base
    - ``to_points``, ``to_normals``, ``to_directions``: (2, m) of the target
    - ``modes``, ``to_modes``: (n, k) and (m, k), of the errors of their ranges
    - ``sweeps``, ``to_sweeps``: (2, n) and (2, m), `StopScan.sweep`, 0 where the scan has none;
      None if no scan has one
    - ``tree``: of the target's points
    """

    index: int
    sources: Ints
    ends: Ints
    points: Floats
    normals: Floats
    directions: Floats
    modes: Floats
    to_points: Floats
    to_normals: Floats
    to_directions: Floats
    to_modes: Floats
    sweeps: Floats | None
    to_sweeps: Floats | None
    tree: cKDTree

    @staticmethod
    def of(
        index: int, scans: dict[int, StopScan], sources: Sequence[int], ranges: RangePrior
    ) -> _Target:
        def of_sources(name: str) -> Floats:
            parts = [getattr(scans[s], name)[:: _every(scans[s])] for s in sources]
            return np.ascontiguousarray(np.concatenate(parts).T)

        own = scans[index]
        beams = of_sources("directions")
        swept = any(stop.sweep is not None for stop in scans.values())
        moves = [_sweep(scans[s])[:: _every(scans[s])] for s in sources] if swept else []
        counts = [len(scans[s].points[:: _every(scans[s])]) for s in sources]
        return _Target(
            index=index,
            sources=np.array(sources, dtype=np.int64),
            ends=np.cumsum([0, *counts], dtype=np.int64),
            points=of_sources("points"),
            normals=of_sources("normals"),
            directions=beams,
            modes=ranges.modes(beams.T),
            to_points=np.ascontiguousarray(own.points.T),
            to_normals=np.ascontiguousarray(own.normals.T),
            to_directions=np.ascontiguousarray(own.directions.T),
            to_modes=ranges.modes(own.directions),
            sweeps=np.ascontiguousarray(np.concatenate(moves).T) if swept else None,
            to_sweeps=np.ascontiguousarray(_sweep(own).T) if swept else None,
            tree=cKDTree(own.points),
        )


def _sweep(stop: StopScan) -> Floats:
    return np.zeros_like(stop.points) if stop.sweep is None else stop.sweep


def _correspond(
    targets: Sequence[_Target], poses: Floats, errors: Floats, gate: float, kernel: float
) -> _Sums:
    """Accumulate the normal equations of n_t . (P_s p - P_t q) over all ordered pairs."""
    size = 3 * len(poses) + len(errors)
    system, gradient = np.zeros((size, size)), np.zeros(size)
    none = np.zeros(0)
    residuals, weights, stops = [none], [none], [np.zeros(0, dtype=np.int64)]
    for target in targets:  # one at a time: its points stay in the processor's cache
        rows, residual, ends = _paired(target, poses, errors, gate)
        weight = kernel_weight(residual, kernel)
        weighted = rows * weight[:, None]
        for source, (a, b) in zip(target.sources.tolist(), pairwise(ends.tolist()), strict=True):
            at = np.concatenate(
                [3 * source + _POSE, 3 * target.index + _POSE, np.arange(3 * len(poses), size)]
            )
            system[np.ix_(at, at)] += weighted[a:b].T @ rows[a:b]
            gradient[at] += weighted[a:b].T @ residual[a:b]
        residuals.append(residual)
        weights.append(weight)
        stops.append(np.repeat(target.sources, np.diff(ends)))
    all_residuals, all_weights = np.concatenate(residuals), np.concatenate(weights)
    matched = np.bincount(np.concatenate(stops), weights=all_weights, minlength=len(poses))
    squared, total = float(all_weights @ all_residuals**2), float(all_weights.sum())
    return _Sums(system, gradient, squared, total, np.asarray(matched, dtype=np.float64))


def _paired(
    target: _Target, poses: Floats, errors: Floats, gate: float
) -> tuple[Floats, Floats, Ints]:
    """Pair points with the nearest ones of a target.

    Returns the derivatives (r, 6 + k) by the source's pose, the target's and the common errors, the
    residuals (r,), and where those of each source begin and the last one's end (p + 1,).
    """
    from_sources, from_target = poses[target.sources], poses[target.index]
    counts = np.diff(target.ends)
    bends = target.modes.shape[1]
    corrected = target.points + (target.modes @ errors[:bends]) * target.directions
    if target.sweeps is not None:
        corrected += errors[-1] * target.sweeps
    relative = compose(inverses(from_target[None]), from_sources).T
    turns = np.repeat(_turns(relative[2]), counts, axis=1)
    moved = _turned(turns, corrected) + np.repeat(relative[:2], counts, axis=1)
    distance, index = target.tree.query(np.ascontiguousarray(moved.T), distance_upper_bound=gate)
    found = np.flatnonzero(np.isfinite(distance))
    index = index[found]
    facing = _turned(turns[:, found], target.normals[:, found])
    agree = _dot(facing, target.to_normals[:, index]) > _NORMAL_COSINE
    found, index = found[agree], index[agree]
    ends = np.searchsorted(found, target.ends)
    counts = np.diff(ends)
    turns, turn = np.repeat(_turns(from_sources[:, 2]), counts, axis=1), _turns(from_target[2:])
    p = _turned(turns, corrected[:, found])
    to_modes, to_beams = target.to_modes[index], target.to_directions[:, index]
    to_points = target.to_points[:, index] + (to_modes @ errors[:bends]) * to_beams
    if target.to_sweeps is not None:
        to_points += errors[-1] * target.to_sweeps[:, index]
    q = _turned(turn, to_points)
    n = _turned(turn, target.to_normals[:, index])
    apart = p + np.repeat(from_sources[:, :2].T, counts, axis=1) - q - from_target[:2, None]
    by_source = _dot(n, _turned(turns, target.directions[:, found]))
    by_target = _dot(n, _turned(turn, to_beams))
    rows = np.empty((len(index), 6 + len(errors)))
    rows[:, 0:2], rows[:, 3:5] = n.T, -n.T
    rows[:, 2] = n[1] * p[0] - n[0] * p[1]
    rows[:, 5] = -(n[1] * q[0] - n[0] * q[1]) + (n[0] * apart[1] - n[1] * apart[0])
    rows[:, 6 : 6 + bends] = by_source[:, None] * target.modes[found]
    rows[:, 6 : 6 + bends] -= by_target[:, None] * to_modes
    if target.sweeps is not None and target.to_sweeps is not None:
        rows[:, -1] = _dot(n, _turned(turns, target.sweeps[:, found]))
        rows[:, -1] -= _dot(n, _turned(turn, target.to_sweeps[:, index]))
    return rows, _dot(n, apart), ends


def _turns(yaws: Floats) -> Floats:
    """Return (2, n): the cosines and sines of (n,) angles."""
    return np.stack([np.cos(yaws), np.sin(yaws)])


def _turned(turns: Floats, vectors: Floats) -> Floats:
    """Turn (2, n) vectors, each by its own angle or all by one."""
    (c, s), (x, y) = turns, vectors
    return np.stack([c * x - s * y, s * x + c * y])


def _dot(one: Floats, other: Floats) -> Floats:
    """Return the products (n,) of (2, n) vectors."""
    return np.asarray(one[0] * other[0] + one[1] * other[1])


_POSE = np.arange(3)


def _add_priors(
    system: Floats,
    gradient: Floats,
    poses: Floats,
    errors: Floats,
    edges: Sequence[GraphEdge],
    sigmas: Floats,
) -> None:
    if edges:
        jacobian, columns = edge_jacobians(poses, edges)
        # The seventh column belongs to the ranges here, and edges do not depend on them.
        jacobian[:, :, 6] = 0.0
        information = np.stack([edge.information for edge in edges])
        accumulate(system, gradient, jacobian, columns, information, edge_errors(poses, edges))
    loose, own = np.arange(3 * len(poses)), np.arange(3 * len(poses), len(system))
    system[loose, loose] += _LOOSE
    system[own, own] += sigmas**-2.0
    gradient[own] += errors / sigmas**2
