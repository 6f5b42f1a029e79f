"""Arcs that round the corners of a polygon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.geometry import Floats, wrap_angles


@dataclass(frozen=True, eq=False)
class Arcs:
    """Arc i rounds corner i: it touches the side that ends there and the side that begins there.

    radius: metres
    centre: (S, 2), metres
    before: (S,), radians; direction of the outward normal of the side that ends at the corner
    turn: (S,), radians from that normal to the next side's; negative where the corner points inward
    """

    radius: float
    centre: Floats
    before: Floats
    turn: Floats

    @staticmethod
    def rounding(corners: Floats, radius: float) -> Arcs:
        """Round all corners (S, 2) of a counter-clockwise polygon with one radius."""
        along = np.roll(corners, -1, axis=0) - corners
        after = np.arctan2(-along[:, 0], along[:, 1])
        before = np.roll(after, 1)
        turn = wrap_angles(after - before)
        normals = np.stack([np.cos(before) + np.cos(after), np.sin(before) + np.sin(after)], axis=1)
        away = np.sign(turn) * radius / (1 + np.cos(turn))
        return Arcs(radius, corners - away[:, None] * normals, before, turn)

    def ends(self) -> tuple[Floats, Floats]:
        """Return where the arcs begin and end, (S, 2) each."""
        reach = (np.sign(self.turn) * self.radius)[:, None]
        first, last = (
            self.centre + reach * np.column_stack([np.cos(angle), np.sin(angle)])
            for angle in (self.before, self.before + self.turn)
        )
        return first, last

    def points(self, chords: float) -> list[Floats]:
        """Return each arc as (n, 2) points, with so many chords in a quarter circle."""
        arcs = []
        for centre, before, turn in zip(self.centre, self.before, self.turn, strict=True):
            count = max(int(np.ceil(chords * abs(turn) / (np.pi / 2) - 1e-6)), 1)
            angle = before + np.linspace(0, turn, count + 1)
            reach = np.sign(turn) * self.radius
            arcs.append(centre + reach * np.column_stack([np.cos(angle), np.sin(angle)]))
        return arcs
