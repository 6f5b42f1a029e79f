"""Parametric outlines: signed distance with derivatives, conventions, and the outline itself.

Every shape keeps its parameters as one vector in a frame of the map's axes. ``measure`` gives each
point its signed distance (outside positive) to the part of the boundary whose normal fits.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from tablemap.geometry import Floats
from tablemap.surface.evidence import Ints

CIRCLE_POINTS = 72


@dataclass(frozen=True, eq=False)
class Measure:
    """Points against a boundary.

    ``distance`` (N,) along the boundary's outward ``normal`` (N, 2); ``excess`` (N,) metres past
    the end of the straight side it was assigned to; ``jacobian`` (N, k) of distance by parameters;
    ``side`` (N,) which side, -1 for none.
    """

    distance: Floats
    excess: Floats
    normal: Floats
    jacobian: Floats
    side: Ints


@dataclass(frozen=True, eq=False)
class Shape(ABC):
    """A parametric outline; ``parameters`` (k,) metres and radians."""

    parameters: Floats

    @property
    @abstractmethod
    def name(self) -> str:
        """The shape's name in the model."""

    @abstractmethod
    def measure(self, points: Floats, normals: Floats) -> Measure:
        """Measure (N, 2) points with outward (N, 2) normals against the boundary."""

    @abstractmethod
    def outline(self) -> Floats:
        """Return the (n, 2) outline, counter-clockwise."""

    @abstractmethod
    def pieces(self) -> tuple[Floats, ...]:
        """Return the outline's sides as (n, 2) polylines; piece i is side i of `measure`."""

    @abstractmethod
    def describe(self) -> tuple[Floats, dict[str, float]]:
        """Return the pose (x, y, yaw; centroid, yaw unwrapped) and the dimensions by name."""

    @abstractmethod
    def is_plausible(self) -> bool:
        """Say whether the parameters still mean a shape."""

    @property
    def symmetry(self) -> float:
        """The turn that maps the shape onto itself; the yaw is reduced by it (0: no yaw)."""
        return float(np.pi)

    def at(self, parameters: Floats) -> Self:
        """Return the same kind of shape with other parameters."""
        return replace(self, parameters=parameters)

    def normalised(self) -> Self:
        """Return the same outline with its parameters in the model's convention."""
        return self


def _unit(angle: NDArray[np.floating[Any]]) -> Floats:
    unit: Floats = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return unit


def _perpendicular(vectors: Floats) -> Floats:
    turned: Floats = np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)
    return turned


@dataclass(frozen=True, eq=False)
class Circle(Shape):
    """x, y, radius."""

    @property
    @override
    def name(self) -> str:
        return "circle"

    @property
    @override
    def symmetry(self) -> float:
        return 0.0

    @override
    def measure(self, points: Floats, normals: Floats) -> Measure:
        offset = points - self.parameters[:2]
        reach = np.maximum(np.linalg.norm(offset, axis=1), 1e-9)
        normal = offset / reach[:, None]
        return Measure(
            distance=reach - self.parameters[2],
            excess=np.zeros(len(points)),
            normal=normal,
            jacobian=np.column_stack([-normal, -np.ones(len(points))]),
            side=_arc(offset),
        )

    @override
    def outline(self) -> Floats:
        angle = np.arange(CIRCLE_POINTS) * (2 * np.pi / CIRCLE_POINTS)
        outline: Floats = self.parameters[:2] + self.parameters[2] * _unit(angle)
        return outline

    @override
    def pieces(self) -> tuple[Floats, ...]:
        return _arcs(self.outline())

    @override
    def describe(self) -> tuple[Floats, dict[str, float]]:
        x, y, radius = self.parameters
        return np.array([x, y, 0.0]), {"diameter": float(2 * radius)}

    @override
    def is_plausible(self) -> bool:
        return bool(0.05 < self.parameters[2] < 5.0)


ARCS = 8


def _arc(offset: Floats) -> Ints:
    turn = np.arctan2(offset[:, 1], offset[:, 0]) % (2 * np.pi)
    return np.minimum((turn * (ARCS / (2 * np.pi))).astype(np.int64), ARCS - 1)


def _arcs(outline: Floats) -> tuple[Floats, ...]:
    closed = np.concatenate([outline, outline[:1]])
    each = len(outline) // ARCS
    return tuple(closed[k * each : (k + 1) * each + 1] for k in range(ARCS))


@dataclass(frozen=True, eq=False)
class Ellipse(Shape):
    """x, y and the symmetric matrix (xx, xy, yy) that maps the unit circle onto the ellipse.

    Unlike axes and yaw, the matrix has no singularity where the ellipse becomes a circle.
    """

    @property
    @override
    def name(self) -> str:
        return "ellipse"

    @staticmethod
    def of_axes(x: float, y: float, yaw: float, a: float, b: float) -> Ellipse:
        """Make an ellipse of centre, direction of the first semi-axis and both semi-axes."""
        c, s = np.cos(yaw), np.sin(yaw)
        return Ellipse(
            np.array(
                [x, y, a * c * c + b * s * s, (a - b) * c * s, a * s * s + b * c * c],
                dtype=np.float64,
            )
        )

    def _matrix(self) -> Floats:
        _, _, xx, xy, yy = self.parameters
        return np.array([[xx, xy], [xy, yy]])

    @override
    def measure(self, points: Floats, normals: Floats) -> Measure:
        inverse = np.linalg.inv(self._matrix())
        offset = points - self.parameters[:2]
        on_circle = offset @ inverse
        level = np.maximum(np.linalg.norm(on_circle, axis=1), 1e-9)
        gradient = (on_circle / level[:, None]) @ inverse
        steepness = np.maximum(np.linalg.norm(gradient, axis=1), 1e-9)
        normal = gradient / steepness[:, None]
        unit = on_circle / level[:, None]
        return Measure(
            distance=(level - 1) / steepness,
            excess=np.zeros(len(points)),
            normal=normal,
            jacobian=np.column_stack(
                [
                    -normal,
                    -normal[:, 0] * unit[:, 0],
                    -normal[:, 0] * unit[:, 1] - normal[:, 1] * unit[:, 0],
                    -normal[:, 1] * unit[:, 1],
                ]
            ),
            side=_arc(unit),
        )

    @override
    def outline(self) -> Floats:
        angle = np.arange(CIRCLE_POINTS) * (2 * np.pi / CIRCLE_POINTS)
        return self.parameters[:2] + _unit(angle) @ self._matrix()

    @override
    def pieces(self) -> tuple[Floats, ...]:
        return _arcs(self.outline())

    @override
    def describe(self) -> tuple[Floats, dict[str, float]]:
        values, vectors = np.linalg.eigh(self._matrix())
        yaw = float(np.arctan2(vectors[1, 1], vectors[0, 1]))
        x, y = self.parameters[:2]
        return np.array([x, y, yaw]), {
            "major": float(2 * values[1]),
            "minor": float(2 * values[0]),
        }

    @override
    def is_plausible(self) -> bool:
        if not np.isfinite(self.parameters).all():
            return False
        values = np.linalg.eigvalsh(self._matrix())
        return bool(values[0] > 0.05 and values[1] < 5.0)


@dataclass(frozen=True, eq=False)
class Sided(Shape):
    """A polygon of straight sides: each a line ``n(angle) . p = offset`` with outward normal n."""

    @abstractmethod
    def lines(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Return angles (S,), offsets (S,) and their derivatives by the parameters (S, k) each.

        Sides are in counter-clockwise order; neighbours meet in the corners.
        """

    def corners(self) -> Floats:
        """Return (S, 2): corner i is where side i begins (after side i-1)."""
        angle, offset, _, _ = self.lines()
        before_angle, before_offset = np.roll(angle, 1), np.roll(offset, 1)
        cross = np.sin(angle - before_angle)
        cross = np.where(np.abs(cross) < 1e-6, 1e-6, cross)
        x = (before_offset * np.sin(angle) - offset * np.sin(before_angle)) / cross
        y = (offset * np.cos(before_angle) - before_offset * np.cos(angle)) / cross
        return np.stack([x, y], axis=1)

    @override
    def measure(self, points: Floats, normals: Floats) -> Measure:
        angle, offset, _, _ = self.lines()
        start = self.corners()
        end = np.roll(start, -1, axis=0)
        outward = _unit(angle)
        tangent = _perpendicular(outward)
        distance = points @ outward.T - offset
        along = points @ tangent.T
        first = np.sum(start * tangent, axis=1)
        last = np.sum(end * tangent, axis=1)
        excess = np.maximum(np.maximum(first - along, along - last), 0.0)
        mismatch = normals @ outward.T < 0.5
        reach = np.hypot(distance, excess) + 1e3 * mismatch
        side = np.argmin(reach, axis=1)
        picked = np.arange(len(points)), side
        result = self.against(points, side)
        return replace(
            result,
            excess=excess[picked],
            side=np.where(mismatch[picked], -1, side),
        )

    def against(self, points: Floats, side: Ints) -> Measure:
        """Measure (N, 2) points against the whole line of the side given for each (N,)."""
        angle, offset, by_angle, by_offset = self.lines()
        outward = _unit(angle)[side]
        lever = np.sum(points * _perpendicular(outward), axis=1)
        return Measure(
            distance=np.sum(points * outward, axis=1) - offset[side],
            excess=np.zeros(len(points)),
            normal=outward,
            jacobian=lever[:, None] * by_angle[side] - by_offset[side],
            side=side,
        )

    @override
    def outline(self) -> Floats:
        return self.corners()

    @override
    def pieces(self) -> tuple[Floats, ...]:
        corners = self.corners()
        return tuple(np.stack(ends) for ends in zip(corners, np.roll(corners, -1, 0), strict=True))

    @override
    def is_plausible(self) -> bool:
        corners = self.corners()
        if not np.isfinite(corners).all() or np.abs(corners).max() > 10.0:
            return False
        angle, _, _, _ = self.lines()
        along = np.roll(corners, -1, axis=0) - corners
        forward = np.sum(along * _perpendicular(_unit(angle)), axis=1)
        return bool((forward > 0.02).all()) and area(corners) > 0.01


@dataclass(frozen=True, eq=False)
class Rectangle(Sided):
    """x, y, yaw, length, width."""

    @property
    @override
    def name(self) -> str:
        return "rectangle"

    @override
    def lines(self) -> tuple[Floats, Floats, Floats, Floats]:
        x, y, yaw, length, width = self.parameters
        angle = yaw + np.arange(4) * (np.pi / 2)
        outward = _unit(angle)
        tangent = _perpendicular(outward)
        centre = np.array([x, y])
        half = np.array([length, width, length, width]) / 2
        by_angle = np.zeros((4, 5))
        by_angle[:, 2] = 1.0
        by_offset = np.zeros((4, 5))
        by_offset[:, :2] = outward
        by_offset[:, 2] = tangent @ centre
        by_offset[[0, 2], 3] = 0.5
        by_offset[[1, 3], 4] = 0.5
        return angle, outward @ centre + half, by_angle, by_offset

    @override
    def describe(self) -> tuple[Floats, dict[str, float]]:
        _, _, _, length, width = self.parameters
        return self.parameters[:3].copy(), {"length": float(length), "width": float(width)}

    @override
    def normalised(self) -> Self:
        x, y, yaw, length, width = self.parameters
        if length >= width:
            return self
        return self.at(np.array([x, y, yaw + np.pi / 2, width, length]))


@dataclass(frozen=True, eq=False)
class Square(Sided):
    """x, y, yaw, side."""

    @property
    @override
    def name(self) -> str:
        return "square"

    @property
    @override
    def symmetry(self) -> float:
        return float(np.pi / 2)

    @override
    def lines(self) -> tuple[Floats, Floats, Floats, Floats]:
        x, y, yaw, side = self.parameters
        angle, offset, by_angle, by_offset = Rectangle(np.array([x, y, yaw, side, side])).lines()
        merge = np.zeros((5, 4))
        merge[[0, 1, 2, 3, 4], [0, 1, 2, 3, 3]] = 1.0
        return angle, offset, by_angle @ merge, by_offset @ merge

    @override
    def describe(self) -> tuple[Floats, dict[str, float]]:
        return self.parameters[:3].copy(), {"side": float(self.parameters[3])}


@dataclass(frozen=True, eq=False)
class Parallelogram(Sided):
    """x, y, yaw (of the length), length, width, angle from length to width."""

    @property
    @override
    def name(self) -> str:
        return "parallelogram"

    @override
    def lines(self) -> tuple[Floats, Floats, Floats, Floats]:
        x, y, yaw, length, width, corner = self.parameters
        angle = yaw + np.array([corner - np.pi / 2, np.pi / 2, corner + np.pi / 2, 1.5 * np.pi])
        outward = _unit(angle)
        lever = _perpendicular(outward) @ np.array([x, y])
        size = np.array([length, width, length, width])
        offset = outward @ np.array([x, y]) + size * np.sin(corner) / 2
        leans = np.array([1.0, 0.0, 1.0, 0.0])
        by_angle = np.zeros((4, 6))
        by_angle[:, 2] = 1.0
        by_angle[:, 5] = leans
        by_offset = np.zeros((4, 6))
        by_offset[:, :2] = outward
        by_offset[:, 2] = lever
        by_offset[[0, 2], 3] = np.sin(corner) / 2
        by_offset[[1, 3], 4] = np.sin(corner) / 2
        by_offset[:, 5] = leans * lever + size * np.cos(corner) / 2
        return angle, offset, by_angle, by_offset

    @override
    def describe(self) -> tuple[Floats, dict[str, float]]:
        _, _, _, length, width, corner = self.parameters
        return self.parameters[:3].copy(), {
            "length": float(length),
            "width": float(width),
            "angle": float(corner),
        }

    @override
    def is_plausible(self) -> bool:
        return bool(0.35 < self.parameters[5] < np.pi - 0.35) and super().is_plausible()

    @override
    def normalised(self) -> Self:
        x, y, yaw, length, width, corner = self.parameters
        if length >= width:
            return self
        # The old width's direction becomes x; from there to the old length reversed is pi - angle.
        return self.at(np.array([x, y, yaw + corner, width, length, np.pi - corner]))


@dataclass(frozen=True, eq=False)
class RoundedRectangle(Shape):
    """x, y, yaw, length, width, corner radius."""

    @property
    @override
    def name(self) -> str:
        return "rectangle"

    def _sharp(self) -> Rectangle:
        return Rectangle(self.parameters[:5])

    @override
    def measure(self, points: Floats, normals: Floats) -> Measure:
        x, y, yaw, length, width, radius = self.parameters
        axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
        local = (points - np.array([x, y])) @ axes.T
        facing = normals @ axes.T
        sign = np.where(local >= 0, 1.0, -1.0)
        past = np.abs(local) - (np.array([length, width]) / 2 - radius)
        in_corner = (past > 0).all(axis=1)
        reach = np.maximum(np.linalg.norm(past, axis=1), 1e-9)
        along_x = np.abs(facing[:, 0]) > np.abs(facing[:, 1])
        # On a straight side the data's own normal says which of two opposite sides it is.
        straight = np.where(
            np.column_stack([along_x, ~along_x]), np.where(facing >= 0, 1.0, -1.0), 0.0
        )
        outward = np.where(in_corner[:, None], sign * past / reach[:, None], straight)
        flat = np.sum(local * straight, axis=1) - np.where(along_x, length, width) / 2
        distance = np.where(in_corner, reach - radius, flat)
        corner_normal = np.abs(outward)
        jacobian = np.zeros((len(points), 6))
        normal = outward @ axes
        jacobian[:, :2] = -normal
        jacobian[:, 2] = outward[:, 0] * local[:, 1] - outward[:, 1] * local[:, 0]
        jacobian[:, 3] = -corner_normal[:, 0] / 2
        jacobian[:, 4] = -corner_normal[:, 1] / 2
        jacobian[:, 5] = np.where(in_corner, corner_normal.sum(axis=1) - 1, 0.0)
        quarter = np.where(
            along_x, np.where(facing[:, 0] >= 0, 0, 4), np.where(facing[:, 1] >= 0, 2, 6)
        )
        bend = np.where(
            local[:, 1] >= 0, np.where(local[:, 0] >= 0, 1, 3), np.where(local[:, 0] >= 0, 7, 5)
        )
        return Measure(
            distance=distance,
            excess=np.zeros(len(points)),
            normal=normal,
            jacobian=jacobian,
            side=np.where(in_corner, bend, quarter).astype(np.int64),
        )

    @override
    def outline(self) -> Floats:
        x, y, yaw, length, width, radius = self.parameters
        turn = np.linspace(0, np.pi / 2, 9)
        arcs = []
        for quarter, (sx, sy) in enumerate([(1, 1), (-1, 1), (-1, -1), (1, -1)]):
            centre = np.array([sx * (length / 2 - radius), sy * (width / 2 - radius)])
            arcs.append(centre + radius * _unit(turn + quarter * np.pi / 2))
        local = np.concatenate(arcs)
        axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
        outline: Floats = local @ axes + np.array([x, y])
        return outline

    @override
    def pieces(self) -> tuple[Floats, ...]:
        bends = self.outline().reshape(4, -1, 2)
        pieces = []
        for before, bend in zip(np.roll(bends, 1, axis=0), bends, strict=True):
            pieces += [np.stack([before[-1], bend[0]]), bend]
        return tuple(pieces)

    @override
    def describe(self) -> tuple[Floats, dict[str, float]]:
        pose, dimensions = self._sharp().describe()
        return pose, dimensions | {"corner_radius": float(self.parameters[5])}

    @override
    def is_plausible(self) -> bool:
        _, _, _, length, width, radius = self.parameters
        return bool(0.0 < radius <= min(length, width) / 2) and self._sharp().is_plausible()

    @override
    def normalised(self) -> Self:
        sharp = self._sharp().normalised().parameters
        return self.at(np.append(sharp, self.parameters[5]))


@dataclass(frozen=True, eq=False)
class Rectilinear(Sided):
    """yaw, then the offsets of the distinct lines; ``quarter`` (S,) turns each side's normal.

    ``line`` (S,) says which offset a side has: sides on one line share theirs.
    """

    quarter: Ints
    line: Ints

    @property
    @override
    def name(self) -> str:
        return "polygon"

    @override
    def lines(self) -> tuple[Floats, Floats, Floats, Floats]:
        angle = self.parameters[0] + self.quarter * (np.pi / 2)
        count = len(self.quarter)
        by_angle = np.zeros((count, len(self.parameters)))
        by_angle[:, 0] = 1.0
        by_offset = np.zeros((count, len(self.parameters)))
        by_offset[np.arange(count), 1 + self.line] = 1.0
        return angle, self.parameters[1 + self.line], by_angle, by_offset

    @override
    def describe(self) -> tuple[Floats, dict[str, float]]:
        return _polygon_pose(self.corners()), {}

    @property
    @override
    def symmetry(self) -> float:
        return float(np.pi)


@dataclass(frozen=True, eq=False)
class Polygon(Sided):
    """The angles of all S sides' normals, then their offsets."""

    @property
    @override
    def name(self) -> str:
        return "polygon"

    @override
    def lines(self) -> tuple[Floats, Floats, Floats, Floats]:
        count = len(self.parameters) // 2
        identity = np.eye(2 * count)
        return (
            self.parameters[:count],
            self.parameters[count:],
            identity[:count],
            identity[count:],
        )

    @override
    def describe(self) -> tuple[Floats, dict[str, float]]:
        return _polygon_pose(self.corners()), {}


def _polygon_pose(corners: Floats) -> Floats:
    along = np.roll(corners, -1, axis=0) - corners
    longest = along[int(np.argmax(np.round(np.linalg.norm(along, axis=1), 2)))]
    x, y = centroid(corners)
    return np.array([x, y, float(np.arctan2(longest[1], longest[0]))])


def area(corners: Floats) -> float:
    """Return the signed area of a (n, 2) polygon, positive counter-clockwise."""
    x, y = corners.T
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)


def centroid(corners: Floats) -> Floats:
    """Return the (2,) area centroid of a (n, 2) polygon."""
    following = np.roll(corners, -1, axis=0)
    cross = corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]
    total = cross.sum()
    if abs(total) < 1e-12:
        middle: Floats = corners.mean(axis=0)
        return middle
    result: Floats = ((corners + following) * cross[:, None]).sum(axis=0) / (3 * total)
    return result


def signed_distance(points: Floats, corners: Floats) -> Floats:
    """Return (N,) distances of (N, 2) points to a (n, 2) polygon, negative inside."""
    if len(points) == 0:
        return np.empty(0)
    nearest = np.full(len(points), np.inf)
    inside: NDArray[np.bool_] = np.zeros(len(points), dtype=bool)
    px, py = points.T
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        ux, uy = bx - ax, by - ay
        length2 = max(ux * ux + uy * uy, 1e-18)
        along = np.clip(((px - ax) * ux + (py - ay) * uy) / length2, 0, 1)
        dx, dy = px - ax - along * ux, py - ay - along * uy
        np.minimum(nearest, dx * dx + dy * dy, out=nearest)
        if ay != by:
            crosses = (ay > py) != (by > py)
            inside ^= crosses & (px < ux * (py - ay) / uy + ax)
    distance: Floats = np.sqrt(nearest) * np.where(inside, -1.0, 1.0)
    return distance
