"""Casting rays at made-up worlds: upright solids on a floor, walls, and what a laser cuts of them.

Metres, z up. A ray may be of any length, and a distance counts in lengths of its ray: along rays
that reach one metre ahead of a camera it is the depth. Where nothing is met it is infinite.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats, Pose2


@dataclass(frozen=True)
class Box:
    """An upright box from ``low`` to ``high``: centre, sizes along its own axes, yaw."""

    x: float
    y: float
    length: float
    width: float
    low: float = 0.0
    high: float = np.inf
    yaw: float = 0.0

    def sides(self) -> Floats:
        """Return the (4, 4) sides from above, x1, y1, x2, y2, counter-clockwise."""
        half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [self.length / 2, self.width / 2]
        corners = Pose2(self.x, self.y, self.yaw).apply(half)
        return np.hstack([corners, np.roll(corners, -1, axis=0)])

    def outside(self, points: Floats) -> Floats:
        """Return how far (n, 2) points lie outside of the sides (negative: inside)."""
        local = Pose2(self.x, self.y, self.yaw).inverse().apply(points)
        beyond = np.abs(local) - np.array([self.length, self.width]) / 2
        far = np.linalg.norm(np.maximum(beyond, 0), axis=1)
        return far + np.minimum(beyond.max(axis=1), 0)

    def entered(self, origin: Floats, x: Floats, y: Floats, z: Floats) -> Floats:
        """Return where rays, given by their parts along x, y and z, enter the box."""
        box_from_map = Pose2(self.x, self.y, self.yaw).inverse()
        (a, b), (c, d) = box_from_map.rotation
        u, v = box_from_map.apply(origin[:2])
        first = last = None
        for along, at, low, high in (
            (a * x + b * y, u, -self.length / 2, self.length / 2),
            (c * x + d * y, v, -self.width / 2, self.width / 2),
            (z, origin[2], self.low, self.high),
        ):
            one, other = (low - at) / along, (high - at) / along
            enter, leave = np.minimum(one, other), np.maximum(one, other)
            first = enter if first is None else np.maximum(first, enter)
            last = leave if last is None else np.minimum(last, leave)
        return np.where((first < last) & (first > 0), first, np.inf)


@dataclass(frozen=True)
class Drum:
    """An upright cylinder from ``low`` to ``high``."""

    x: float
    y: float
    diameter: float
    low: float = 0.0
    high: float = np.inf

    def outside(self, points: Floats) -> Floats:
        """Return how far (n, 2) points lie outside of the wall (negative: inside)."""
        return np.linalg.norm(points - [self.x, self.y], axis=1) - self.diameter / 2

    def entered(self, origin: Floats, x: Floats, y: Floats, z: Floats) -> Floats:
        """Return where rays, given by their parts along x, y and z, enter the cylinder."""
        u, v = origin[0] - self.x, origin[1] - self.y
        a, b = x * x + y * y, u * x + v * y
        root = np.sqrt(b * b - a * (u * u + v * v - self.diameter**2 / 4))  # NaN beside it
        one, other = (self.low - origin[2]) / z, (self.high - origin[2]) / z
        first = np.maximum((-b - root) / a, np.minimum(one, other))
        last = np.minimum((-b + root) / a, np.maximum(one, other))
        return np.where((first < last) & (first > 0), first, np.inf)


@dataclass(frozen=True)
class World:
    """Solids on a floor at z = 0 (or on none), and endless upright walls (n, 4): x1, y1, x2, y2."""

    solids: Sequence[Box | Drum] = ()
    walls: Floats = field(default_factory=lambda: np.zeros((0, 4)))
    has_floor: bool = True

    def cast(self, origin: Floats, rays: Floats) -> tuple[Floats, NDArray[np.intp]]:
        """Return how far along rays (..., 3) from one origin (3,) something is met, and what.

        0 is the floor, or nothing; the solids follow in their order, and the walls come last.
        """
        x, y, z = (np.ascontiguousarray(rays[..., k]) for k in range(3))
        with np.errstate(divide="ignore", invalid="ignore"):
            floor = -origin[2] / z if self.has_floor else np.full(x.shape, np.inf)
            nearest = np.where(floor > 0, floor, np.inf)
            what = np.zeros(x.shape, dtype=np.intp)
            hits = [solid.entered(origin, x, y, z) for solid in self.solids]
            if len(self.walls):
                level = np.stack([x.ravel(), y.ravel()], axis=1)
                hits.append(cast_level(self.walls, origin[:2], level).reshape(x.shape))
        for number, hit in enumerate(hits, start=1):
            what[hit < nearest] = number
            nearest = np.minimum(nearest, hit)
        return nearest, what

    def depth(self, map_from_camera: Floats, rays: Floats) -> Floats:
        """Return the depth along a camera's rays (..., 3), one metre ahead each; see `cast`."""
        return self.cast(map_from_camera[:3, 3], rays @ map_from_camera[:3, :3].T)[0]

    def cast_at(self, height: float, origins: Floats, rays: Floats) -> Floats:
        """Return how far along level rays (n, 2) at a height something is met; see `cast_level`."""
        cut = [solid for solid in self.solids if solid.low < height < solid.high]
        sides = [solid.sides() for solid in cut if isinstance(solid, Box)]
        circles = [(s.x, s.y, s.diameter / 2) for s in cut if isinstance(s, Drum)]
        return cast_level(np.concatenate([self.walls, *sides]), origins, rays, circles=circles)


def cast_level(
    walls: Floats,
    origins: Floats,
    rays: Floats,
    *,
    circles: Sequence[tuple[float, float, float]] = (),
) -> Floats:
    """Return (n,) how far along rays (n, 2) in the plane something is met.

    ``walls`` (m, 4) are segments x1, y1, x2, y2, ``circles`` x, y, radius. ``origins`` is (2,), or
    (n, 2) where each ray has its own.
    """
    origins = np.broadcast_to(origins, rays.shape)
    nearest = np.full(len(rays), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        if len(walls):
            x, y = (rays[:, None, k] for k in (0, 1))
            u, v = (walls[None, :, k] - origins[:, None, k] for k in (0, 1))
            along, up = walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1]
            cross = x * up - y * along
            reach, share = (u * up - v * along) / cross, (u * y - v * x) / cross
            hit = (reach > 0) & (share >= 0) & (share <= 1)
            nearest = np.where(hit, reach, np.inf).min(axis=1)
        for x, y, radius in circles:
            u, v = origins[:, 0] - x, origins[:, 1] - y
            a, b = np.sum(rays**2, axis=1), u * rays[:, 0] + v * rays[:, 1]
            reach = (-b - np.sqrt(b * b - a * (u * u + v * v - radius**2))) / a  # NaN beside it
            nearest = np.where(reach > 0, np.minimum(nearest, reach), nearest)
    return nearest


def looking(height: float, down: float, *, ahead: float = 0.0, left: float = 0.0) -> Floats:
    """Return base_from_camera (4, 4): an optical frame that looks down, and left (radians)."""
    forward = np.array([np.cos(down) * np.cos(left), np.cos(down) * np.sin(left), -np.sin(down)])
    right = np.array([np.sin(left), -np.cos(left), 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    pose[:3, 3] = (ahead, 0.0, height)
    return pose
