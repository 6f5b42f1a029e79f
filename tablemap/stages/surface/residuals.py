"""Residuals of edge points against a shape with its nuisances, and the normal equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tablemap.config import SurfaceConfig
from tablemap.geometry import Bools, Floats
from tablemap.robust import geman_mcclure
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.nuisances import CommonNuisances, ViewCorrections
from tablemap.stages.surface.shapes.shape import Measure, Shape

STRAY = 1e6  # the misfit, in sigmas, of a point that belongs to no side


@dataclass(frozen=True)
class Noise:
    """The scatter of edge points.

    near, far: factors on the sigmas of near and of far edges
    kappa: this many neighbouring points count as one
    """

    near: float
    far: float
    kappa: float

    def sigma(self, evidence: Evidence) -> Floats:
        """Return the (N,) standard deviations along the normal, metres."""
        return evidence.sigma * np.where(evidence.is_near, self.near, self.far)


@dataclass(frozen=True, eq=False)
class State:
    """The unknowns of a fit.

    shape: its parameters (k,) come first in the equations
    common: `CommonNuisances` (c,)
    whitened: (m,), the views' corrections in units of their prior; ``Evidence.prior_root`` times
        this vector gives the `ViewCorrections`
    """

    shape: Shape
    whitened: Floats
    common: Floats

    def moved(self, step: Floats) -> State:
        """Return the state less a step (k + c + m,): shape, common, whitened."""
        size = len(self.shape.parameters)
        end = size + CommonNuisances.COUNT
        return State(
            shape=self.shape.at(self.shape.parameters - step[:size]),
            whitened=self.whitened - step[end:],
            common=self.common - step[size:end],
        )


@dataclass(frozen=True, eq=False)
class EdgeResiduals:
    """Edge points as a state places them, and their residuals.

    points, normals: (N, 2), metres relative to the origin, and outward unit vectors
    local: (N, 2), the points in their views' bases, metres
    cosine, sine: (N,), of the views' yaws
    stretch: (N,), 1 + the depth scale
    sigma: (N,), metres, with the stretch included
    squared: (N,), squared normalised residuals; they include distance past a side's end and
        normals that do not fit
    idle: (N,), points of sides that an anchor holds: too few to show where the side is
    """

    state: State
    points: Floats
    normals: Floats
    local: Floats
    cosine: Floats
    sine: Floats
    measure: Measure
    facing: Floats
    stray: Bools
    stretch: Floats
    sigma: Floats
    squared: Floats
    idle: Bools


def observe(
    state: State,
    evidence: Evidence,
    config: SurfaceConfig,
    noise: Noise,
    held: Sequence[int] = (),
) -> EdgeResiduals:
    """Place all edge points by a state's nuisances and measure them against its shape.

    ``held`` are the sides that an anchor holds.
    """
    correction = ViewCorrections.unpack(evidence.prior_root @ state.whitened)
    common = CommonNuisances.unpack(state.common)
    poses = evidence.poses + correction.poses + common.stretch * evidence.spread
    view = evidence.view
    cosine, sine = np.cos(poses[:, 2])[view], np.sin(poses[:, 2])[view]
    scale = (common.scale + correction.scale)[view]
    moved = evidence.motion
    outward = common.widening * evidence.widening + np.where(
        evidence.is_near, common.near_bias * evidence.sigma, -common.set_back
    )
    # A sloping or sagging top is nearer to the camera, or farther, by its rise at the point.
    rise = evidence.points @ np.array([common.slope_x, common.slope_y])
    rise += common.sag * evidence.bulge
    local = evidence.in_base + (scale - rise / evidence.drop)[:, None] * moved.scale
    local += (common.roll + correction.roll)[view, None] * moved.roll
    local += (common.pitch + correction.pitch)[view, None] * moved.pitch
    local += (common.yaw + correction.pan)[view, None] * moved.yaw
    local += common.focal * moved.focal
    local -= outward[:, None] * evidence.normal_in_base
    local += np.array([common.shift_x, common.shift_y])
    points = _turned(local, cosine, sine) + poses[view, :2]
    normals = _turned(evidence.normal_in_base, cosine, sine)
    measure = state.shape.measure(points, normals)
    facing = np.einsum("ij,ij->i", normals, measure.normal)
    stray = (facing < config.normal_cosine) | (measure.side < 0)
    # A depth scale stretches a point's noise too: otherwise small scales would always fit best.
    stretch = 1 + scale
    sigma = noise.sigma(evidence) * stretch
    squared = (measure.distance**2 + measure.excess**2) / sigma**2
    squared = np.where(stray, STRAY**2, np.minimum(squared, STRAY**2))
    return EdgeResiduals(
        state=state,
        points=points,
        normals=normals,
        local=local,
        cosine=cosine,
        sine=sine,
        measure=measure,
        facing=facing,
        stray=stray,
        stretch=stretch,
        sigma=sigma,
        squared=squared,
        idle=np.isin(measure.side, held) & ~stray,
    )


def robust(squared: Floats, gate: float) -> Floats:
    """Geman-McClure's loss of squared normalised residuals; it never exceeds ``gate`` squared."""
    loss: Floats = squared / (1 + squared / gate**2)
    return loss


def prior_cost(state: State, evidence: Evidence) -> float:
    """Return the cost of the nuisances' priors."""
    strain = state.common - evidence.common_mean
    return float(strain @ evidence.common_precision @ strain + state.whitened @ state.whitened)


def linearise(
    seen: EdgeResiduals, evidence: Evidence, gate: float, noise: Noise
) -> tuple[Floats, Floats]:
    """Return the normal equations' matrix and gradient, priors of the nuisances included.

    The order is shape, common, whitened. Each view is first reduced to its few corrections, as the
    whitened nuisances couple all views.
    """
    weight = geman_mcclure(seen.squared / gate**2) / (seen.sigma**2 * noise.kappa)
    weight[seen.stray | seen.idle] = 0.0
    distance, normal = seen.measure.distance, seen.measure.normal
    # The shape's normal in the view's base: there the nuisances are simple.
    forward = seen.cosine * normal[:, 0] + seen.sine * normal[:, 1]
    leftward = seen.cosine * normal[:, 1] - seen.sine * normal[:, 0]

    def by(moved: Floats) -> Floats:
        return forward * moved[:, 0] + leftward * moved[:, 1]

    motion = evidence.motion
    by_lever = by(motion.scale)
    by_scale = by_lever - distance / seen.stretch
    by_roll, by_pitch, by_yaw = by(motion.roll), by(motion.pitch), by(motion.yaw)
    by_slope = -by_lever / evidence.drop * evidence.points.T
    by_turn = leftward * seen.local[:, 0] - forward * seen.local[:, 1]
    by_common = CommonNuisances.stack(
        scale=by_scale,
        roll=by_roll,
        pitch=by_pitch,
        yaw=by_yaw,
        focal=by(motion.focal),
        near_bias=np.where(evidence.is_near, -seen.facing * evidence.sigma, 0.0),
        widening=-seen.facing * evidence.widening,
        shift_x=forward,
        shift_y=leftward,
        set_back=np.where(evidence.is_near, 0.0, seen.facing),
        slope_x=by_slope[0],
        slope_y=by_slope[1],
        sag=-by_lever / evidence.drop * evidence.bulge,
        stretch=np.einsum("ij,ij->i", normal, evidence.spread[evidence.view, :2]),
    )
    by_view = ViewCorrections.stack(
        x=normal[:, 0],
        y=normal[:, 1],
        yaw=by_turn,
        scale=by_scale,
        roll=by_roll,
        pitch=by_pitch,
        pan=by_yaw,
    )
    rows = np.vstack([seen.measure.jacobian.T, by_common])

    size = len(rows)
    root = evidence.prior_root
    total = size + root.shape[1]
    hessian, gradient = np.zeros((total, total)), np.zeros(total)
    weighted = rows * weight
    hessian[:size, :size] = weighted @ rows.T
    gradient[:size] = weighted @ distance
    heavy = by_view * weight
    own = np.zeros((len(evidence.poses), len(by_view), len(by_view)))
    cross = np.zeros((len(evidence.poses), len(by_view), size + 1))
    for index, part in zip(evidence.views, evidence.view_slices, strict=True):
        own[index] = heavy[:, part] @ by_view[:, part].T
        cross[index, :, :size] = heavy[:, part] @ rows[:, part].T
        cross[index, :, size] = heavy[:, part] @ distance[part]
    coupled = root.T @ cross.reshape(-1, size + 1)
    hessian[size:, :size], hessian[:size, size:] = coupled[:, :size], coupled[:, :size].T
    gradient[size:] = coupled[:, size]
    moved = np.matmul(own, root.reshape(*own.shape[:2], root.shape[1]))
    hessian[size:, size:] = root.T @ moved.reshape(root.shape)

    shared = slice(size - CommonNuisances.COUNT, size)
    hessian[shared, shared] += evidence.common_precision
    gradient[shared] += evidence.common_precision @ (seen.state.common - evidence.common_mean)
    at = np.arange(size, total)
    hessian[at, at] += 1.0
    gradient[at] += seen.state.whitened
    return hessian, gradient


def _turned(vectors: Floats, cosine: Floats, sine: Floats) -> Floats:
    result = np.empty_like(vectors)
    result[:, 0] = cosine * vectors[:, 0] - sine * vectors[:, 1]
    result[:, 1] = sine * vectors[:, 0] + cosine * vectors[:, 1]
    return result
