"""All stops placed in the map as one body, and the odometry bent to pass through them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tablemap.geometry import Floats, Pose2, wrap_angle, wrap_angles
from tablemap.robust import geman_mcclure
from tablemap.stages.odometry import Trajectory
from tablemap.stages.snapshots import is_same_place

_KERNEL = 0.10  # metres: a localised pose further off has jumped
_KERNEL_YAW = np.radians(4.0)
_ARM = _KERNEL / _KERNEL_YAW


def place_in_map(relative: Floats, localised: Floats) -> tuple[Pose2, Floats]:
    """Fit ``relative`` (n, 3) to the ``localised`` poses (n, 3) as one rigid body, robustly.

    Returns the motion to apply on the left, and the covariance (3, 3) of the body's x, y (of the
    mean place) and yaw. The covariance comes from the spread of the localised poses about the fit,
    and from how it is correlated from stop to stop: a wandering localisation errs alike at
    neighbouring stops. Few stops show little of both, and what is usual fills in (`_wander`). Views
    that a turning head took from one place count once. An error that all poses share, as of a
    shifted map, is not in the covariance.
    """
    places = _once_a_place(relative)
    relative, localised = relative[places], localised[places]
    n = len(relative)
    fit = Pose2.from_array(localised[0]) @ Pose2.from_array(relative[0]).inverse()
    if n >= 2:
        # Start at the median of the placements by each pose: it stands if half of them jumped.
        yaw = localised[:, 2] - relative[:, 2]
        centre = np.angle(np.exp(1j * yaw).mean())
        turn = centre + np.median(wrap_angles(yaw - centre))
        turned = Pose2(0.0, 0.0, float(turn)).apply(relative[:, :2])
        x, y = np.median(localised[:, :2] - turned, axis=0)
        fit = Pose2.from_array([x, y, turn])
    found = _fitted(fit, relative, localised, _KERNEL)
    # A localisation that errs by more than usual has not jumped at most of its poses.
    usual = float(np.median(np.sum(found.residual**2, axis=1))) / _MEDIAN_OF_THREE
    if 4 * np.sqrt(usual) > _KERNEL:
        found = _fitted(found.fit, relative, localised, 4 * float(np.sqrt(usual)))
    share = found.weight.mean()
    far = np.linalg.norm(found.residual, axis=1) / found.kernel
    scatter = found.residual / np.maximum(far, 1.0)[:, None]  # a pose that jumped counts as one
    covariance = np.linalg.inv(found.information) * share * n * _wander(scatter)
    return found.fit, np.asarray(covariance, dtype=np.float64)


_MEDIAN_OF_THREE = 2.37  # the median of chi squared with three degrees of freedom


@dataclass(frozen=True, eq=False)
class _FittedPlace:
    """A robust fit: ``residual`` (n, 3), all in metres, ``weight`` (n,), ``information`` (3, 3)."""

    fit: Pose2
    residual: Floats
    weight: Floats
    information: Floats
    kernel: float


def _fitted(fit: Pose2, relative: Floats, localised: Floats, kernel: float) -> _FittedPlace:
    n = len(relative)
    information = np.eye(3)
    residual, weight = np.zeros((n, 3)), np.ones(n)
    for _ in range(20):
        placed = fit.apply(relative[:, :2])
        centre = placed.mean(axis=0)
        residual[:, :2] = localised[:, :2] - placed
        residual[:, 2] = _ARM * wrap_angles(localised[:, 2] - relative[:, 2] - fit.yaw)
        weight = np.square(1.0 / (1.0 + np.sum(residual**2, axis=1) / kernel**2))
        rows = np.zeros((n, 3, 3))
        rows[:, 0, 0] = rows[:, 1, 1] = 1.0
        rows[:, 0, 2], rows[:, 1, 2] = -(placed - centre).T[1], (placed - centre).T[0]
        rows[:, 2, 2] = _ARM
        information = np.einsum("n,nij,nik->jk", weight, rows, rows)
        step = np.linalg.solve(information, np.einsum("n,nij,ni->j", weight, rows, residual))
        fit = Pose2(*centre) @ Pose2(*step) @ Pose2(*centre).inverse() @ fit
        if np.abs(step).max() < 1e-7:
            break
    return _FittedPlace(fit, residual, weight, np.asarray(information), kernel)


def _wander(scatter: Floats) -> float:
    """Return the variance of the mean of localised poses that scatter by (n, 3) metres about it.

    The errors are an autoregressive process of first order. Its correlation is unknown: the
    variance is the mean over all of them, each as likely as the scatter makes it (restricted
    likelihood; Harville, "Maximum likelihood approaches to variance component estimation", JASA
    1977). A weak prior of the usual size stands in for what few poses do not show.
    """
    n = len(scatter)
    if n < 2:
        return _USUAL**2
    freedom = 3 * (n - 1) + _PRIOR_FREEDOM
    apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    logs, variances = [], []
    for correlation in _CORRELATIONS:
        shape = correlation**apart
        inverse = np.linalg.inv(shape)
        total = inverse.sum(axis=0)
        free = inverse - np.outer(total, total) / total.sum()
        squares = float(np.sum(scatter * (free @ scatter)))
        squares += _PRIOR_FREEDOM * _USUAL**2
        likelihood = np.linalg.slogdet(shape)[1] + np.log(total.sum())
        logs.append(-1.5 * likelihood - freedom / 2 * np.log(squares))
        variances.append(squares / (freedom - 2) * shape.mean())
    weights = np.exp(np.array(logs) - max(logs))
    return float(weights @ variances / weights.sum())


_CORRELATIONS = (0.0, 0.3, 0.6, 0.8, 0.9, 0.95)
_PRIOR_FREEDOM = 2.0  # as of a pose more
_USUAL = _KERNEL / 2  # metres: the error of one localised pose


def stretched(relative: Floats, localised: Floats, *, sigma: float) -> tuple[Floats, float]:
    """Stretch poses (n, 3) about their middle to fit the scale of the ``localised`` ones (n, 3).

    Poses from depth alone carry the errors of depth scale and focal length: the whole drive comes
    out too small, or too large, by percents. A localisation wanders, but it keeps its scale.
    ``sigma`` is the prior standard deviation of the stretch, a share. Returns the poses and the
    posterior standard deviation of the stretch.
    """
    fit, _ = place_in_map(relative, localised)
    places = _once_a_place(relative)
    arms = relative[places, :2] - relative[places, :2].mean(axis=0)
    asked = fit.inverse().apply(localised[places, :2])
    asked = asked - relative[places, :2].mean(axis=0)
    residual = asked - arms
    weight = geman_mcclure(np.sum(residual**2, axis=1) / _KERNEL**2)
    spread = float(weight @ np.sum(residual**2, axis=1)) / max(2 * float(weight.sum()), 1e-9)
    spread = max(spread, _LEAST_WANDER**2)
    information = float(weight @ np.sum(arms**2, axis=1)) / spread
    scaled = np.column_stack([residual, np.zeros(len(residual))])
    information *= _independent(scaled, weight) / len(residual)
    precision = information + sigma**-2.0
    share = float(weight @ np.sum(arms * residual, axis=1)) / max(
        float(weight @ np.sum(arms**2, axis=1)), 1e-9
    )
    stretch = share * information / precision
    result = relative.copy()
    middle = relative[:, :2].mean(axis=0)
    result[:, :2] = middle + (1.0 + stretch) * (relative[:, :2] - middle)
    return result, float(precision**-0.5)


_LEAST_WANDER = 0.01  # metres: a localisation is no better than this


def bend_trajectory(
    trajectory: Trajectory, stamps_ns: Sequence[int], poses: Sequence[Pose2]
) -> Trajectory:
    """Bring the odometry's poses into the map so that they pass through the stops' poses.

    Between two stops, each stop predicts the pose, and both predictions are blended by the distance
    travelled. Before the first stop and after the last one, the odometry is not bent.
    """
    order = np.argsort(np.asarray(stamps_ns, dtype=np.int64), kind="stable")
    stamps = np.asarray(stamps_ns, dtype=np.int64)[order]
    at_stops = [trajectory.at(int(stamp)) for stamp in stamps]
    registered = [poses[i] for i in order]
    bent = np.empty_like(trajectory.poses)
    way = trajectory.way()
    stop_way = np.interp(stamps.astype(np.float64), trajectory.stamps_ns.astype(np.float64), way)
    after = np.searchsorted(stamps, trajectory.stamps_ns, side="right")
    for k, row in enumerate(trajectory.poses):
        pose = Pose2.from_array(row)
        i = int(np.clip(after[k] - 1, 0, len(stamps) - 1))
        j = int(np.clip(after[k], 0, len(stamps) - 1))
        from_first = registered[i] @ (at_stops[i].inverse() @ pose)
        if i == j:
            bent[k] = from_first.as_array()
            continue
        from_second = registered[j] @ (at_stops[j].inverse() @ pose)
        span = stop_way[j] - stop_way[i]
        share = float(np.clip((way[k] - stop_way[i]) / span, 0.0, 1.0)) if span > 1e-9 else 0.5
        turn = wrap_angle(from_second.yaw - from_first.yaw)
        place = (1 - share) * from_first.translation + share * from_second.translation
        bent[k] = Pose2.from_array([*place, from_first.yaw + share * turn]).as_array()
    return Trajectory(trajectory.stamps_ns, bent)


def _once_a_place(poses: Floats) -> list[int]:
    """Return the first index of each run of poses (n, 3) at one place."""
    chosen = [0]
    for i in range(1, len(poses)):
        if not is_same_place(Pose2.from_array(poses[chosen[-1]]), Pose2.from_array(poses[i])):
            chosen.append(i)
    return chosen


def _independent(residual: Floats, weight: Floats) -> float:
    """Return how many independent poses (n, 3) correlated residuals are worth."""
    n = len(residual)
    if n < 4:
        return 1.0
    weighted = residual * np.sqrt(weight)[:, None]
    power = float((weighted**2).sum())
    lagged = float((weighted[1:] * weighted[:-1]).sum()) * n / (n - 1)
    correlation = float(np.clip(lagged / max(power, 1e-12), 0.0, 0.98))
    return max(n * (1 - correlation) / (1 + correlation), 1.0)
