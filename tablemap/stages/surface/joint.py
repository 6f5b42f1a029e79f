"""The joint robust fit: one shape to the edge points of all views, poses and scale as nuisances."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tablemap.config import SurfaceConfig
from tablemap.geometry import Floats, Ints
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.priors import PER_VIEW
from tablemap.stages.surface.residuals import (
    Noise,
    Residuals,
    State,
    linearise,
    observe,
    prior_cost,
    robust,
)
from tablemap.stages.surface.shapes.shape import Shape
from tablemap.stages.surface.shapes.straight import Sided


@dataclass(frozen=True, eq=False)
class Anchor:
    """Holds a side that no edge point holds: near ``point`` (2,), within ``sigma`` metres.

    Where nothing bounds the side from outside, ``point`` is where the seen top ends.
    """

    side: int
    point: Floats
    sigma: float
    is_bounded: bool = True


@dataclass(frozen=True, eq=False)
class JointFit:
    """A shape fitted together with its nuisances.

    ``whitened`` (m,) are the views' corrections in units of their prior, ``common`` (6,) what all
    views share: the depth scale, the outward bias of near and of far edges (in sigmas of a point),
    the camera's shift in the base (x, y metres), for what the registration calls systematic, and
    how far within the outline far edges end (metres).
    ``points`` (N, 2), with the nuisances applied, have residuals ``distance`` (N,) metres to
    side ``side`` (N,); ``misfit`` (N,) is the residual over its sigma, endings and wrong normals
    included. ``data_cost`` is the sum of robust squared residuals, not divided by kappa;
    ``prior_cost`` that of the nuisances and the anchors.
    """

    shape: Shape
    whitened: Floats
    common: Floats
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
class Spread:
    """What a fit leaves open, neighbours that err together accounted for.

    ``covariance`` (k, k) is of the shape's parameters, ``scale_sigma`` of the depth scale;
    ``by_scale`` (k,) is how far the parameters move with that, all else at its best.
    """

    covariance: Floats
    scale_sigma: float
    by_scale: Floats


@dataclass(frozen=True, eq=False)
class _Held:
    """The problem about one state: its residuals, what it costs, and how the anchors pull."""

    seen: Residuals
    cost: float
    data_cost: float
    prior_cost: float


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
    state = State(start.shape, start.whitened, start.common)
    damping = 1e-4
    now, gate = None, None
    for gate in gates:
        now = _hold(state, evidence, config, gate, anchors, noise)
        equations = None
        for _ in range(iterations):
            if equations is None:
                equations = _equations(now, evidence, gate, anchors, noise)
            moved = now.seen.state.moved(_solve(*equations, damping))
            after = None
            if moved.shape.is_plausible():
                after = _hold(moved, evidence, config, gate, anchors, noise)
            if after is None or after.cost > now.cost * (1 + 1e-9):
                damping *= 10
                if damping > 1e4:
                    break
                continue
            gain = now.cost - after.cost
            now, equations = after, None
            damping = max(damping / 10, 1e-9)
            if gain < _SETTLED:
                break
        state = now.seen.state
        damping = min(damping, 1e-4)
    if now is None or gate != config.loss_sigmas:
        now = _hold(state, evidence, config, config.loss_sigmas, anchors, noise)
    return JointFit(
        shape=now.seen.state.shape,
        whitened=now.seen.state.whitened,
        common=now.seen.state.common,
        points=now.seen.points,
        normals=now.seen.normals,
        distance=now.seen.measure.distance,
        misfit=np.sqrt(now.seen.squared),
        side=np.where(now.seen.stray, -1, now.seen.measure.side),
        anchors=anchors,
        data_cost=now.data_cost,
        prior_cost=now.prior_cost,
        noise=noise,
    )


def unfitted(shape: Shape, evidence: Evidence) -> JointFit:
    """Make a start of a shape, with no nuisance applied."""
    count = len(evidence.in_base)
    return JointFit(
        shape=shape,
        whitened=np.zeros(evidence.prior_root.shape[1]),
        common=evidence.common_mean,
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
    return replace(other, shape=shape)


def corrected_poses(fit: JointFit, evidence: Evidence) -> Floats:
    """Return all snapshots' poses (n, 3) as the fit has them, relative to the origin."""
    correction = (evidence.prior_root @ fit.whitened).reshape(-1, PER_VIEW)[:, :3]
    return evidence.poses + correction


def spread_of(fit: JointFit, evidence: Evidence, config: SurfaceConfig) -> Spread:
    """Invert the normal equations at a fit.

    The nuisances' block is eliminated first (Schur), so that the shape's is regular with the ridge.
    """
    state = State(fit.shape, fit.whitened, fit.common)
    held = _hold(state, evidence, config, config.loss_sigmas, fit.anchors, fit.noise)
    hessian, _ = _equations(held, evidence, config.loss_sigmas, fit.anchors, fit.noise)
    size = len(fit.shape.parameters)
    at = np.arange(size)
    hessian[at, at] += _RIDGE
    coupling = hessian[:size, size:]
    reduced = hessian[:size, :size] - coupling @ np.linalg.solve(hessian[size:, size:], coupling.T)
    values, vectors = np.linalg.eigh((reduced + reduced.T) / 2)
    covariance: Floats = (vectors / np.maximum(values, _RIDGE)) @ vectors.T
    unit = np.zeros(len(hessian))
    unit[size] = 1.0
    with_scale = np.linalg.solve(hessian, unit)
    variance = max(float(with_scale[size]), 1e-18)
    by_scale = np.asarray(with_scale[:size] / variance, dtype=np.float64)
    return Spread(covariance, float(np.sqrt(variance)), by_scale)


# A gain in cost that is worth no further iteration: a tenth of a standard deviation.
_SETTLED = 5e-3

# Information added to every shape parameter: ten metres, ten radians; so nothing is ever singular.
_RIDGE = 1e-2


def _hold(
    state: State,
    evidence: Evidence,
    config: SurfaceConfig,
    gate: float,
    anchors: tuple[Anchor, ...],
    noise: Noise,
) -> _Held:
    seen = observe(state, evidence, config, noise)
    data = float(robust(seen.squared, gate).sum())
    prior = prior_cost(state, evidence)
    if anchors and isinstance(state.shape, Sided):
        distance, _, precision = _pull(state.shape, anchors)
        prior += float(precision @ distance**2)
    return _Held(seen, data / noise.kappa + prior, data, prior)


def _equations(
    held: _Held, evidence: Evidence, gate: float, anchors: tuple[Anchor, ...], noise: Noise
) -> tuple[Floats, Floats]:
    hessian, gradient = linearise(held.seen, evidence, gate, noise)
    shape = held.seen.state.shape
    if anchors and isinstance(shape, Sided):
        distance, jacobian, precision = _pull(shape, anchors)
        size = len(shape.parameters)
        weighted = (jacobian * precision[:, None]).T
        hessian[:size, :size] += weighted @ jacobian
        gradient[:size] += weighted @ distance
    return hessian, gradient


def _pull(shape: Sided, anchors: tuple[Anchor, ...]) -> tuple[Floats, Floats, Floats]:
    """Return the anchors' distances (a,), their derivatives (a, k) and their precisions (a,)."""
    held = shape.against(np.array([a.point for a in anchors]), np.array([a.side for a in anchors]))
    return held.distance, held.jacobian, np.array([a.sigma for a in anchors]) ** -2.0


def _solve(hessian: Floats, gradient: Floats, damping: float) -> Floats:
    damped = hessian + np.diag(damping * np.diag(hessian) + _RIDGE * 1e-3)
    return np.asarray(np.linalg.solve(damped, gradient), dtype=np.float64)
