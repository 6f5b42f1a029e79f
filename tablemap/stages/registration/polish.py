"""Refinement of all stops at once, point to line, with the errors of all ranges as nuisances.

A laser's ranges err by millimetres that change slowly with the beam's angle (Kneip, Tache, Caprari
and Siegwart, "Characterization of the compact Hokuyo URG-04LX 2D laser range finder", ICRA 2009).
Stops that see one wall at different angles show this error: without it the poses take it up, and
the whole ring of stops becomes wider or narrower.
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
    - ``rms``: metres, of the residuals
    - ``matched``: (n,), how many correspondences each stop has
    """

    poses: Floats
    covariance: Floats
    range_errors: Floats
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
    ranges: RangePrior,
    settled: float = 1e-6,
) -> Polished:
    """Refine all poses (n, 3) by one Gauss-Newton over the points of all pairs, both ways.

    The ``edges`` (odometry) bind directions that the scans leave open; ``stops`` without a scan are
    None. The points are paired within each of the ``gates`` in turn, metres, and weighed by a
    Geman-McClure kernel of at least ``kernel`` metres. ``ranges`` is the prior of the errors that
    all ranges share. The iteration at a gate ends with a step below ``settled`` (metres, radians).
    The covariance counts each beam once, however many pairs use it, and ``correlation`` beams as
    one.
    """
    scans = {i: stop for i, stop in enumerate(stops) if stop is not None and len(stop.points)}
    both = [(a, b) for a, b in pairs if a in scans and b in scans]
    ordered = sorted({*both, *((b, a) for a, b in both)})
    paired = _PairedPoints.of(scans, ordered, ranges)
    poses = poses.astype(np.float64).copy()
    prior = ranges.sigmas
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
        for _ in range(_ITERATIONS_A_GATE):
            sums = _correspond(paired, poses, errors, gate, width)
            sigma = max(float(np.sqrt(sums.squared / max(sums.weight, 1e-9))), _LEAST_SIGMA)
            variance = sigma**2 * effective
            system, gradient = sums.system / variance, sums.gradient / variance
            _add_priors(system, gradient, poses, errors, edges, prior)
            step = cho_solve(cho_factor(system), -gradient)
            poses += step[:last].reshape(-1, 3)
            poses[:, 2] = wrap_angles(poses[:, 2])
            errors = errors + step[last:]
            if np.abs(step).max() < settled:
                break
    system = sums.system / (sigma**2 * effective)
    _add_priors(system, np.zeros(size), poses, errors, edges, prior)
    covariance = cho_solve(cho_factor(system), np.eye(size))[:last, :last]
    return Polished(poses, covariance, errors, sigma, sums.matched)


@dataclass(frozen=True, eq=False)
class _Sums:
    system: Floats
    gradient: Floats
    squared: float
    weight: float
    matched: Floats


def _every(stop: StopScan) -> int:
    return max(1, -(-len(stop.points) // _SOURCE_POINTS))


@dataclass(frozen=True, eq=False)
class _PairedPoints:
    """The points of all ordered pairs, one after the other, those of one target together.

    - ``pairs``: (p, 2) source and target
    - ``ends``: (p + 1,) where each pair's points begin, and the last one's end
    - ``pair``: (n,) the pair of each point
    - ``points``, ``normals``, ``directions``: (n, 2) of the sources, each in its own base
    - ``to_points``, ``to_normals``, ``to_directions``: (m, 2) of the targets
    - ``modes``, ``to_modes``: (n, k) and (m, k), of the errors of their ranges
    - ``offset``: (p,) where each pair's target begins in these
    - ``trees``: by target, of its points
    """

    pairs: Ints
    ends: Ints
    pair: Ints
    points: Floats
    normals: Floats
    directions: Floats
    to_points: Floats
    to_normals: Floats
    to_directions: Floats
    modes: Floats
    to_modes: Floats
    offset: Ints
    trees: dict[int, cKDTree]

    @staticmethod
    def of(
        scans: dict[int, StopScan], pairs: Sequence[tuple[int, int]], ranges: RangePrior
    ) -> _PairedPoints:
        ordered = sorted(pairs, key=lambda pair: (pair[1], pair[0]))
        thinned = {i: slice(None, None, _every(stop)) for i, stop in scans.items()}
        sources = [(scans[s], thinned[s]) for s, _ in ordered]
        counts = [len(stop.points[every]) for stop, every in sources]
        sizes = [len(stop.points) for stop in scans.values()]
        begin = dict(zip(scans, _begins(sizes), strict=True))

        def all_of(name: str) -> Floats:
            none = np.zeros((0, 2))
            return np.concatenate([none, *(getattr(stop, name)[every] for stop, every in sources)])

        def targets(name: str) -> Floats:
            return np.concatenate([np.zeros((0, 2)), *(getattr(s, name) for s in scans.values())])

        beams, to_beams = all_of("directions"), targets("directions")
        return _PairedPoints(
            pairs=np.array(ordered, dtype=np.int64).reshape(-1, 2),
            ends=np.array([*_begins(counts), sum(counts)], dtype=np.int64),
            pair=np.repeat(np.arange(len(ordered)), counts),
            points=all_of("points"),
            normals=all_of("normals"),
            directions=beams,
            to_points=targets("points"),
            to_normals=targets("normals"),
            to_directions=to_beams,
            modes=ranges.modes(beams),
            to_modes=ranges.modes(to_beams),
            offset=np.array([begin[t] for _, t in ordered], dtype=np.int64),
            trees={i: cKDTree(stop.points) for i, stop in scans.items()},
        )


def _begins(counts: Sequence[int]) -> list[int]:
    return [0, *np.cumsum(counts).tolist()][: len(counts)]


def _correspond(
    paired: _PairedPoints, poses: Floats, errors: Floats, gate: float, kernel: float
) -> _Sums:
    """Accumulate the normal equations of n_t . (P_s p - P_t q) over all ordered pairs."""
    own = 3 * len(poses) + np.arange(len(errors))
    size = 3 * len(poses) + len(errors)
    sources, targets = paired.pairs.T
    relative = compose(inverses(poses[targets]), poses[sources])
    corrected = paired.points + (paired.modes @ errors)[:, None] * paired.directions
    turns = _turns(relative[:, 2])[paired.pair]
    moved = _turned(turns, corrected) + relative[paired.pair, :2]
    distance = np.empty(len(moved))
    index = np.empty(len(moved), dtype=np.int64)
    # The pairs of one target lie together: its tree is asked once.
    bounds = np.flatnonzero(np.diff(targets, prepend=-1, append=-1))
    for first, last in pairwise(bounds.tolist()):
        part = slice(int(paired.ends[first]), int(paired.ends[last]))
        tree = paired.trees[int(targets[first])]
        distance[part], index[part] = tree.query(moved[part], distance_upper_bound=gate)
    found = np.flatnonzero(np.isfinite(distance))
    index = index[found] + paired.offset[paired.pair[found]]
    facing = _turned(turns[found], paired.normals[found])
    agree = np.einsum("ij,ij->i", facing, paired.to_normals[index]) > _NORMAL_COSINE
    found, index = found[agree], index[agree]
    pair = paired.pair[found]
    from_source, from_target = (_turns(poses[of, 2])[pair] for of in (sources, targets))
    p = _turned(from_source, corrected[found])
    to_modes, to_beams = paired.to_modes[index], paired.to_directions[index]
    q = _turned(from_target, paired.to_points[index] + (to_modes @ errors)[:, None] * to_beams)
    n = _turned(from_target, paired.to_normals[index])
    apart = p + poses[sources, :2][pair] - q - poses[targets, :2][pair]
    residual = np.einsum("ij,ij->i", n, apart)
    by_source = np.einsum("ij,ij->i", n, _turned(from_source, paired.directions[found]))
    by_target = np.einsum("ij,ij->i", n, _turned(from_target, to_beams))
    rows = np.empty((len(index), 6 + len(errors)))
    rows[:, 0:2], rows[:, 3:5] = n, -n
    rows[:, 2] = n[:, 1] * p[:, 0] - n[:, 0] * p[:, 1]
    rows[:, 5] = -(n[:, 1] * q[:, 0] - n[:, 0] * q[:, 1])
    rows[:, 5] += n[:, 0] * apart[:, 1] - n[:, 1] * apart[:, 0]
    rows[:, 6:] = by_source[:, None] * paired.modes[found] - by_target[:, None] * to_modes
    weight = kernel_weight(residual, kernel)
    weighted = rows * weight[:, None]
    system, gradient = np.zeros((size, size)), np.zeros(size)
    ends = np.searchsorted(pair, np.arange(len(paired.pairs) + 1))
    for k, (s, t) in enumerate(paired.pairs.tolist()):
        part = slice(int(ends[k]), int(ends[k + 1]))
        columns = np.concatenate([3 * s + _POSE, 3 * t + _POSE, own])
        system[np.ix_(columns, columns)] += weighted[part].T @ rows[part]
        gradient[columns] += weighted[part].T @ residual[part]
    matched: Floats = np.zeros(len(poses))
    np.add.at(matched, sources[pair], weight)
    return _Sums(system, gradient, float(weight @ residual**2), float(weight.sum()), matched)


def _turns(yaws: Floats) -> Floats:
    """Return (n, 2): the cosines and sines of (n,) angles."""
    return np.column_stack([np.cos(yaws), np.sin(yaws)])


def _turned(turns: Floats, vectors: Floats) -> Floats:
    """Turn (n, 2) vectors, each by its own angle."""
    c, s = turns.T
    x, y = vectors.T
    return np.column_stack([c * x - s * y, s * x + c * y])


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
