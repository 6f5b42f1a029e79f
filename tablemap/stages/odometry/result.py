"""The result of the odometry, and its events for the review."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats, Ints, Pose2
from tablemap.stages.odometry.trajectory import Trajectory

MotionSource = Literal["laser", "wheels", "localisation"]
"""The sensor that the motion between two stamps comes from."""

# Growth of each source's error with the way: standard deviations of x, y and yaw after one metre.
# The first two are measured on simulated laps; the last allows for jumps of a localisation.
_ERROR_PER_METRE: dict[MotionSource, tuple[float, float, float]] = {
    "laser": (0.004, 0.004, 0.001),
    "wheels": (0.03, 0.03, 0.015),
    "localisation": (0.08, 0.08, 0.04),
}
# Least error, even of a short way: interpolation between scans, jitter at a stop.
_LEAST_ERROR: dict[MotionSource, tuple[float, float, float]] = {
    "laser": (0.004, 0.004, 0.0015),
    "wheels": (0.004, 0.004, 0.004),
    "localisation": (0.03, 0.03, 0.02),
}
_SHORTEST_WAY = 0.1  # metres


@dataclass(frozen=True, eq=False)
class OdometryScan:
    """Event: KISS-ICP placed one scan.

    - ``points``: (n, 2) metres, in the odometry's frame
    - ``threshold``: metres, the scale of the kernel
    - ``correction``: metres from the prior to the result, in the directions that the scan
      constrains; given even if the correction was too large and was refused
    """

    stamp_ns: int
    odom_from_base: Pose2
    points: Floats
    threshold: float
    correction: float


@dataclass(frozen=True, eq=False)
class OdometryMap:
    """Event: the map of KISS-ICP, ``points`` (n, 2) in the odometry's frame."""

    stamp_ns: int
    points: Floats


@dataclass(frozen=True, eq=False)
class Odometry:
    """Motion of the base in a frame of its own (its first pose is the localised one).

    - ``trajectory``: the base over time
    - ``localised``, ``wheels``: the recorded trajectories at the same stamps; ``wheels`` is None
      where none were recorded
    - ``source``: the sensor that the motion comes from
    - ``scans_used``, ``scans_skipped``: how many scans were registered, and how many were not
    - ``gaps``: (g, 2) stamps of gaps: no scan could be placed there, and the wheels gave the motion
    - ``open_way``: (n, 2, 2) metres of way up to each stamp, by direction in the trajectory's
      frame, that no scan constrained (along a corridor); the recorded motion filled in there
    """

    trajectory: Trajectory
    localised: Trajectory
    wheels: Trajectory | None
    source: MotionSource
    scans_used: int
    scans_skipped: int
    gaps: Ints
    open_way: Floats
    warnings: tuple[ProcessWarning, ...]

    def covariance_between(self, first_ns: int, second_ns: int) -> Floats:
        """Return the covariance (3, 3) of the motion between two stamps; it grows with the way.

        It is in the base's frame at the first stamp.
        """
        way = self.trajectory.way_between(first_ns, second_ns)
        bridged = sum(
            self.trajectory.way_between(*np.clip(gap, first_ns, second_ns)) for gap in self.gaps
        )
        covariance = self.covariance_over(max(way - bridged, _SHORTEST_WAY), bridged)
        at = self.trajectory.stamps_ns.astype(np.float64)
        left = [np.interp([first_ns, second_ns], at, one) for one in self.open_way.reshape(-1, 4).T]
        turn = self.trajectory.at(first_ns).rotation
        left_open = turn.T @ np.diff(left, axis=1).reshape(2, 2) @ turn
        prior: MotionSource = "localisation" if self.wheels is None else "wheels"
        covariance[:2, :2] += _ERROR_PER_METRE[prior][0] ** 2 * left_open
        return covariance

    def covariance_over(self, way: float, bridged: float = 0.0) -> Floats:
        """Return the covariance (3, 3) of the motion over metres of way, and of bridged way."""
        variances = np.square(_ERROR_PER_METRE[self.source]) * way
        variances += np.square(_ERROR_PER_METRE["wheels"]) * bridged
        least = "wheels" if bridged and self.source == "laser" else self.source
        return np.diag(variances + np.square(_LEAST_ERROR[least]))
