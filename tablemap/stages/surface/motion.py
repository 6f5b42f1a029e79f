"""How the errors of a camera move an edge point that lies on the top's plane.

An edge point is the intersection of a bearing with a level plane: depth has no part in it. Let the
camera be a drop h above the top, and the point at (a, b) ahead and to the left of the camera. The
point moves by

- scale s (the top is farther by this share): s (a, b)
- pitch p: -p (h + a a / h, a b / h)
- roll r: r (a b / h, h + b b / h)
- yaw y: y (-b, a)
- focal q: the change for a bearing that is (1 + q) times as far from the optical axis
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from tablemap.geometry import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class CameraMotion:
    """The points' motion by a unit of each error, in the base of their view: (N, 2) each."""

    scale: Floats
    roll: Floats
    pitch: Floats
    yaw: Floats
    focal: Floats

    def only(self, chosen: Ints | Bools) -> Self:
        """Return the motion of the chosen points."""
        return type(self)(*(getattr(self, each.name)[chosen] for each in fields(self)))


def camera_motion(lever: Floats, drop: Floats, axis: Floats, turn: Floats) -> CameraMotion:
    """Differentiate the places of points by the errors of their camera.

    lever: (N, 2), from the camera to the point in the base, metres
    drop: (N,), of the camera above the top, metres
    axis: (N, 3), the optical axis in the base
    turn: (N,), radians that the axes of roll and pitch turned with the head
    """
    a, b = lever[:, 0], lever[:, 1]
    pitch = -np.column_stack([drop + a * a / drop, a * b / drop])
    roll = np.column_stack([a * b / drop, drop + b * b / drop])
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    ray = np.column_stack([lever, -drop]) / drop[:, None]
    along = np.einsum("ij,ij->i", ray, axis)[:, None]
    change = ray - along * axis
    focal = drop[:, None] * (change[:, :2] + ray[:, :2] * change[:, 2:])
    return CameraMotion(
        scale=lever,
        roll=c * roll + s * pitch,
        pitch=c * pitch - s * roll,
        yaw=np.column_stack([-b, a]),
        focal=focal,
    )


@dataclass(frozen=True, eq=False)
class Mounting:
    """What the legs say of the camera in the base: the laser has them, and the camera sees them.

    information: (4, 4), inverse covariance of a shift forward and left (metres), a yaw (radians)
        and the stretch of the views' poses (a share); the legs show a shift and a stretch together
    estimate: (4,), information times these
    ahead: metres from the camera to the legs; a focal length that is off by a share q stretches
        their bearings as a shift of q times this would
    widening: pixels that the depth image adds to a leg on each side, and its standard deviation
    """

    information: Floats
    estimate: Floats
    ahead: float
    widening: tuple[float, float] = (0.0, np.inf)
