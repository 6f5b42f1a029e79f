"""The joint robust fit: one shape to the edge points of all views, poses and scale as nuisances."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tablemap.config import SurfaceConfig
from tablemap.geometry import Floats
from tablemap.surface.evidence import Evidence, Ints, place, turn
from tablemap.surface.shapes import Shape
from tablemap.surface.straight import Sided

COMMON = 5  # nuisances that all views share


@dataclass(frozen=True, eq=False)
class Anchor:
    """Holds a side that no edge point holds: near ``point`` (2,), within ``sigma`` metres.

    Where nothing bounds the side from outside, ``point`` is where the seen top ends.
    """

    side: int
    point: Floats
    sigma: float
    is_bounded: bool = True


@dataclass(frozen=True)
class Noise:
    """How edge points scatter: ``near`` and ``far`` multiply the sigma of near and of far edges.

    ``kappa`` neighbouring points count as one.
    """

    near: float
    far: float
    kappa: float

    def sigma(self, evidence: Evidence) -> Floats:
        """Return the (N,) standard deviations along the normal, metres."""
        return evidence.sigma * np.where(evidence.is_near, self.near, self.far)


@dataclass(frozen=True, eq=False)
class JointFit:
    """A shape fitted together with its nuisances.

    ``whitened`` (m,) are the pose corrections in units of their prior, ``common`` (5,) what all
    views share: the depth scale, the outward bias of near and of far edges (in sigmas of a point)
    and the camera's shift in the base (x, y metres), for what the registration calls systematic.
    ``points`` (N, 2), with the nuisances applied, have residuals ``distance`` (N,) metres to
    side ``side`` (N,); ``misfit`` (N,) is the
    residual over its sigma, endings and wrong normals included. ``covariance`` (k, k) is of the
    parameters, correlation accounted for. ``data_cost`` is the sum of robust squared residuals,
    not divided by kappa; ``prior_cost`` that of the nuisances and the anchors.
    """

    shape: Shape
    whitened: Floats
    common: Floats
    covariance: Floats
    points: Floats
    normals: Floats
    distance: Floats
    misfit: Floats
    side: Ints
    anchors: tuple[Anchor, ...]
    data_cost: float
    prior_cost: float
    noise: Noise


@dataclass(frozen=True, eq=False)
class _Linearised:
    """The problem about one state: normal equations and what they were made from."""

    hessian: Floats
    gradient: Floats
    cost: float
    data_cost: float
    prior_cost: float
    misfit: Floats
    points: Floats
    normals: Floats
    distance: Floats
    side: Ints


def fit_jointly(
    start: JointFit,
    evidence: Evidence,
    config: SurfaceConfig,
    *,
    gates: tuple[float, ...],
    iterations: int,
    anchors: tuple[Anchor, ...] = (),
    noise: Noise,
) -> JointFit:
    """Fit by damped Gauss-Newton with a Geman-McClure loss that narrows.

    ``gates`` are the loss's scales in sigmas, wide to narrow (graduated non-convexity, Yang et al.,
    RA-L 2020); ``iterations`` is spent on each.
    """
    shape, whitened, common = start.shape, start.whitened, start.common
    damping = 1e-4
    for gate in gates:
        now = _linearise(shape, whitened, common, evidence, config, gate, anchors, noise)
        for _ in range(iterations):
            step = _solve(now.hessian, now.gradient, damping)
            size = len(shape.parameters)
            next_shape = shape.at(shape.parameters - step[:size])
            next_common = common - step[size : size + COMMON]
            next_whitened = whitened - step[size + COMMON :]
            if not next_shape.is_plausible():
                damping *= 10
                if damping > 1e4:
                    break
                continue
            after = _linearise(
                next_shape, next_whitened, next_common, evidence, config, gate, anchors, noise
            )
            gain = now.cost - after.cost
            if gain < -1e-9 * now.cost:
                damping *= 10
                if damping > 1e4:
                    break
                continue
            shape, whitened, common, now = next_shape, next_whitened, next_common, after
            damping = max(damping / 10, 1e-9)
            if gain < _SETTLED:
                break
        damping = min(damping, 1e-4)
    final = _linearise(
        shape, whitened, common, evidence, config, config.loss_sigmas, anchors, noise
    )
    return JointFit(
        shape=shape,
        whitened=whitened,
        common=common,
        covariance=_covariance(final, len(shape.parameters)),
        points=final.points,
        normals=final.normals,
        distance=final.distance,
        misfit=final.misfit,
        side=final.side,
        anchors=anchors,
        data_cost=final.data_cost,
        prior_cost=final.prior_cost,
        noise=noise,
    )


def unfitted(shape: Shape, evidence: Evidence) -> JointFit:
    """Make a start of a shape, with no nuisance applied."""
    size, count = len(shape.parameters), len(evidence.in_base)
    return JointFit(
        shape=shape,
        whitened=np.zeros(evidence.prior_root.shape[1]),
        common=evidence.common_mean,
        covariance=np.zeros((size, size)),
        points=evidence.points,
        normals=evidence.normals,
        distance=np.zeros(count),
        misfit=np.zeros(count),
        side=np.full(count, -1, dtype=np.int64),
        anchors=(),
        data_cost=np.inf,
        prior_cost=0.0,
        noise=Noise(1.0, 1.0, 1.0),
    )


def with_nuisances_of(shape: Shape, other: JointFit) -> JointFit:
    """Start a shape from the nuisances of another fit."""
    return replace(other, shape=shape, covariance=np.zeros((len(shape.parameters),) * 2))


def corrected_poses(fit: JointFit, evidence: Evidence) -> Floats:
    """Return all snapshots' poses (n, 3) as the fit has them, relative to the origin."""
    correction = (evidence.prior_root @ fit.whitened).reshape(-1, 3)
    return evidence.poses + correction


def robust(misfit: Floats, gate: float) -> Floats:
    """Geman-McClure's loss of normalised residuals; it never exceeds ``gate`` squared."""
    squared = np.minimum(misfit, 1e6) ** 2
    return squared / (1 + squared / gate**2)


def _linearise(
    shape: Shape,
    whitened: Floats,
    common: Floats,
    evidence: Evidence,
    config: SurfaceConfig,
    gate: float,
    anchors: tuple[Anchor, ...],
    noise: Noise,
) -> _Linearised:
    poses = evidence.poses + (evidence.prior_root @ whitened).reshape(-1, 3)
    yaw = poses[evidence.view, 2]
    normals = turn(evidence.normal_in_base, yaw)
    scaling = turn(evidence.lever, yaw)
    bias = np.where(evidence.is_near, common[1], common[2]) * evidence.sigma
    points = place(evidence.in_base, evidence.view, poses) + common[0] * scaling
    forward = np.column_stack([np.cos(yaw), np.sin(yaw)])
    leftward = np.column_stack([-np.sin(yaw), np.cos(yaw)])
    points = points - bias[:, None] * normals
    points = points + common[3] * forward + common[4] * leftward
    measure = shape.measure(points, normals)

    sigma = noise.sigma(evidence)
    facing = np.sum(normals * measure.normal, axis=1)
    stray = (facing < config.normal_cosine) | (measure.side < 0)
    misfit = np.hypot(measure.distance, measure.excess) / sigma
    misfit = np.where(stray, 1e6, misfit)
    loss = robust(misfit, gate)
    weight = 1 / (1 + np.minimum(misfit, 1e6) ** 2 / gate**2) ** 2 / (sigma**2 * noise.kappa)
    weight = np.where(stray, 0.0, weight)

    arm = points - poses[evidence.view, :2]
    by_pose = np.column_stack(
        [measure.normal, measure.normal[:, 1] * arm[:, 0] - measure.normal[:, 0] * arm[:, 1]]
    )
    by_common = np.column_stack(
        [
            np.sum(measure.normal * scaling, axis=1),
            np.where(evidence.is_near, -facing * evidence.sigma, 0.0),
            np.where(evidence.is_near, 0.0, -facing * evidence.sigma),
            np.sum(measure.normal * forward, axis=1),
            np.sum(measure.normal * leftward, axis=1),
        ]
    )
    inner = np.column_stack([measure.jacobian, by_common])
    size = inner.shape[1]
    total = size + evidence.prior_root.shape[1]
    hessian = np.zeros((total, total))
    gradient = np.zeros(total)
    weighted = inner * weight[:, None]
    hessian[:size, :size] = weighted.T @ inner
    gradient[:size] = weighted.T @ measure.distance
    blocks = np.zeros_like(evidence.prior_root)
    root = evidence.prior_root.reshape(len(poses), 3, evidence.prior_root.shape[1])
    # Per view three by three and three by few first: the whitened nuisances couple all views.
    for index, part in zip(evidence.views, evidence.view_slices, strict=True):
        heavy = by_pose[part] * weight[part, None]
        moved = heavy.T @ by_pose[part] @ root[index]
        blocks[3 * index : 3 * index + 3] = moved
        hessian[size:, :size] += root[index].T @ (heavy.T @ inner[part])
        gradient[size:] += root[index].T @ (heavy.T @ measure.distance[part])
    hessian[size:, size:] = evidence.prior_root.T @ blocks
    hessian[:size, size:] = hessian[size:, :size].T

    prior = evidence.common_sigma
    at = np.arange(size - COMMON, size)
    hessian[at, at] += 1 / prior**2
    gradient[at] += (common - evidence.common_mean) / prior**2
    at = np.arange(size, total)
    hessian[at, at] += 1.0
    gradient[at] += whitened
    prior_cost = float(np.sum(((common - evidence.common_mean) / prior) ** 2) + np.sum(whitened**2))
    if anchors and isinstance(shape, Sided):
        held = shape.against(
            np.array([a.point for a in anchors]), np.array([a.side for a in anchors])
        )
        precision = np.array([a.sigma for a in anchors]) ** -2.0
        hessian[: size - COMMON, : size - COMMON] += (
            held.jacobian * precision[:, None]
        ).T @ held.jacobian
        gradient[: size - COMMON] += (held.jacobian * precision[:, None]).T @ held.distance
        prior_cost += float(np.sum(precision * held.distance**2))
    data_cost = float(loss.sum())
    return _Linearised(
        hessian=hessian,
        gradient=gradient,
        cost=data_cost / noise.kappa + prior_cost,
        data_cost=data_cost,
        prior_cost=prior_cost,
        misfit=misfit,
        points=points,
        normals=normals,
        distance=measure.distance,
        side=np.where(stray, -1, measure.side),
    )


# A gain in cost that is worth no further iteration: a tenth of a standard deviation.
_SETTLED = 5e-3

# Information added to every shape parameter: ten metres, ten radians; so nothing is ever singular.
_RIDGE = 1e-2


def _solve(hessian: Floats, gradient: Floats, damping: float) -> Floats:
    damped = hessian + np.diag(damping * np.diag(hessian) + _RIDGE * 1e-3)
    return np.asarray(np.linalg.solve(damped, gradient), dtype=np.float64)


def _covariance(final: _Linearised, size: int) -> Floats:
    """Invert the normal equations at the solution.

    The nuisances' block is eliminated first (Schur), so that the shape's is regular with the ridge.
    """
    shape_part = final.hessian[:size, :size] + _RIDGE * np.eye(size)
    coupling = final.hessian[:size, size:]
    reduced = shape_part - coupling @ np.linalg.solve(final.hessian[size:, size:], coupling.T)
    values, vectors = np.linalg.eigh((reduced + reduced.T) / 2)
    covariance: Floats = (vectors / np.maximum(values, _RIDGE)) @ vectors.T
    return covariance
