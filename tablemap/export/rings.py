"""Outlines of round and straight shapes about their middle, as fine polygons."""

from __future__ import annotations

import numpy as np

from tablemap.corners import Arcs
from tablemap.geometry import Floats

SAGITTA = 5e-5
"""Largest distance of a chord inside of its curve, metres."""


def arc_steps(radius: float) -> int:
    """Return the number of chords of a quarter circle that keeps their sagitta small."""
    if radius <= SAGITTA:
        return 1
    return max(4, int(np.ceil(np.pi / 4 / np.arccos(1 - SAGITTA / radius))))


def ellipse_ring(major: float, minor: float) -> Floats:
    """Return (N, 2) points of an ellipse of these axes, metres, counter-clockwise."""
    count = 4 * arc_steps(max(major, minor) / 2)
    angle = np.arange(count) * (2 * np.pi / count)
    ring: Floats = np.stack([major / 2 * np.cos(angle), minor / 2 * np.sin(angle)], axis=1)
    return ring


def circle_ring(radius: float) -> Floats:
    """Return (N, 2) points of a circle, metres, counter-clockwise."""
    return ellipse_ring(2 * radius, 2 * radius)


def rectangle_ring(length: float, width: float, corner_radius: float = 0.0) -> Floats:
    """Return the (N, 2) corners of a rectangle, or its arcs, metres, counter-clockwise."""
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [length / 2, width / 2]
    radius = min(corner_radius, length / 2, width / 2)
    if radius <= SAGITTA:
        return corners
    ring = np.concatenate(Arcs.rounding(corners, radius).points(arc_steps(radius)))
    # With a radius of half a side there is no straight part between two arcs: their ends coincide.
    apart = np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1) > 1e-9
    rounded: Floats = ring[apart]
    return rounded
