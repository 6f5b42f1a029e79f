"""Outlines of round and straight shapes about their middle, as fine polygons."""

from __future__ import annotations

import numpy as np

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
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], dtype=np.float64)
    radius = min(corner_radius, length / 2, width / 2)
    centres = signs * [length / 2 - radius, width / 2 - radius]
    if radius <= SAGITTA:
        ring: Floats = signs * [length / 2, width / 2]
        return ring
    turn = np.linspace(0, np.pi / 2, arc_steps(radius) + 1)
    angles = turn + np.arange(4)[:, None] * (np.pi / 2)
    arcs = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    ring = (centres[:, None] + radius * arcs).reshape(-1, 2)
    # With a radius of half a side there is no straight part between two arcs: their ends coincide.
    apart = np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1) > 1e-9
    rounded: Floats = ring[apart]
    return rounded
