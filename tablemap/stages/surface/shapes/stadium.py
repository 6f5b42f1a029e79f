"""A stadium, as of conference tables: a rectangle with half circles at two of its sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from typing_extensions import override

from tablemap.config import SurfaceConfig
from tablemap.geometry import Floats
from tablemap.model.shapes import STADIUM
from tablemap.stages.surface.shapes.shape import Measure, Shape, unit
from tablemap.stages.surface.shapes.sides import INFERRED, MEASURED, UNSEEN, Sight, worst

END_POINTS = 37
"""Points of each half circle, both ends included: as dense as a circle's outline."""
LEAST_STRAIGHT = 0.05
"""Least straight side, metres; a shorter one looks like an ellipse's, and nobody builds it."""


@dataclass(frozen=True, eq=False)
class Stadium(Shape):
    """x, y, yaw, length (from end to end), width.

    Sides are the end at positive x, the straight side at positive y, and the two opposite ones.
    """

    record = STADIUM

    @classmethod
    @override
    def starts_in(cls, rectangle: Floats) -> tuple[Shape, ...]:
        return (cls(rectangle.copy()),)

    def _axes(self) -> Floats:
        c, s = np.cos(self.parameters[2]), np.sin(self.parameters[2])
        return np.array([[c, s], [-s, c]])

    @override
    def measure(self, points: Floats, normals: Floats) -> Measure:
        length, width = self.parameters[3:]
        axes = self._axes()
        local = (points - self.parameters[:2]) @ axes.T
        past = np.abs(local[:, 0]) - (length - width) / 2
        at_end = past > 0
        ahead = np.where(local[:, 0] >= 0, 1.0, -1.0)
        # The normal of an edge point says to which of the two straight sides it belongs.
        left = np.where(normals @ axes[1] >= 0, 1.0, -1.0)
        from_centre = np.column_stack([ahead * past, local[:, 1]])
        reach = np.maximum(np.linalg.norm(from_centre, axis=1), 1e-9)
        straight = np.column_stack([np.zeros(len(points)), left])
        outward = np.where(at_end[:, None], from_centre / reach[:, None], straight)
        along = np.abs(outward[:, 0])
        normal = outward @ axes
        turn = outward[:, 0] * local[:, 1] - outward[:, 1] * local[:, 0]
        return Measure(
            distance=np.where(at_end, reach, left * local[:, 1]) - width / 2,
            excess=np.zeros(len(points)),
            normal=normal,
            jacobian=np.column_stack([-normal, turn, -along / 2, (along - 1) / 2]),
            side=np.where(at_end, 1 - ahead, 2 - left).astype(np.int64),
        )

    @override
    def outline(self) -> Floats:
        return np.concatenate(self._ends())

    @override
    def pieces(self) -> tuple[Floats, ...]:
        front, back = self._ends()
        return front, np.stack([front[-1], back[0]]), back, np.stack([back[-1], front[0]])

    def _ends(self) -> tuple[Floats, Floats]:
        """Return the half circles (n, 2) at positive and at negative x, counter-clockwise."""
        length, width = self.parameters[3:]
        arc = width / 2 * unit(np.linspace(-np.pi / 2, np.pi / 2, END_POINTS))
        front = arc + np.array([(length - width) / 2, 0.0])
        axes, middle = self._axes(), self.parameters[:2]
        return front @ axes + middle, -front @ axes + middle

    @override
    def describe(self) -> tuple[Floats, dict[str, float]]:
        length, width = self.parameters[3:]
        return self.parameters[:3].copy(), {"length": float(length), "width": float(width)}

    @override
    def is_plausible(self) -> bool:
        length, width = self.parameters[3:]
        return bool(width > 0.1 and width + LEAST_STRAIGHT < length < 10.0)

    @override
    def is_shown(self, own: tuple[str, ...]) -> bool:
        # Of an unseen end, neither the place nor the round shape is known.
        return UNSEEN not in (own[0], own[2])

    @override
    def is_told(self, covariance: Floats, config: SurfaceConfig) -> bool:
        difference = np.array([1.0, -1.0])
        sigma = np.sqrt(difference @ covariance[3:, 3:] @ difference)
        length, width = self.parameters[3:]
        return bool(length - width > LEAST_STRAIGHT + 3 * sigma)

    @override
    def side_statuses(self, own: tuple[str, ...]) -> tuple[str, ...]:
        # A half circle's diameter is the distance of the straight sides.
        follows = MEASURED in (own[0], own[2])
        return tuple(
            INFERRED if i % 2 and follows and status == UNSEEN else status
            for i, status in enumerate(own)
        )

    @override
    def dimension_statuses(
        self, seen: tuple[Sight, ...], status: tuple[str, ...]
    ) -> dict[str, str]:
        ends = (status[0], status[2])
        across = worst(status[1], status[3])
        return {"length": worst(*ends), "width": MEASURED if MEASURED in ends else across}
