"""All stops placed in the map as one body, and the odometry bent to pass through them."""

from __future__ import annotations

from collections.abc import Sequence

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
    mean place) and yaw. The covariance comes from the spread of the localised poses about the fit.
    A wandering localisation errs alike at neighbouring stops: the correlation of the spread from
    stop to stop reduces the number of poses that count. Views that a turning head took from one
    place count once. An error that all poses share, as of a shifted map, is not in the covariance.
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
    information = np.eye(3)
    residual = np.zeros((n, 3))
    weight = np.ones(n)
    for _ in range(20):
        placed = fit.apply(relative[:, :2])
        centre_xy = placed.mean(axis=0)
        residual[:, :2] = localised[:, :2] - placed
        residual[:, 2] = wrap_angles(localised[:, 2] - relative[:, 2] - fit.yaw)
        squared = np.square(residual / [_KERNEL, _KERNEL, _KERNEL_YAW]).sum(axis=1)
        weight = np.square(1.0 / (1.0 + squared))
        rows = np.zeros((n, 3, 3))
        rows[:, 0, 0] = rows[:, 1, 1] = 1.0
        rows[:, 0, 2], rows[:, 1, 2] = -(placed - centre_xy).T[1], (placed - centre_xy).T[0]
        rows[:, 2, 2] = 1.0
        scaled = rows * np.array([1.0, 1.0, _ARM])[:, None]
        information = np.einsum("n,nij,nik->jk", weight, scaled, scaled)
        right = np.einsum("n,nij,ni->j", weight, scaled, residual * [1.0, 1.0, _ARM])
        step = np.linalg.solve(information, right)
        about = Pose2(*centre_xy) @ Pose2(*step) @ Pose2(*centre_xy).inverse()
        fit = about @ fit
        if np.abs(step).max() < 1e-7:
            break
    scaled_residual = residual * [1.0, 1.0, _ARM]
    spread = float((weight[:, None] * scaled_residual**2).sum() / max(3 * weight.sum(), 1e-9))
    if n < 3:
        # Too few poses show no spread: assume the usual error of one localised pose.
        spread = max(spread, (_KERNEL / 2) ** 2)
    covariance = np.linalg.inv(information) * spread * n / _independent(scaled_residual, weight)
    return fit, np.asarray(covariance, dtype=np.float64)


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
