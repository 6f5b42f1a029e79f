"""Robust fits of the camera's corrections to the floor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats
from tablemap.robust import geman_mcclure
from tablemap.stages.calibration.floor import Floor, residuals

GATES_M = (0.06, 0.04, 0.025, 0.015, 0.010, 0.010, 0.010)
CLOSE_GATES_M = (0.015, 0.012, 0.010, 0.010, 0.010, 0.010)
IMPLAUSIBLE_SIGMAS = 2.0
LEAST_FLOOR_SHARE = 0.15
COMMON = 5  # roll, pitch, scale - 1, height, offset


def fit_axes(floor: Floor, prior: Floats, views: int) -> tuple[Floor, Floats, Floats]:
    """Fit the common correction in the axes of the head or of the base, whichever errs.

    A camera that sits askew on its head errs with the head's turns, a base that leans does not. The
    floor tells: that is returned which it agrees with, in its axes, with `fit_common` of it.
    """
    common, covariance = fit_common(floor, prior, views)
    if floor.turns.any():
        still = floor.in_base_axes()
        other, other_covariance = fit_common(still, prior, views)
        if _disagreement(still, other, views) < _disagreement(floor, common, views):
            return still, other, other_covariance
    return floor, common, covariance


def _disagreement(floor: Floor, common: Floats, views: int) -> float:
    residual = residuals(floor, common, np.zeros((views, 3)))
    return float(np.sum(floor.weight * np.minimum(np.abs(residual), GATES_M[-1]) ** 2))


def fit_common(floor: Floor, prior: Floats, views: int) -> tuple[Floats, Floats]:
    """Return the common correction (5,) and its covariance, from the floor and not from a platform.

    The search begins wide. Where it ends in something implausible though a plane close to z = 0 is
    there too, a platform, a low shelf or a step was the larger surface.
    """
    none = np.zeros((views, 3))

    def supported(common: Floats) -> int:
        return int((np.abs(residuals(floor, common, none)) < GATES_M[-1] + floor.sigma).sum())

    common, _, covariance = fit_floor(floor, prior, None, views)
    if float(np.max(np.abs(common / prior))) > IMPLAUSIBLE_SIGMAS:
        close, _, close_covariance = fit_floor(floor, prior, None, views, CLOSE_GATES_M)
        likelier = np.max(np.abs(close / prior)) < np.max(np.abs(common / prior))
        if likelier and supported(close) >= LEAST_FLOOR_SHARE * supported(common):
            return close, close_covariance
    return common, covariance


def fit_floor(
    floor: Floor,
    prior: Floats,
    by_view: tuple[Floats, NDArray[np.bool_]] | None,
    views: int,
    gates: tuple[float, ...] = GATES_M,
) -> tuple[Floats, Floats, Floats]:
    """Return the common (5,) and the views' (views, 3) corrections, and the common covariance.

    The order is roll, pitch, scale - 1, height, offset. ``by_view`` has the prior (3,) of a view's
    own correction and which views (views,) show enough floor for one.
    """
    common, own = np.zeros(5), np.zeros((views, 3))
    view_prior, able = by_view if by_view is not None else (np.ones(3), np.zeros(views, dtype=bool))
    size = COMMON + (3 * views if able.any() else 0)
    information = np.eye(size)
    for gate in gates:
        residual = residuals(floor, common, own)
        width = np.maximum(gate, 3 * floor.sigma)
        weight = geman_mcclure((residual / width) ** 2, floor.weight)
        # Where the ray meets the floor, not where the noisy depth says: a regressor that shares
        # its noise with the residual draws the scale down.
        reach = -floor.camera_z / floor.arms[:, 2]
        x, y = floor.arms[:, 0] * reach, floor.arms[:, 1] * reach
        rows = np.stack([y, -x, -floor.camera_z, np.ones_like(x), floor.steep], axis=1)
        weighted = rows * weight[:, None]
        information = np.zeros((size, size))
        right = np.zeros(size)
        information[:COMMON, :COMMON] = rows.T @ weighted + np.diag(prior**-2.0)
        right[:COMMON] = -weighted.T @ residual - common / prior**2
        for view in range(views if able.any() else 0):
            a, b = COMMON + 3 * view, COMMON + 3 * view + 3
            information[a:b, a:b] = np.diag(view_prior**-2.0)
            if not able[view]:
                continue
            mine = floor.view == view
            part, wpart = rows[mine][:, [0, 1, 3]], weighted[mine][:, [0, 1, 3]]
            information[a:b, a:b] += part.T @ wpart
            cross = weighted[mine].T @ part
            information[:COMMON, a:b], information[a:b, :COMMON] = cross, cross.T
            right[a:b] = -wpart.T @ residual[mine] - own[view] / view_prior**2
        step = np.asarray(np.linalg.solve(information, right), dtype=np.float64)
        common = common + step[:COMMON]
        if able.any():
            own = own + step[COMMON:].reshape(views, 3)
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return common, own, covariance[:COMMON, :COMMON]


def views_apart(floor: Floor, common: Floats, views: int) -> tuple[NDArray[np.bool_], float]:
    """Return which views show enough floor, and the RMS of their floors' heights in metres."""
    residual = residuals(floor, common, np.zeros((views, 3)))
    able = np.zeros(views, dtype=bool)
    medians = []
    for view in range(views):
        mine = residual[floor.view == view]
        close = mine[np.abs(mine) < GATES_M[0]]
        # Where most of what faces up lies elsewhere, it is not the floor that is seen.
        if len(close) >= 200 and 2 * len(close) >= len(mine):
            able[view] = True
            medians.append(float(np.median(close)))
    scatter = float(np.sqrt(np.mean(np.square(medians)))) if len(medians) >= 2 else 0.0
    return able, scatter
