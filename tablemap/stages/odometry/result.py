"""What the odometry hands on, and what it hands to a reviewer on the way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats, Pose2
from tablemap.stages.odometry.trajectory import Trajectory

MotionSource = Literal["laser", "wheels", "localisation"]
"""What the motion between two stamps rests on."""

# How the error of each source grows with the way, as standard deviations a metre (x, y, yaw): the
# first two as measured on simulated laps, the last so loose that a localisation's jump fits in.
_ERROR_PER_METRE: dict[MotionSource, tuple[float, float, float]] = {
    "laser": (0.004, 0.004, 0.001),
    "wheels": (0.03, 0.03, 0.015),
    "localisation": (0.08, 0.08, 0.04),
}
# What even a short way costs: interpolation between scans, a stop's own jitter.
_LEAST_ERROR: dict[MotionSource, tuple[float, float, float]] = {
    "laser": (0.004, 0.004, 0.0015),
    "wheels": (0.004, 0.004, 0.004),
    "localisation": (0.03, 0.03, 0.02),
}
_SHORTEST_WAY = 0.1  # metres


@dataclass(frozen=True, eq=False)
class OdometryScan:
    """Event: one scan as KISS-ICP placed it.

    - ``points``: (n, 2) metres, in the odometry's frame
    - ``threshold``: metres, the scale of the kernel that it was registered with
    - ``correction``: metres from where the prior had it to where it ended, in the directions that
      it holds; measured before a correction that is too large is refused
    """

    stamp_ns: int
    odom_from_base: Pose2
    points: Floats
    threshold: float
    correction: float


@dataclass(frozen=True, eq=False)
class OdometryMap:
    """Event: what KISS-ICP registers scans to. ``points`` (n, 2) in the odometry's frame."""

    stamp_ns: int
    points: Floats


@dataclass(frozen=True, eq=False)
class Odometry:
    """Motion of the base in a frame of its own (its first pose is the localised one).

    - ``trajectory``: the base over time
    - ``localised``, ``wheels``: the recorded trajectories at the same stamps; ``wheels`` is None
      where none were recorded
    - ``source``: what the motion rests on
    - ``scans_used``, ``scans_skipped``: how many scans were registered, and how many were not
    - ``gaps``: (g, 2) stamps between which no scan could be placed and the wheels bridge the laser
    - ``open_way``: (n, 2, 2) metres of way up to each stamp, by direction in the trajectory's
      frame, that the scans left open (along a corridor) to the motion recorded beside them
    """

    trajectory: Trajectory
    localised: Trajectory
    wheels: Trajectory | None
    source: MotionSource
    scans_used: int
    scans_skipped: int
    gaps: NDArray[np.int64]
    open_way: Floats
    warnings: tuple[ProcessWarning, ...]

    def covariance_between(self, first_ns: int, second_ns: int) -> Floats:
        """Return the (3, 3) covariance of the motion between two stamps, longer ways looser.

        In the base's frame at the first.
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
        """Return the (3, 3) covariance of the motion over metres of way, and bridged ones."""
        variances = np.square(_ERROR_PER_METRE[self.source]) * way
        variances += np.square(_ERROR_PER_METRE["wheels"]) * bridged
        least = "wheels" if bridged and self.source == "laser" else self.source
        return np.diag(variances + np.square(_LEAST_ERROR[least]))
