"""One adjustment of the camera to the level surfaces that it saw: the floor and the table's top.

Floor and top are flat and level. If they look bent or tilted, the camera is wrong. The adjustment
is linear except for small angles: Gauss-Newton with a robust loss that narrows.

A wrong pitch has the same effect on every level plane as a certain depth field. Depth alone cannot
distinguish the two, so the priors divide the effect between them. The edges of the top distinguish
them later (`tablemap.stages.surface`).
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from tablemap.geometry import Bools, Floats
from tablemap.robust import geman_mcclure
from tablemap.stages.calibration.field import (
    REFERENCE_M,
    TERMS,
    DepthField,
    bending_size,
    prior_sigmas,
)
from tablemap.stages.calibration.levels import LevelSamples
from tablemap.stages.snapshots.rounding import FINE, Rounding

WIDE_GATES_M = (0.06, 0.04, 0.03, 0.02, 0.015, 0.012, 0.012)
CLOSE_GATES_M = (0.015, 0.012, 0.010, 0.010, 0.010)
"""Scales of the robust loss, wide to narrow; noise widens them."""

_LEAST_SIZE, _LARGEST_SIZE = 0.1, 2.0
"""Limits of a field's prior, in usual priors: from hardly any bend to twice the usual one."""

_LEAST_VIEW_SAMPLES = 100
"""A view needs at least this many samples for a tilt of its own."""

_NOTHING = 1e-6
"""The prior sigma of unknowns that are not fitted."""


@dataclass(frozen=True)
class Common:
    """The unknowns that all views share, or their standard deviations.

    roll, pitch: radians, from the recorded camera to the corrected one
    lean_x, lean_y: radians about the axes of the map, tilt of the map: a tracked map leans, the map
        of a robot on wheels does not
    height: metres that the camera is higher than recorded
    offset: metres added to a depth at the rounding's reference distance, for the error of rounding
    top: metres, the mean height of the top
    slope_x, slope_y: slope of the top in the map
    sag: metres that the top's middle lies above its rim; negative where it sags
    """

    roll: float = 0.0
    pitch: float = 0.0
    lean_x: float = 0.0
    lean_y: float = 0.0
    height: float = 0.0
    offset: float = 0.0
    top: float = 0.0
    slope_x: float = 0.0
    slope_y: float = 0.0
    sag: float = 0.0


NAMES = tuple(each.name for each in fields(Common))
PLACE = {name: place for place, name in enumerate(NAMES)}
FIELD = slice(len(NAMES), len(NAMES) + 2 * len(TERMS))
COUNT = FIELD.stop


@dataclass(frozen=True)
class Beliefs:
    """Prior standard deviations, before floor and top are seen.

    common: see `Common`; its ``top`` is about the height at which the top was first seen
    scale: of the constant term of the depth field, a share
    view_tilt: of one view's tilt against the common one, radians: encoders, a base that leans
    view_lift: of one view's height, metres
    lean_share: share of one view's roll, and of its pitch, that is a lean of the base
    rounding: how the depth was rounded to coarse steps
    """

    common: Common
    scale: float
    view_tilt: float
    view_lift: float
    lean_share: tuple[float, float]
    rounding: Rounding = FINE


@dataclass(frozen=True, eq=False)
class Adjustment:
    """The camera's corrections, from the level surfaces.

    values: (COUNT,), the common unknowns and the field's coefficients
    covariance: (COUNT, COUNT), of the values, priors included
    own: (views, 3), roll, pitch and lift of each view, added to the common ones
    own_sigma: (views, 3), their standard deviations
    size: strength of the depth field, relative to the usual one
    """

    values: Floats
    covariance: Floats
    own: Floats
    own_sigma: Floats
    size: float

    @property
    def common(self) -> Common:
        """The common unknowns by name."""
        return Common(*(float(value) for value in self.values[: len(NAMES)]))

    def sigma(self, name: str) -> float:
        """Return the standard deviation of a common unknown."""
        return float(np.sqrt(self.covariance[PLACE[name], PLACE[name]]))

    @property
    def field(self) -> DepthField:
        """The factor on the depth, over the image and the distance."""
        return DepthField(self.values[FIELD])

    @property
    def scale(self) -> float:
        """The factor on depths in the middle of the image, at `REFERENCE_M`."""
        return self.field.at(0.0, 0.0, REFERENCE_M) + self.common.offset / REFERENCE_M


def unadjusted(beliefs: Beliefs, views: int) -> Adjustment:
    """Return the adjustment without any sample: zero, with the priors' covariance."""
    _, sigma = _prior(beliefs, 1.0, 0.0)
    own_sigma = np.tile([beliefs.view_tilt, beliefs.view_tilt, beliefs.view_lift], (views, 1))
    return Adjustment(np.zeros(COUNT), np.diag(sigma**2), np.zeros((views, 3)), own_sigma, 1.0)


def adjust(
    samples: LevelSamples, beliefs: Beliefs, *, gates: tuple[float, ...] = WIDE_GATES_M
) -> Adjustment:
    """Fit camera, depth field and top to the samples of all views.

    The strength of the depth field is learnt (empirical Bayes): a first fit with the usual prior
    gives it, and the second fit has a prior of that size. The differences of the views in tilt and
    height are learnt in the same way.
    """
    size = 1.0
    tilt, lift = beliefs.view_tilt, beliefs.view_lift
    able = np.bincount(samples.view, minlength=samples.views) >= _LEAST_VIEW_SAMPLES
    values, own = np.zeros(COUNT), np.zeros((samples.views, 3))
    values[PLACE["top"]] = samples.top_start
    first = _solve(samples, beliefs, size, (tilt, lift), able, values, own, gates)
    size = float(np.clip(bending_size(first.values[FIELD]), _LEAST_SIZE, _LARGEST_SIZE))
    if able.sum() >= 3:
        tilt = max(tilt, _rms(first.own[able, :2]))
        lift = max(lift, _rms(first.own[able, 2]))
    again = gates[len(gates) // 2 :]
    second = _solve(samples, beliefs, size, (tilt, lift), able, first.values, first.own, again)
    return replace(second, size=size)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _prior(beliefs: Beliefs, size: float, top: float) -> tuple[Floats, Floats]:
    """Return the means and standard deviations of the common unknowns."""
    mean, sigma = np.zeros(COUNT), np.zeros(COUNT)
    mean[PLACE["top"]] = top
    sigma[: len(NAMES)] = [max(getattr(beliefs.common, name), _NOTHING) for name in NAMES]
    sigma[FIELD] = prior_sigmas(size)
    sigma[FIELD.start] = beliefs.scale
    return mean, sigma


def residuals(samples: LevelSamples, values: Floats, own: Floats) -> Floats:
    """Return the (n,) heights of the samples above the surface that they lie on, metres."""
    common = Common(*values[: len(NAMES)])
    tilts = view_tilts(samples.headings, common, own)
    # Of the few views, not of each sample: sines are dear.
    (sin_roll, sin_pitch), (cos_roll, cos_pitch) = (
        wave(tilts.T)[:, samples.view] for wave in (np.sin, np.cos)
    )
    x, y, z = samples.arms.T
    bend, growth = np.split(values[FIELD], 2)
    factor = 1 + bend @ samples.terms + (growth @ samples.terms) * samples.beyond
    # Third row of R_x(roll) then R_y(pitch), as `correction` composes them (extrinsic).
    turned = -sin_pitch * x + cos_pitch * (sin_roll * y + cos_roll * z)
    heights = samples.camera_z + common.height + own[samples.view, 2]
    heights = heights + factor * turned + common.offset * samples.rounded
    slope = np.array([common.slope_x, common.slope_y])
    target = common.top + samples.place @ slope + common.sag * samples.bulge
    result: Floats = heights - np.where(samples.is_top, target, 0.0)
    return result


def view_tilts(headings: Floats, common: Common, own: Floats) -> Floats:
    """Return roll and pitch (views, 2) of every view, radians.

    headings: (views,), the axes of roll and pitch in the map, radians
    """
    c, s = np.cos(headings), np.sin(headings)
    return np.column_stack(
        [
            common.roll + own[:, 0] + c * common.lean_x + s * common.lean_y,
            common.pitch + own[:, 1] - s * common.lean_x + c * common.lean_y,
        ]
    )


def _rows(samples: LevelSamples, values: Floats) -> Floats:
    """Return the derivatives (COUNT, n) of the residuals by the common unknowns.

    They are computed at the intersection of ray and surface, not at the noisy depth: a regressor
    that shares its noise with the residual would make the scale too small.
    """
    fall = np.where(samples.is_top, values[PLACE["top"]], 0.0) - samples.camera_z
    reach = fall / samples.arms[:, 2]
    rows = np.empty((COUNT, len(reach)))
    rows[PLACE["roll"]] = samples.arms[:, 1] * reach
    rows[PLACE["pitch"]] = -samples.arms[:, 0] * reach
    c, s = np.cos(samples.headings)[samples.view], np.sin(samples.headings)[samples.view]
    rows[PLACE["lean_x"]] = c * rows[PLACE["roll"]] - s * rows[PLACE["pitch"]]
    rows[PLACE["lean_y"]] = s * rows[PLACE["roll"]] + c * rows[PLACE["pitch"]]
    rows[PLACE["height"]] = 1.0
    rows[PLACE["offset"]] = samples.rounded_at(reach)
    rows[PLACE["top"]] = -1.0 * samples.is_top
    rows[PLACE["slope_x"]] = -samples.place[:, 0]
    rows[PLACE["slope_y"]] = -samples.place[:, 1]
    rows[PLACE["sag"]] = -samples.bulge
    bend, growth = np.split(rows[FIELD], 2)
    np.multiply(samples.terms, fall, out=bend)
    np.multiply(bend, samples.beyond_at(reach), out=growth)
    return rows


_OWN = [PLACE["roll"], PLACE["pitch"], PLACE["height"]]


def _solve(
    samples: LevelSamples,
    beliefs: Beliefs,
    size: float,
    view_sigma: tuple[float, float],
    able: Bools,
    values: Floats,
    own: Floats,
    gates: tuple[float, ...],
) -> Adjustment:
    mean, sigma = _prior(beliefs, size, samples.top_start)
    own_prior = np.array([view_sigma[0], view_sigma[0], view_sigma[1]])
    views = samples.views
    total = COUNT + 3 * views
    information = np.eye(total)
    sees_top, parts = bool(samples.is_top.any()), samples.parts
    for number, gate in enumerate(gates):
        residual = residuals(samples, values, own)
        width = np.maximum(gate, 3 * samples.sigma)
        weight = geman_mcclure((residual / width) ** 2, samples.weight)
        # The floor is known: only the rows of the top change from one step to the next.
        if number == 0 or sees_top:
            rows = _rows(samples, values)
        information = np.zeros((total, total))
        right = np.zeros(total)
        information[:COUNT, :COUNT] = np.diag(sigma**-2.0)
        right[:COUNT] = -(values - mean) / sigma**2
        for view, part in enumerate(parts):
            at = slice(COUNT + 3 * view, COUNT + 3 * view + 3)
            # The rows of one view stay in the processor's cache.
            mine = rows[:, part]
            heavy = mine * weight[part]
            told, pull = heavy @ mine.T, -heavy @ residual[part]
            information[:COUNT, :COUNT] += told
            right[:COUNT] += pull
            information[at, at] = np.diag(own_prior**-2.0)
            if not able[view]:
                continue
            # A view's own unknowns move its samples as the common ones do.
            information[at, at] += told[np.ix_(_OWN, _OWN)]
            information[:COUNT, at], information[at, :COUNT] = told[:, _OWN], told[_OWN]
            right[at] = pull[_OWN] - own[view] / own_prior**2
        step = np.asarray(np.linalg.solve(information, right), dtype=np.float64)
        values = values + step[:COUNT]
        own = own + step[COUNT:].reshape(views, 3)
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    own_sigma = np.sqrt(np.diag(covariance)[COUNT:]).reshape(views, 3)
    return Adjustment(values, covariance[:COUNT, :COUNT], own, own_sigma, size)
