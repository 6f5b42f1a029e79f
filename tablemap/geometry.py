"""Poses in the plane and in space, and their action on points.

A pose is named ``target_from_source`` and maps points of the source frame into the target frame, so
that neighbouring names match: ``map_from_base @ base_from_camera``. Frames follow REP 103 and 105.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def wrap_angle(angle: float, period: float = 2 * np.pi) -> float:
    """Return the angle in [-pi, pi), or as near to 0 as whole periods bring it."""
    return float((angle + period / 2) % period - period / 2)


def wrap_angles(angles: Floats, period: float = 2 * np.pi) -> Floats:
    """Return the (...) angles in [-pi, pi), or each as near to 0 as whole periods bring it."""
    wrapped: Floats = (angles + period / 2) % period - period / 2
    return wrapped


@dataclass(frozen=True)
class Pose2:
    """A pose in SE(2): metres and radians."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def __matmul__(self, other: Pose2) -> Pose2:
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return Pose2(
            float(self.x + c * other.x - s * other.y),
            float(self.y + s * other.x + c * other.y),
            wrap_angle(self.yaw + other.yaw),
        )

    def inverse(self) -> Pose2:
        """Return the inverse pose."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return Pose2(
            float(-c * self.x - s * self.y), float(s * self.x - c * self.y), wrap_angle(-self.yaw)
        )

    def is_near(self, other: Pose2, *, metres: float, radians: float) -> bool:
        """Tell whether another pose differs by less than ``metres`` and ``radians``."""
        step = self.inverse() @ other
        return bool(np.hypot(step.x, step.y) < metres and abs(step.yaw) < radians)

    @property
    def rotation(self) -> Floats:
        """The (2, 2) rotation matrix."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, -s], [s, c]])

    @property
    def translation(self) -> Floats:
        """The (2,) translation in metres."""
        return np.array([self.x, self.y])

    def apply(self, points: ArrayLike) -> Floats:
        """Map (..., 2) points; of (..., 3) points the height stays as it is."""
        array = np.asarray(points, dtype=np.float64)
        mapped = array[..., :2] @ self.rotation.T + self.translation
        if array.shape[-1] == 2:
            return mapped
        return np.concatenate([mapped, array[..., 2:]], axis=-1)

    def rotate(self, vectors: ArrayLike) -> Floats:
        """Turn (..., 2) vectors without moving them."""
        return np.asarray(vectors, dtype=np.float64) @ self.rotation.T

    def lifted(self) -> Floats:
        """Return the (4, 4) matrix of the same motion in space."""
        matrix = np.eye(4)
        matrix[:2, :2] = self.rotation
        matrix[:2, 3] = self.translation
        return matrix

    def as_array(self) -> Floats:
        """Return (3,): x, y, yaw."""
        return np.array([self.x, self.y, self.yaw])

    @staticmethod
    def from_array(values: ArrayLike) -> Pose2:
        """Make a pose of (3,) x, y, yaw."""
        x, y, yaw = np.asarray(values, dtype=np.float64)
        return Pose2(float(x), float(y), wrap_angle(float(yaw)))

    @staticmethod
    def projected(matrix: Floats) -> Pose2:
        """Project a (4, 4) pose onto the ground plane: its place, and the heading of its x axis."""
        return Pose2(
            float(matrix[0, 3]), float(matrix[1, 3]), float(np.arctan2(matrix[1, 0], matrix[0, 0]))
        )


def planar(matrices: Floats) -> Floats:
    """Project (n, 4, 4) poses onto the ground: (n, 3) x, y and the heading of the x axis."""
    yaw = np.arctan2(matrices[:, 1, 0], matrices[:, 0, 0])
    return np.column_stack([matrices[:, 0, 3], matrices[:, 1, 3], yaw])


def compose(first: Floats, then: Floats) -> Floats:
    """Return (n, 3) poses x, y, yaw: a pose (3,), or poses (n, 3), followed by others (n, 3).

    The yaw is the plain sum of both yaws.
    """
    x, y, yaw = np.moveaxis(np.asarray(first, dtype=np.float64), -1, 0)
    c, s = np.cos(yaw), np.sin(yaw)
    return np.column_stack(
        [
            x + c * then[:, 0] - s * then[:, 1],
            y + s * then[:, 0] + c * then[:, 1],
            yaw + then[:, 2],
        ]
    )


def inverses(poses: Floats) -> Floats:
    """Return (n, 3) the poses x, y, yaw that undo (n, 3) others."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = -c * poses[:, 0] - s * poses[:, 1]
    y = s * poses[:, 0] - c * poses[:, 1]
    return np.column_stack([x, y, -poses[:, 2]])


def transform(target_from_source: Floats, points: ArrayLike) -> Floats:
    """Map (..., 3) points by a (4, 4) pose."""
    array = np.asarray(points, dtype=np.float64)
    return array @ target_from_source[:3, :3].T + target_from_source[:3, 3]


def invert(pose: Floats) -> Floats:
    """Return the inverse of a (4, 4) rigid pose."""
    inverse = np.eye(4)
    inverse[:3, :3] = pose[:3, :3].T
    inverse[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return inverse


def interpolate(first: Floats, second: Floats, fraction: float) -> Floats:
    """Interpolate two (4, 4) poses: the place linearly, the attitude on the great circle."""
    # Imported here: it takes a third of a second, and many commands need no attitude.
    from scipy.spatial.transform import Rotation, Slerp

    between = np.eye(4)
    between[:3, 3] = (1 - fraction) * first[:3, 3] + fraction * second[:3, 3]
    attitudes = Rotation.from_matrix(np.stack([first[:3, :3], second[:3, :3]]))
    between[:3, :3] = Slerp([0.0, 1.0], attitudes)(fraction).as_matrix()
    return between
