"""Base poses over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tablemap.geometry import Floats, Ints, Pose2, compose, wrap_angles

_TURN_WEIGHT = 0.3  # metres of way for a radian of turning


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Base poses over time: ``stamps_ns`` (n,) int64 ascending, ``poses`` (n, 3) x, y, yaw."""

    stamps_ns: Ints
    poses: Floats

    def at(self, stamp_ns: int) -> Pose2:
        """Interpolate; before the first and after the last stamp return the first or last pose."""
        i = int(
            np.clip(np.searchsorted(self.stamps_ns, stamp_ns), 1, max(len(self.stamps_ns) - 1, 1))
        )
        if len(self.stamps_ns) == 1:
            return Pose2.from_array(self.poses[0])
        span = int(self.stamps_ns[i] - self.stamps_ns[i - 1])
        fraction = float(np.clip((stamp_ns - int(self.stamps_ns[i - 1])) / max(span, 1), 0.0, 1.0))
        first, second = Pose2.from_array(self.poses[i - 1]), Pose2.from_array(self.poses[i])
        step = first.inverse() @ second
        place = (1 - fraction) * first.translation + fraction * second.translation
        return Pose2(
            float(place[0]), float(place[1]), (first @ Pose2(0, 0, fraction * step.yaw)).yaw
        )

    def at_all(self, stamps_ns: Ints) -> Floats:
        """Interpolate at (n,) stamps as `at` does; return (n, 3)."""
        if len(self.stamps_ns) == 1:
            return np.repeat(self.poses, len(stamps_ns), axis=0)
        after = np.clip(np.searchsorted(self.stamps_ns, stamps_ns), 1, len(self.stamps_ns) - 1)
        first, second = self.poses[after - 1], self.poses[after]
        span = np.maximum(self.stamps_ns[after] - self.stamps_ns[after - 1], 1)
        fraction = np.clip((stamps_ns - self.stamps_ns[after - 1]) / span, 0.0, 1.0)[:, None]
        poses = (1 - fraction) * first + fraction * second
        turn = fraction[:, 0] * wrap_angles(second[:, 2] - first[:, 2])
        poses[:, 2] = wrap_angles(first[:, 2] + turn)
        return np.asarray(poses, dtype=np.float64)

    @staticmethod
    def of(timed: Sequence[tuple[int, Pose2]]) -> Trajectory:
        """Make a trajectory of stamps and poses in their order."""
        stamps = np.array([stamp for stamp, _ in timed], dtype=np.int64)
        return Trajectory(stamps, np.array([pose.as_array() for _, pose in timed]).reshape(-1, 3))

    def way(self) -> Floats:
        """Return metres (n,) travelled up to each pose; a radian of turning counts as 0.3 m."""
        steps = np.diff(self.poses, axis=0)
        turns = np.abs(wrap_angles(steps[:, 2]))
        lengths = np.hypot(steps[:, 0], steps[:, 1]) + _TURN_WEIGHT * turns
        return np.concatenate([[0.0], np.cumsum(lengths)])

    def way_between(self, first_ns: int, second_ns: int) -> float:
        """Return the metres travelled between two stamps; turning counts as in `way`."""
        at = np.interp([first_ns, second_ns], self.stamps_ns.astype(np.float64), self.way())
        return float(abs(at[1] - at[0]))


def composed(first: Floats, then: Floats) -> Floats:
    """Return (n, 3): the pose (3,), or the poses (n, 3), followed by each of (n, 3)."""
    poses = compose(first, then)
    poses[:, 2] = wrap_angles(poses[:, 2])
    return poses


def undone(pose: Floats) -> Floats:
    """Return the inverse of a pose (3,)."""
    return Pose2.from_array(pose).inverse().as_array()
