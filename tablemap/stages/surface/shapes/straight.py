"""Outlines of straight sides: rectangle, square, parallelogram, polygons."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from typing_extensions import override

from tablemap.geometry import Floats, Ints
from tablemap.model.shapes import PARALLELOGRAM, POLYGON, RECTANGLE, SQUARE
from tablemap.stages.surface.shapes.shape import Measure, Shape, area, centroid, perpendicular, unit
from tablemap.stages.surface.shapes.sides import (
    INFERRED,
    MEASURED,
    UNSEEN,
    Sight,
    inferred_at_least,
    worst,
)


@dataclass(frozen=True, eq=False)
class Sided(Shape):
    """A polygon whose sides are lines ``n(angle) . p = offset`` with outward normal n.

    A point belongs to no side whose normal is farther from its own than ``least_facing`` (cosine).
    """

    least_facing = 0.5

    @cached_property
    @abstractmethod
    def lines(self) -> tuple[Floats, Floats, Floats, Floats]:
        """The angles (S,), offsets (S,) and their derivatives by the parameters (S, k) each.

        Sides are in counter-clockwise order; neighbours meet in the corners.
        """

    @cached_property
    def corners(self) -> Floats:
        """The corners (S, 2); corner i is where side i begins (after side i-1)."""
        angle, offset, _, _ = self.lines
        before_angle, before_offset = np.roll(angle, 1), np.roll(offset, 1)
        cross = np.sin(angle - before_angle)
        cross = np.where(np.abs(cross) < 1e-6, 1e-6, cross)
        x = (before_offset * np.sin(angle) - offset * np.sin(before_angle)) / cross
        y = (offset * np.cos(before_angle) - before_offset * np.cos(angle)) / cross
        return np.stack([x, y], axis=1)

    def ends(self) -> tuple[Floats, Floats]:
        """Return where the straight sides begin and end, (S, 2) each."""
        corners = self.corners
        return corners, np.roll(corners, -1, axis=0)

    @override
    def measure(self, points: Floats, normals: Floats) -> Measure:
        angle, offset, _, _ = self.lines
        start, end = self.ends()
        outward = unit(angle)
        tangent = perpendicular(outward)
        distance = points @ outward.T - offset
        along = points @ tangent.T
        first = np.sum(start * tangent, axis=1)
        last = np.sum(end * tangent, axis=1)
        excess = np.maximum(np.maximum(first - along, along - last), 0.0)
        mismatch = normals @ outward.T < self.least_facing
        reach = np.hypot(distance, excess) + 1e3 * mismatch
        side = np.argmin(reach, axis=1)
        picked = np.arange(len(points)), side
        result = self.on_lines(points, side)
        return replace(
            result,
            excess=excess[picked],
            side=np.where(mismatch[picked], -1, side),
        )

    def against(self, points: Floats, side: Ints) -> Measure:
        """Measure (N, 2) points against the infinite line of each point's straight side (N,)."""
        return self.on_lines(points, side)

    def on_lines(self, points: Floats, side: Ints) -> Measure:
        """Measure (N, 2) points against lines (N,), by their numbers in `lines`."""
        angle, offset, by_angle, by_offset = self.lines
        outward = unit(angle)[side]
        lever = np.sum(points * perpendicular(outward), axis=1)
        return Measure(
            distance=np.sum(points * outward, axis=1) - offset[side],
            excess=np.zeros(len(points)),
            normal=outward,
            jacobian=lever[:, None] * by_angle[side] - by_offset[side],
            side=side,
        )

    @override
    def outline(self) -> Floats:
        return self.corners

    @override
    def pieces(self) -> tuple[Floats, ...]:
        return tuple(np.stack(ends) for ends in zip(*self.ends(), strict=True))

    @override
    def is_plausible(self) -> bool:
        corners = self.corners
        if not np.isfinite(corners).all() or np.abs(corners).max() > 10.0:
            return False
        angle, _, _, _ = self.lines
        along = np.roll(corners, -1, axis=0) - corners
        forward = np.sum(along * perpendicular(unit(angle)), axis=1)
        return bool((forward > 0.02).all()) and area(corners) > 0.01


@dataclass(frozen=True, eq=False)
class Rectangle(Sided):
    """x, y, yaw, length, width."""

    record = RECTANGLE

    @cached_property
    @override
    def lines(self) -> tuple[Floats, Floats, Floats, Floats]:
        x, y, yaw, length, width = self.parameters
        angle = yaw + np.arange(4) * (np.pi / 2)
        outward = unit(angle)
        tangent = perpendicular(outward)
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

    @override
    def dimension_statuses(
        self, seen: tuple[Sight, ...], status: tuple[str, ...]
    ) -> dict[str, str]:
        return {"length": worst(status[0], status[2]), "width": worst(status[1], status[3])}


@dataclass(frozen=True, eq=False)
class Square(Sided):
    """x, y, yaw, side."""

    record = SQUARE

    @classmethod
    @override
    def starts_in(cls, rectangle: Floats) -> tuple[Shape, ...]:
        x, y, yaw, length, width = rectangle
        return (cls(np.array([x, y, yaw, float(np.sqrt(length * width))])),)

    @cached_property
    @override
    def lines(self) -> tuple[Floats, Floats, Floats, Floats]:
        x, y, yaw, side = self.parameters
        angle, offset, by_angle, by_offset = Rectangle(np.array([x, y, yaw, side, side])).lines
        merge = np.zeros((5, 4))
        merge[[0, 1, 2, 3, 4], [0, 1, 2, 3, 3]] = 1.0
        return angle, offset, by_angle @ merge, by_offset @ merge

    @override
    def describe(self) -> tuple[Floats, dict[str, float]]:
        return self.parameters[:3].copy(), {"side": float(self.parameters[3])}

    @override
    def is_shown(self, own: tuple[str, ...]) -> bool:
        return UNSEEN not in own

    @override
    def side_statuses(self, own: tuple[str, ...]) -> tuple[str, ...]:
        # Both pairs of sides are equally far apart: a seen pair gives the other pair.
        differ = worst(own[0], own[2]) != worst(own[1], own[3])
        return inferred_at_least(own) if differ else own

    @override
    def dimension_statuses(
        self, seen: tuple[Sight, ...], status: tuple[str, ...]
    ) -> dict[str, str]:
        pairs = {worst(status[0], status[2]), worst(status[1], status[3])}
        return {"side": MEASURED if MEASURED in pairs else worst(*pairs, INFERRED)}


@dataclass(frozen=True, eq=False)
class Parallelogram(Sided):
    """x, y, yaw (of the length), length, width, angle from length to width."""

    record = PARALLELOGRAM

    @classmethod
    @override
    def starts_in(cls, rectangle: Floats) -> tuple[Shape, ...]:
        return (cls(np.append(rectangle, np.pi / 2)),)

    @cached_property
    @override
    def lines(self) -> tuple[Floats, Floats, Floats, Floats]:
        x, y, yaw, length, width, corner = self.parameters
        angle = yaw + np.array([corner - np.pi / 2, np.pi / 2, corner + np.pi / 2, 1.5 * np.pi])
        outward = unit(angle)
        lever = perpendicular(outward) @ np.array([x, y])
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
        # The old width's direction becomes x. The angle to the reversed old length is pi - angle.
        return self.at(np.array([x, y, yaw + corner, width, length, np.pi - corner]))

    @override
    def dimension_statuses(
        self, seen: tuple[Sight, ...], status: tuple[str, ...]
    ) -> dict[str, str]:
        has = [MEASURED in (status[k], status[k + 2]) for k in (0, 1)]
        return {
            "length": worst(status[0], status[2]),
            "width": worst(status[1], status[3]),
            "angle": MEASURED if all(has) else INFERRED,
        }


@dataclass(frozen=True, eq=False)
class Rectilinear(Sided):
    """yaw, then the offsets of the distinct lines.

    quarter: (S,), quarter turns from the yaw to each side's normal
    line: (S,), index of each side's offset; sides on one line share an offset
    """

    quarter: Ints
    line: Ints

    record = POLYGON

    @cached_property
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
        return _polygon_pose(self.corners), {}


@dataclass(frozen=True, eq=False)
class Polygon(Sided):
    """The angles of all S sides' normals, then their offsets."""

    record = POLYGON

    @cached_property
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
    def is_shown(self, own: tuple[str, ...]) -> bool:
        # Nothing determines an unseen side with a free angle.
        return UNSEEN not in own

    @override
    def describe(self) -> tuple[Floats, dict[str, float]]:
        return _polygon_pose(self.corners), {}


def _polygon_pose(corners: Floats) -> Floats:
    along = np.roll(corners, -1, axis=0) - corners
    longest = along[int(np.argmax(np.round(np.linalg.norm(along, axis=1), 2)))]
    x, y = centroid(corners)
    return np.array([x, y, float(np.arctan2(longest[1], longest[0]))])
