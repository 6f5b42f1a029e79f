"""The joint robust fit of one shape to the edge points of all views, with their nuisances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.config import SurfaceConfig
from tablemap.geometry import Floats, Ints
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.nuisances import CommonNuisances, ViewCorrections
from tablemap.stages.surface.residuals import (
    STRAY,
    EdgeResiduals,
    Noise,
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
    """A prior for a side without edge points: near ``point`` (2,), within ``sigma`` metres.

    If nothing bounds the side from outside, ``point`` is at the end of the seen top.
    """

    side: int
    point: Floats
    sigma: float
    is_bounded: bool = True


@dataclass(frozen=True, eq=False)
class JointFit:
    """A shape fitted together with its nuisances, and the edge points measured against it.

    state: the shape and the nuisances
    points, normals: (N, 2), with the nuisances applied
    distance: (N,), metres to the point's side
    side: (N,), the side of each point, -1 for a point that belongs to none
    misfit: (N,), the residual over its sigma; it also counts distance past a side's end, and
        normals that do not fit
    data_cost: sum of robust squared residuals, not divided by kappa
    prior_cost: cost of the nuisances' priors and of the anchors
    """

    state: State
    points: Floats
    normals: Floats
    distance: Floats
    misfit: Floats
    side: Ints
    anchors: tuple[Anchor, ...]
    data_cost: float
    prior_cost: float
    noise: Noise

    @property
    def shape(self) -> Shape:
        """The fitted shape."""
        return self.state.shape

    @property
    def nuisances(self) -> CommonNuisances:
        """The nuisances that all views share."""
        return CommonNuisances.unpack(self.state.common)


@dataclass(frozen=True, eq=False)
class Spread:
    """The uncertainty of a fit; it takes into account that neighbouring points err together.

    covariance: (k, k), of the shape's parameters
    scale_sigma: of the depth scale, a share
    """

    covariance: Floats
    scale_sigma: float


@dataclass(frozen=True, eq=False)
class _Held:
    """The fit's problem at one state: the residuals, their cost, and the anchors' terms."""

    seen: EdgeResiduals
    cost: float
    data_cost: float
    prior_cost: float


def fit_jointly(
    start: State,
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
    RA-L 2020). Each gate gets up to ``iterations``.
    """
    now, gate = _hold(start, evidence, config, config.loss_sigmas, anchors, noise), None
    damping = 1e-4
    for gate in gates:
        now = _weighed(now.seen, evidence, gate, anchors, noise)
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
        damping = min(damping, 1e-4)
    if gate != config.loss_sigmas:
        now = _weighed(now.seen, evidence, config.loss_sigmas, anchors, noise)
    return _measured(now, anchors, noise)


def measure(state: State, evidence: Evidence, config: SurfaceConfig, *, noise: Noise) -> JointFit:
    """Measure the points against a state's shape, without a fit."""
    return _measured(_hold(state, evidence, config, config.loss_sigmas, (), noise), (), noise)


def _measured(now: _Held, anchors: tuple[Anchor, ...], noise: Noise) -> JointFit:
    return JointFit(
        state=now.seen.state,
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


def unfitted(shape: Shape, evidence: Evidence) -> State:
    """Start a shape with no nuisance applied."""
    whitened = np.zeros(evidence.prior_root.shape[1])
    return State(shape=shape, whitened=whitened, common=evidence.common_mean)


def corrected_poses(fit: JointFit, evidence: Evidence) -> Floats:
    """Return all snapshots' poses (n, 3) with the fit's corrections, relative to the origin."""
    correction = ViewCorrections.unpack(evidence.prior_root @ fit.state.whitened)
    return evidence.poses + correction.poses + fit.nuisances.stretch * evidence.spread


def spread_of(fit: JointFit, evidence: Evidence, config: SurfaceConfig) -> Spread:
    """Invert the normal equations at a fit.

    The nuisances are eliminated first (Schur complement); the ridge keeps the rest regular.
    """
    hessian = information_of(fit, evidence, config)
    size = len(fit.shape.parameters)
    coupling = hessian[:size, size:]
    reduced = hessian[:size, :size] - coupling @ np.linalg.solve(hessian[size:, size:], coupling.T)
    values, vectors = np.linalg.eigh((reduced + reduced.T) / 2)
    covariance: Floats = (vectors / np.maximum(values, _RIDGE)) @ vectors.T
    scale = size + CommonNuisances.place("scale")
    unit = np.zeros(len(hessian))
    unit[scale] = 1.0
    with_scale = np.linalg.solve(hessian, unit)
    return Spread(covariance, float(np.sqrt(max(float(with_scale[scale]), 1e-18))))


def strain_of(fit: JointFit, evidence: Evidence) -> tuple[str, float]:
    """Return which corrections of the views are largest, and how large by what is believed of them.

    The name is a part of a budget. The size is the RMS of the corrections in units of their prior
    sigmas: well below 1 where the edges of all views fit together.
    """
    sources = np.array(evidence.prior_sources)
    sizes = {
        str(name): float(np.sqrt(np.mean(fit.state.whitened[sources == name] ** 2)))
        for name in np.unique(sources)
    }
    name = max(sizes, key=sizes.__getitem__, default="")
    return name, sizes.get(name, 0.0)


def information_of(fit: JointFit, evidence: Evidence, config: SurfaceConfig) -> Floats:
    """Return the information matrix at a fit: shape, common nuisances, the views' corrections.

    If the views' corrections are larger than is believed of them, all is less certain by as much
    (Birge's ratio).
    """
    held = _hold(fit.state, evidence, config, config.loss_sigmas, fit.anchors, fit.noise)
    hessian, _ = _equations(held, evidence, config.loss_sigmas, fit.anchors, fit.noise)
    at = np.arange(len(fit.shape.parameters))
    hessian[at, at] += _RIDGE
    return hessian / max(strain_of(fit, evidence)[1], 1.0) ** 2


# The fit stops at a smaller gain in cost: a tenth of a standard deviation.
_SETTLED = 5e-3

# Information added to every shape parameter (ten metres, ten radians): it prevents singularity.
_RIDGE = 1e-2


def _hold(
    state: State,
    evidence: Evidence,
    config: SurfaceConfig,
    gate: float,
    anchors: tuple[Anchor, ...],
    noise: Noise,
) -> _Held:
    seen = observe(state, evidence, config, noise, [anchor.side for anchor in anchors])
    return _weighed(seen, evidence, gate, anchors, noise)


def _weighed(
    seen: EdgeResiduals, evidence: Evidence, gate: float, anchors: tuple[Anchor, ...], noise: Noise
) -> _Held:
    state = seen.state
    data = float(robust(np.where(seen.idle, STRAY**2, seen.squared), gate).sum())
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
