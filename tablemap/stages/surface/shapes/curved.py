"""Outlines that are one curve: circle, ellipse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from tablemap.geometry import Floats, Ints
from tablemap.model.shapes import CIRCLE, ELLIPSE
from tablemap.stages.surface.shapes.shape import Measure, Shape, unit
from tablemap.stages.surface.shapes.sides import (
    INFERRED,
    MEASURED,
    Sight,
    inferred_at_least,
    longest_gap,
)

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
