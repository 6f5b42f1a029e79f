"""Primitives through support lines and depths, with poses, beam width and bias as nuisances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from tablemap.geometry import Floats, Ints
from tablemap.model.shapes import ShapeRecord
from tablemap.robust import reduced_chi_square
from tablemap.stages.legs.evidence import LegEvidence
from tablemap.stages.legs.primitives import has_yaw, sizes_of, support, surface_distance

_CAUCHY = 2.5
_SHARED = 1.3
_SMALLEST = 0.004
_SETTLED = 1e-5  # metres and radians
_YAWS = 8  # start yaws of a fit, over a quarter turn
_AGREE = 0.85  # of the tangents: the others are false ends, where a neighbour hides the thing


@dataclass(frozen=True, eq=False)
class Priors:
    """Priors of the nuisances.

    - ``information``: (3G, 3G) of the pose errors (x, y, yaw) of G groups, None if poses are fixed
    - ``beam``: mean and sigma of the beam's half width, radians
    - ``bias``: mean and sigma of the range bias, metres
    - ``yaw``: angle and sigma, radians: pulls rectangles to the table's axes, up to quarter turns;
      None without
    """

    information: Floats | None
    beam: tuple[float, float]
    bias: tuple[float, float]
    yaw: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Fit:
    """A solution for K legs of one ``kind``.

    - ``parameters``: (K, p), metres and radians in the map
    - ``covariance``: (K, p, p), scaled up where residuals are larger than their sigmas
    - ``cost``: the robust sum of squares with the priors
    - ``costs``: (K,), each leg's part of the cost
    - ``count``: number of residuals
    - ``free``: number of free parameters, without yaws that a prior holds
    - ``shared``: number of those that all legs share
    - ``rms``: (K,) metres, of the tangents
    - ``beam_half_width``, ``range_bias``: radians and metres, the laser's nuisances
    - ``misfits``: each leg's residuals over their sigmas, of its tangents and of its depths
    """

    kind: ShapeRecord
    parameters: Floats
    covariance: Floats
    cost: float
    costs: Floats
    count: int
    free: int
    shared: int
    rms: Floats
    beam_half_width: float
    range_bias: float
    misfits: tuple[tuple[Floats, Floats], ...]


def fit_shapes(
    kind: ShapeRecord,
    evidence: list[LegEvidence],
    start: Floats,
    *,
    priors: Priors,
    tied: bool,
    iterations: int = 12,
) -> Fit:
    """Fit one primitive to each leg, with common nuisances, by robust Gauss-Newton.

    ``start`` is (K, p); with ``tied`` the legs share their size.
    """
    width = start.shape[1]
    legs = len(evidence)
    columns = np.arange(legs * width).reshape(legs, width)
    sizes = sizes_of(kind)
    if tied:
        columns[:, sizes] = columns[:1, sizes]
    _, columns = np.unique(columns, return_inverse=True)
    columns = columns.reshape(legs, width)
    free = int(columns.max()) + 1
    groups = 0 if priors.information is None else len(priors.information) // 3
    beam, bias, poses = free, free + 1, free + 2
    x = np.zeros(free + 2 + 3 * groups)
    x[columns] = start
    x[beam], x[bias] = priors.beam[0], priors.bias[0]
    prior = np.zeros((len(x), len(x)))
    prior[beam, beam] = priors.beam[1] ** -2
    prior[bias, bias] = priors.bias[1] ** -2
    mean = np.zeros(len(x))
    mean[beam], mean[bias] = priors.beam[0], priors.bias[0]
    if groups:
        prior[poses:, poses:] = priors.information
    held = has_yaw(kind) and priors.yaw is not None
    if has_yaw(kind) and priors.yaw is not None:
        prior[columns[:, -1], columns[:, -1]] += priors.yaw[1] ** -2

    # A weak prior gives a leg that was seen from one side only a solution.
    loose = np.full((legs, width), 0.3)
    loose[:, :2] = 0.5
    prior[columns, columns] += 1.0 / loose**2
    mean[columns] = start
    nuisances = np.array([beam, bias])
    for iteration in range(iterations):
        if has_yaw(kind) and priors.yaw is not None:
            quarter = np.round((x[columns[:, -1]] - priors.yaw[0]) / (np.pi / 2))
            mean[columns[:, -1]] = priors.yaw[0] + quarter * np.pi / 2
        normal, gradient = prior.copy(), prior @ (mean - x)
        for leg in range(legs):
            # Tangents are linear in place and size: they are solved first, then the depths join.
            rows = _linearised(kind, x, columns[leg], evidence[leg], beam, groups, iteration >= 2)
            own = np.concatenate([columns[leg], nuisances])
            _add(normal, gradient, rows, own, poses, groups)
        step = np.asarray(scipy.linalg.cho_solve(scipy.linalg.cho_factor(normal), gradient))
        if has_yaw(kind):
            step[columns[:, -1]] = np.clip(step[columns[:, -1]], -0.2, 0.2)
        x = x + step
        x[columns[:, sizes]] = np.clip(x[columns[:, sizes]], _SMALLEST, 3.0)
        if iteration > 3 and float(np.abs(step[: free + 2]).max()) < _SETTLED:
            break

    normal, gradient = prior.copy(), prior @ (mean - x)
    costs, rms, scale = np.zeros(legs), np.zeros(legs), np.ones(legs)
    count = 0
    misfits = []
    for leg in range(legs):
        rows = _linearised(kind, x, columns[leg], evidence[leg], beam, groups, True)
        own = np.concatenate([columns[leg], nuisances])
        _add(normal, gradient, rows, own, poses, groups)
        misfit = rows.residual / rows.sigma
        misfits.append((misfit[: rows.tangents], misfit[rows.tangents :]))
        ratio = misfit**2
        costs[leg] = _CAUCHY**2 * float(np.log1p(ratio / _CAUCHY**2).sum())
        # A depth that this shape cannot explain must not lower its cost.
        costs[leg] += rows.unexplained
        count += len(rows.residual) + rows.unexplained
        if rows.tangents:
            squares = np.sort(rows.residual[: rows.tangents] ** 2)
            rms[leg] = float(np.sqrt(np.mean(squares[: max(int(_AGREE * len(squares)), 1)])))
        if len(rows.residual) > width:
            scale[leg] = max(1.0, reduced_chi_square(ratio))
    covariance = np.asarray(scipy.linalg.inv(normal))
    mean_free = mean - x
    return Fit(
        kind=kind,
        parameters=x[columns],
        covariance=np.stack([covariance[np.ix_(c, c)] for c in columns]) * scale[:, None, None],
        cost=float(costs.sum() + mean_free @ prior @ mean_free),
        costs=costs,
        count=count,
        free=free - (legs if held else 0),
        shared=sizes.stop - sizes.start if tied else 0,
        rms=rms,
        beam_half_width=float(x[beam]),
        range_bias=float(x[bias]),
        misfits=tuple(misfits),
    )


@dataclass(frozen=True, eq=False)
class _LegRows:
    """One leg's linearised residuals.

    - ``residual``, ``sigma``: (n,) metres
    - ``slope``: (n, p + 2), derivatives by the leg's parameters and the laser's nuisances
    - ``pose``: (n, 3), derivatives by the pose error of the row's ``group`` (n,)
    - ``tangents``: how many rows, the first ones, are tangents
    - ``unexplained``: how many depths the shape cannot explain
    """

    residual: Floats
    sigma: Floats
    slope: Floats
    pose: Floats
    group: Ints
    tangents: int
    unexplained: int


def _linearised(
    kind: ShapeRecord,
    x: Floats,
    own: Ints,
    evidence: LegEvidence,
    beam: int,
    groups: int,
    depths: bool,
) -> _LegRows:
    values = x[own]
    h, slope = support(kind, values, evidence.normal)
    residual = np.einsum("ij,ij->i", evidence.normal, evidence.point - values[:2]) - h
    residual = residual - evidence.range * x[beam]
    slope = np.column_stack([-slope, -evidence.range, np.zeros(len(residual))])
    pose = _pose_slope(evidence.normal, evidence.lever)
    group, sigma, tangents = evidence.group, evidence.sigma, len(residual)
    unexplained = 0
    if depths and len(evidence.hit_sigma):
        distance, normals, steps, ok = surface_distance(kind, values, evidence.hits, evidence.rays)
        segments = len(evidence.hit_sigma)
        starts = np.searchsorted(evidence.row, np.arange(segments))
        counts = np.add.reduceat(ok, starts)
        share = ok / np.maximum(counts, 1)[evidence.row]
        cosine = np.einsum("ij,ij->i", normals, evidence.rays)
        beams = np.column_stack([distance - cosine * x[beam + 1], normals, steps, cosine])
        means = np.add.reduceat(beams * share[:, None], starts)[counts > 0]
        unexplained = int((counts == 0).sum())
        seen = counts > 0
        residual = np.concatenate([residual, means[:, 0]])
        depth_slope = np.column_stack([means[:, 3:-1], np.zeros(len(means)), -means[:, -1]])
        slope = np.concatenate([slope, depth_slope])
        pose = np.concatenate([pose, _pose_slope(means[:, 1:3], evidence.hit_lever[seen])])
        group = np.concatenate([group, evidence.hit_group[seen]])
        sigma = np.concatenate([sigma, evidence.hit_sigma[seen]])
    if groups:
        offsets = x[beam + 2 :].reshape(-1, 3)[group]
        residual = residual + np.einsum("ij,ij->i", pose, offsets)
    return _LegRows(residual, sigma, slope, pose, group, tangents, unexplained)


def _pose_slope(normal: Floats, lever: Floats) -> Floats:
    """Return (n, 3): derivatives of a place along ``normal`` by the base's x, y and yaw.

    The place is at ``lever`` from the base.
    """
    return np.column_stack([normal, normal[:, 1] * lever[:, 0] - normal[:, 0] * lever[:, 1]])


def _add(
    normal: Floats,
    gradient: Floats,
    rows: _LegRows,
    own: Ints,
    poses: int,
    groups: int,
) -> None:
    """Add one leg's rows to the normal equations."""
    weight = 1.0 / (rows.sigma**2 * (1.0 + (rows.residual / (_CAUCHY * rows.sigma)) ** 2))
    weighted = rows.slope.T * weight
    normal[np.ix_(own, own)] += weighted @ rows.slope
    gradient[own] -= weighted @ rows.residual
    if not groups:
        return
    # A row knows one pose: what the rows of a group say of it is summed, (groups, p + 6, 3).
    known = np.column_stack([rows.slope, rows.pose, rows.residual])
    products = (known * weight[:, None])[:, :, None] * rows.pose[:, None, :]
    size = products[0].size
    at = size * rows.group[:, None] + np.arange(size)
    sums = np.bincount(at.ravel(), products.ravel(), size * groups)
    by_slope, by_pose, by_residual = np.split(
        sums.reshape(groups, -1, 3), [len(own), len(own) + 3], axis=1
    )
    columns = poses + np.arange(3 * groups).reshape(groups, 3)
    cross = by_slope.transpose(1, 0, 2).reshape(len(own), -1)
    normal[np.ix_(own, columns.ravel())] += cross
    normal[np.ix_(columns.ravel(), own)] += cross.T
    normal[columns[:, :, None], columns[:, None, :]] += by_pose
    gradient[columns] -= by_residual[:, 0]


def fit_alone(
    kind: ShapeRecord,
    evidence: LegEvidence,
    centre: Floats,
    size: float,
    yaw: float,
    *,
    priors: Priors,
) -> Fit:
    """Fit one leg by itself; a shape with a yaw starts from the best of several yaws."""
    if not has_yaw(kind):
        start = np.array([[*centre, size]])
        return fit_shapes(kind, [evidence], start, priors=priors, tied=False)
    starts = yaw + np.arange(_YAWS) / _YAWS * np.pi / 2
    first = [_at_yaw(kind, evidence, centre, angle) for angle in starts]
    best = min(first, key=lambda start: start[0])[1]
    if best[2:-1].min() < _SMALLEST or np.linalg.norm(best[:2] - centre) > size + 0.05:
        best = np.array([*centre, *[size] * len(kind.lengths), yaw])
    return fit_shapes(kind, [evidence], best[None], priors=priors, tied=False)


def _at_yaw(
    kind: ShapeRecord, evidence: LegEvidence, centre: Floats, yaw: float
) -> tuple[float, Floats]:
    """Fit place and sizes at a fixed yaw to the tangents alone: these are linear in both.

    Returns the robust cost and the (p,) parameters.
    """
    trial = np.array([*centre, *[0.0] * len(kind.lengths), yaw])
    slope = support(kind, trial, evidence.normal)[1][:, :-1]
    target = np.einsum("ij,ij->i", evidence.normal, evidence.point - centre)
    weight = 1.0 / evidence.sigma
    for _ in range(4):
        solved = np.linalg.lstsq(slope * weight[:, None], target * weight, rcond=None)[0]
        ratio = ((target - slope @ solved) / (_CAUCHY * evidence.sigma)) ** 2
        weight = 1.0 / (evidence.sigma * np.sqrt(1.0 + ratio))
    trial[:-1] = solved
    trial[:2] += centre
    return float(np.log1p(ratio).sum()), trial


def criterion(fit: Fit) -> float:
    """Return BIC, with residuals discounted a little, as neighbouring ones share some errors.

    A parameter of one leg counts with the number of that leg's residuals; a size that all legs
    share counts with the number of all residuals.
    """
    effective = max(fit.count / _SHARED, 2.0)
    each = max(effective / len(fit.parameters), 2.0)
    return (
        fit.cost / _SHARED
        + fit.shared * float(np.log(effective))
        + (fit.free - fit.shared) * float(np.log(each))
    )
