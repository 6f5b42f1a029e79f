"""Outlines with curves: circle, ellipse, rounded rectangle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from typing_extensions import override

from tablemap.config import SurfaceConfig
from tablemap.geometry import Floats, Ints
from tablemap.model.shapes import CIRCLE, ELLIPSE, RECTANGLE
from tablemap.stages.surface.shapes.shape import Measure, Shape, unit
from tablemap.stages.surface.shapes.sides import (
    INFERRED,
    MEASURED,
    Sight,
    inferred_at_least,
    longest_gap,
    worst,
)
from tablemap.stages.surface.shapes.straight import Rectangle

CIRCLE_POINTS = 72
ARCS = 8


@dataclass(frozen=True, eq=False)
class Round(Shape):
    """A closed curve, divided into `ARCS` arcs; each arc follows from the others."""

    longest_gap: ClassVar[int]
    """A figure still counts as measured with this many unseen arcs in a row."""

    @override
    def side_statuses(self, own: tuple[str, ...]) -> tuple[str, ...]:
        return inferred_at_least(own)

    @override
    def dimension_statuses(
        self, seen: tuple[Sight, ...], status: tuple[str, ...]
    ) -> dict[str, str]:
        total = float(np.mean([sight.fraction for sight in seen]))
        gap = longest_gap([sight.fraction > 0.2 for sight in seen])
        result = MEASURED if total >= 0.4 and gap <= self.longest_gap else INFERRED
        return dict.fromkeys(self.record.lengths, result)


@dataclass(frozen=True, eq=False)
class Circle(Round):
    """x, y, radius."""

    record = CIRCLE
    longest_gap = 4

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
        outline: Floats = self.parameters[:2] + self.parameters[2] * unit(angle)
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


def _arc(offset: Floats) -> Ints:
    turn = np.arctan2(offset[:, 1], offset[:, 0]) % (2 * np.pi)
    return np.minimum((turn * (ARCS / (2 * np.pi))).astype(np.int64), ARCS - 1)


def _arcs(outline: Floats) -> tuple[Floats, ...]:
    closed = np.concatenate([outline, outline[:1]])
    each = len(outline) // ARCS
    return tuple(closed[k * each : (k + 1) * each + 1] for k in range(ARCS))


@dataclass(frozen=True, eq=False)
class Ellipse(Round):
    """x, y and the symmetric matrix (xx, xy, yy) that maps the unit circle onto the ellipse.

    Unlike axes and yaw, the matrix has no singularity where the ellipse becomes a circle.
    """

    record = ELLIPSE
    longest_gap = 3

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
        return self.parameters[:2] + unit(angle) @ self._matrix()

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
class RoundedRectangle(Shape):
    """x, y, yaw, length, width, corner radius."""

    record = RECTANGLE

    @classmethod
    @override
    def starts_in(cls, rectangle: Floats) -> tuple[Shape, ...]:
        return tuple(cls(np.append(rectangle, radius)) for radius in (0.03, 0.25 * rectangle[4]))

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
        # The normal of an edge point says to which of two opposite straight sides it belongs.
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
            arcs.append(centre + radius * unit(turn + quarter * np.pi / 2))
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

    @override
    def is_told(self, covariance: Floats, config: SurfaceConfig) -> bool:
        # A pixel's size makes a sharp corner look like one with a small radius.
        least = config.corner_resolution + 3 * np.sqrt(covariance[5, 5])
        return bool(self.parameters[5] > least)

    @override
    def side_statuses(self, own: tuple[str, ...]) -> tuple[str, ...]:
        bends = inferred_at_least(own[1::2])
        return tuple(bends[i // 2] if i % 2 else status for i, status in enumerate(own))

    @override
    def dimension_statuses(
        self, seen: tuple[Sight, ...], status: tuple[str, ...]
    ) -> dict[str, str]:
        bends = [sight.fraction >= 0.3 for sight in seen[1::2]]
        return {
            "length": worst(status[0], status[4]),
            "width": worst(status[2], status[6]),
            "corner_radius": MEASURED if sum(bends) >= 2 else INFERRED,
        }
