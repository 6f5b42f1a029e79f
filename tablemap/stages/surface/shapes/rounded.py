"""Straight sides between round corners: rectangles, parallelograms and polygons of one radius."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Self

import numpy as np
from typing_extensions import override

from tablemap.config import SurfaceConfig
from tablemap.corners import Arcs
from tablemap.geometry import Floats, Ints
from tablemap.model.shapes import CORNER_RADIUS, POLYGON, ShapeRecord
from tablemap.stages.surface.shapes.shape import Measure, centroid, perpendicular, unit
from tablemap.stages.surface.shapes.sides import INFERRED, MEASURED, Sight, inferred_at_least
from tablemap.stages.surface.shapes.straight import Sided

_CHORDS = 8  # of a quarter circle
_START = 0.03  # metres
_STEP = 1.4  # from one radius that is tried to the next


@dataclass(frozen=True, eq=False)
class Rounded(Sided):
    """The parameters of a shape with sharp corners, then the radius that rounds all of them.

    A corner that points inward, as of an L, is rounded too. ``kind`` is a shape with sharp corners;
    its parameters do not matter. Straight sides have even numbers; after each comes the arc at its
    end.
    """

    kind: Sided

    @staticmethod
    def starts_of(sharp: Sided) -> tuple[Rounded, ...]:
        """Return starts out of a fitted shape with sharp corners."""
        radii = (_START, _largest_radius(sharp) / 2)
        return tuple(Rounded(np.append(sharp.parameters, radius), sharp) for radius in radii)

    @staticmethod
    def of_all_radii(sharp: Sided, config: SurfaceConfig) -> Iterator[Rounded]:
        """Return a shape with its corners rounded more and more, from where it seems sharp on."""
        radius = Rounded(np.append(sharp.parameters, 0.0), sharp).seeming(config)
        while (shape := Rounded(np.append(sharp.parameters, radius), sharp)).is_plausible():
            yield shape
            radius *= _STEP

    @property
    @override
    def record(self) -> ShapeRecord:
        return self.kind.record

    @cached_property
    def sharp(self) -> Sided:
        """The same sides with sharp corners."""
        return self.kind.at(self.parameters[:-1])

    @property
    def radius(self) -> float:
        """The radius of the corners, metres."""
        return float(self.parameters[-1])

    @cached_property
    def _arcs(self) -> Arcs:
        return Arcs.rounding(self.corners, self.radius)

    @cached_property
    @override
    def lines(self) -> tuple[Floats, Floats, Floats, Floats]:
        angle, offset, by_angle, by_offset = self.sharp.lines
        by_radius = np.zeros((len(angle), 1))
        return angle, offset, np.hstack([by_angle, by_radius]), np.hstack([by_offset, by_radius])

    @override
    def ends(self) -> tuple[Floats, Floats]:
        first, last = self._arcs.ends()
        return last, np.roll(first, -1, axis=0)

    @override
    def measure(self, points: Floats, normals: Floats) -> Measure:
        straight = super().measure(points, normals)
        is_none = straight.side < 0
        result = replace(straight, side=np.where(is_none, -1, 2 * straight.side))
        # A point beside the straight part of its side is on no arc.
        rest = np.flatnonzero(is_none | (straight.excess > 0))
        bend = self._on_bends(points[rest], normals[rest])
        off = np.where(is_none, np.inf, np.hypot(straight.distance, straight.excess))[rest]
        nearer = np.abs(bend.distance) < off
        for field in fields(Measure):
            getattr(result, field.name)[rest[nearer]] = getattr(bend, field.name)[nearer]
        return result

    def _on_bends(self, points: Floats, normals: Floats) -> Measure:
        """Measure (N, 2) points against their nearest arcs; far away where no arc's normal fits."""
        arcs = self._arcs
        sign = np.sign(arcs.turn)
        before, after = unit(arcs.before), unit(arcs.before + arcs.turn)
        arm = points[:, None] - arcs.centre
        reach = np.maximum(np.linalg.norm(arm, axis=2), 1e-9)
        outward = (sign / reach)[..., None] * arm
        # The normal of a place on an arc is a mean of the normals of both sides.
        by_before = -np.sum(outward * perpendicular(after), axis=2) / np.sin(arcs.turn)
        by_after = np.sum(outward * perpendicular(before), axis=2) / np.sin(arcs.turn)
        is_on = (by_before >= 0) & (by_after >= 0)
        is_on &= np.einsum("nsi,ni->ns", outward, normals) > 0.5
        distance = np.where(is_on, sign * (reach - arcs.radius), np.inf)
        bend = np.argmin(np.abs(distance), axis=1)
        picked = np.arange(len(points)), bend
        # With its sides' lines, a centre moves so that its distance from both stays the radius.
        number = np.arange(len(sign))
        of_before = self.on_lines(arcs.centre, number - 1).jacobian[bend]
        of_after = self.on_lines(arcs.centre, number).jacobian[bend]
        shares = np.stack([by_before[picked], by_after[picked]])
        jacobian = shares[0][:, None] * of_before + shares[1][:, None] * of_after
        jacobian[:, -1] = sign[bend] * (shares.sum(axis=0) - 1)
        return Measure(
            distance=distance[picked],
            excess=np.zeros(len(points)),
            normal=outward[picked],
            jacobian=jacobian,
            side=2 * ((bend - 1) % len(sign)) + 1,
        )

    @override
    def against(self, points: Floats, side: Ints) -> Measure:
        return replace(self.on_lines(points, side // 2), side=side)

    @override
    def outline(self) -> Floats:
        return np.concatenate(self._bends())

    @override
    def pieces(self) -> tuple[Floats, ...]:
        pieces: list[Floats] = []
        for start, end, bend in zip(*self.ends(), self._bends(), strict=True):
            pieces += [np.stack([start, end]), bend]
        return tuple(pieces)

    def _bends(self) -> list[Floats]:
        """Return the arcs, that at the end of the first side first."""
        arcs = self._arcs.points(_CHORDS)
        return [*arcs[1:], arcs[0]]

    @override
    def describe(self) -> tuple[Floats, dict[str, float]]:
        pose, dimensions = self.sharp.describe()
        pose[:2] = centroid(self.outline())
        return pose, dimensions | {CORNER_RADIUS: self.radius}

    @override
    def is_plausible(self) -> bool:
        return self.sharp.is_plausible() and 0.0 < self.radius <= _largest_radius(self.sharp)

    @override
    def normalised(self) -> Self:
        sharp = self.sharp
        normalised = sharp.normalised()
        if normalised is sharp:
            return self
        return self.at(np.append(normalised.parameters, self.radius))

    @override
    def is_shown(self, own: tuple[str, ...]) -> bool:
        return self.sharp.is_shown(own[::2])

    @override
    def is_told(self, covariance: Floats, config: SurfaceConfig) -> bool:
        start, end = self.ends()
        shortest = float(np.linalg.norm(end - start, axis=1).min())
        if self.record is POLYGON and shortest < config.line_minimum:
            # Arcs between shorter sides follow any curve.
            return False
        return bool(self.radius > self.seeming(config) + 3 * np.sqrt(covariance[-1, -1]))

    def seeming(self, config: SurfaceConfig) -> float:
        """Return the radius that the sharp shape may seem to have, as pixels are coarse, metres.

        Such a radius cuts off as much of the sharpest corner as `SurfaceConfig.corner_resolution`
        does of a right angle. For an acute corner it is not less than that.
        """
        cut = float((1 / np.cos(self._arcs.turn / 2)).max()) - 1
        return config.corner_resolution * max((2**0.5 - 1) / cut, 1.0)

    @override
    def side_statuses(self, own: tuple[str, ...]) -> tuple[str, ...]:
        straight = self.sharp.side_statuses(own[::2])
        bends = inferred_at_least(own[1::2])
        return tuple(status for pair in zip(straight, bends, strict=True) for status in pair)

    @override
    def dimension_statuses(
        self, seen: tuple[Sight, ...], status: tuple[str, ...]
    ) -> dict[str, str]:
        bends = [sight.fraction >= 0.3 for sight in seen[1::2]]
        figures = self.sharp.dimension_statuses(seen[::2], status[::2])
        return figures | {CORNER_RADIUS: MEASURED if sum(bends) >= 2 else INFERRED}


def _largest_radius(sharp: Sided) -> float:
    """Return the radius with which the arcs at both ends of a side leave nothing straight of it."""
    corners = sharp.corners
    length = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    tangent = np.abs(np.tan(Arcs.rounding(corners, 0.0).turn / 2))
    return float((length / (tangent + np.roll(tangent, -1))).min())
