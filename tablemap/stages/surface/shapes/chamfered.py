"""Straight sides between corners that are cut off: rectangles and polygons with one size of cut."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from typing_extensions import override

from tablemap.config import SurfaceConfig
from tablemap.geometry import Bools, Floats, wrap_angles
from tablemap.model.shapes import POLYGON
from tablemap.stages.surface.shapes.shape import centroid
from tablemap.stages.surface.shapes.sides import UNSEEN
from tablemap.stages.surface.shapes.straight import Sided


@dataclass(frozen=True, eq=False)
class Chamfered(Sided):
    """The parameters of a shape with sharp corners, then the size of the cuts.

    A cut takes as much off both sides that meet in a corner. ``kind`` is a shape with sharp
    corners; its parameters do not matter. ``is_cut`` (S,) tells which of its corners are cut; the
    cut is a side between its neighbours.
    """

    kind: Sided
    is_cut: Bools

    record = POLYGON
    least_facing = 0.8  # a side and a cut turn by half a right angle

    @cached_property
    def sharp(self) -> Sided:
        """The same sides with sharp corners."""
        return self.kind.at(self.parameters[:-1])

    @property
    def cut(self) -> float:
        """What a cut takes off each of both sides, metres."""
        return float(self.parameters[-1])

    @cached_property
    @override
    def lines(self) -> tuple[Floats, Floats, Floats, Floats]:
        angle, offset, by_angle, by_offset = self.sharp.lines
        by_angle, by_offset = (np.pad(by, ((0, 0), (0, 1))) for by in (by_angle, by_offset))
        lines = []
        for side in range(len(angle)):
            if self.is_cut[side]:
                turn = float(wrap_angles(angle[side] - angle[side - 1]))
                both = offset[side - 1] + offset[side]
                by_turn = by_angle[side] - by_angle[side - 1]
                c, s = np.cos(turn / 2), np.sin(turn / 2)
                by = (by_offset[side - 1] + by_offset[side]) / (2 * c)
                by = by + (both * s / (4 * c**2) - self.cut * c / 2) * by_turn
                by[-1] -= s
                middle = (by_angle[side - 1] + by_angle[side]) / 2
                place = both / (2 * c) - self.cut * s
                lines.append((angle[side - 1] + turn / 2, place, middle, by))
            lines.append((angle[side], offset[side], by_angle[side], by_offset[side]))
        angles, offsets, by_angles, by_offsets = map(np.array, zip(*lines, strict=True))
        return angles, offsets, by_angles, by_offsets

    @override
    def describe(self) -> tuple[Floats, dict[str, float]]:
        pose = self.sharp.describe()[0]
        pose[:2] = centroid(self.outline())
        return pose, {}

    @override
    def is_plausible(self) -> bool:
        return self.cut > 0.0 and self.sharp.is_plausible() and super().is_plausible()

    @override
    def is_shown(self, own: tuple[str, ...]) -> bool:
        """A corner may be hidden: all cuts are of one size."""
        is_side = np.insert(np.ones(len(self.is_cut), bool), np.flatnonzero(self.is_cut), False)
        seen = [status for status, side in zip(own, is_side, strict=True) if side]
        return self.kind.is_shown(tuple(seen)) and UNSEEN not in seen

    @override
    def is_told(self, covariance: Floats, config: SurfaceConfig) -> bool:
        return bool(self.cut > config.corner_resolution + 3 * np.sqrt(covariance[-1, -1]))
