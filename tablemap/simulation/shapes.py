"""Outlines of table tops, and their truth.

Conventions are those of table.json: the pose is the area centroid, x runs along the length,
outlines are counter-clockwise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import shapely

from tablemap.corners import Arcs
from tablemap.errors import ConfigError
from tablemap.geometry import Floats, Pose2
from tablemap.model.shapes import (
    CIRCLE,
    ELLIPSE,
    PARALLELOGRAM,
    POLYGON,
    RECTANGLE,
    SQUARE,
    STADIUM,
    shape_named,
)
from tablemap.simulation.scenario import Table


@dataclass(frozen=True, eq=False)
class Top:
    """A table top in its own frame, round its centroid; outlines run counter-clockwise, metres.

    outline: (n, 2), of the mesh
    stated: (m, 2), of the truth file
    corners: (k, 2), for legs and chairs; empty for a round top
    """

    shape: str
    dimensions: dict[str, float]
    corner_radius: float | None
    outline: Floats
    stated: Floats
    corners: Floats
    height: float

    @property
    def polygon(self) -> shapely.Polygon:
        """The outline as a polygon."""
        return shapely.Polygon(self.outline)


def draw_top(table: Table, rng: np.random.Generator, *, nominal: bool) -> Top:
    """Draw a top's sizes, each within the table's spread of the nominal one.

    Raises `ConfigError` if the shape needs a size that is missing, or cannot be simulated.
    """
    if table.shape not in _DRAWN:
        raise ConfigError(
            f"A table of shape {table.shape!r} cannot be simulated; there are {', '.join(_DRAWN)}."
        )
    for size in shape_named(table.shape).lengths or ("corners",):
        if not getattr(table, size):
            raise ConfigError(
                f"A table of shape {table.shape!r} needs table.{size}; it is missing."
            )
    factors = 1 + table.size_spread * rng.uniform(-1, 1, 3)
    if nominal:
        factors = np.ones(3)
    along, across, up = (float(factor) for factor in factors)
    drawn = _DRAWN[table.shape](table, along, across)
    return Top(
        shape=table.shape,
        dimensions=drawn.dimensions,
        corner_radius=drawn.corner_radius,
        outline=drawn.outline,
        stated=drawn.outline if drawn.stated is None else drawn.stated,
        corners=drawn.corners,
        height=table.height * up,
    )


def place_top(top: Top, pose: Pose2) -> Pose2:
    """Turn a pose by the shape's symmetry into the yaw range of table.json."""
    turn = shape_named(top.shape).symmetry
    if turn is None:
        return pose
    yaw = float(pose.yaw % turn) if turn else 0.0
    return Pose2(pose.x, pose.y, yaw)


def surface_truth(
    top: Top, pose: Pose2, *, thickness: float | None, tolerance: float
) -> dict[str, object]:
    """Return the truth file's ``surface``.

    - ``thickness``: metres; None if nothing shows it
    - ``tolerance``: metres by which the sizes are open
    """
    return {
        "shape": top.shape,
        "pose": {"x": pose.x, "y": pose.y, "yaw": pose.yaw},
        "height": top.height,
        "dimensions": top.dimensions,
        "corner_radius": top.corner_radius,
        "thickness": thickness,
        "outline": pose.apply(top.stated).tolist(),
        "tolerance": {"dimensions": tolerance, "height": 0.0},
    }


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A shape of drawn sizes; fields as `Top` has them."""

    dimensions: dict[str, float]
    outline: Floats
    corners: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    corner_radius: float | None = None
    stated: Floats | None = None


def _circle(table: Table, along: float, across: float) -> _Drawn:
    diameter = table.diameter * along
    return _round({"diameter": diameter}, diameter, diameter)


def _elliptical(table: Table, along: float, across: float) -> _Drawn:
    major, minor = _ordered(table.major * along, table.minor * across)
    return _round({"major": major, "minor": minor}, major, minor)


def _round(dimensions: dict[str, float], major: float, minor: float) -> _Drawn:
    # Its mesh is finer than the 72 points that table.json has.
    return _Drawn(dimensions, _ellipse(major, minor, 144), stated=_ellipse(major, minor, 72))


def _rectangle(table: Table, along: float, across: float) -> _Drawn:
    length, width = _ordered(table.length * along, table.width * across)
    corners = _corners(length, width, np.pi / 2)
    return _cornered({"length": length, "width": width}, corners, table.corner_radius * along)


def _square(table: Table, along: float, across: float) -> _Drawn:
    side = table.side * along
    corners = _corners(side, side, np.pi / 2)
    return _cornered({"side": side}, corners, table.corner_radius * along)


def _parallelogram(table: Table, along: float, across: float) -> _Drawn:
    length, width = _ordered(table.length * along, table.width * across)
    angle = float(np.deg2rad(table.angle_deg))
    corners = _corners(length, width, angle)
    dimensions = {"length": length, "width": width, "angle": angle}
    return _cornered(dimensions, corners, table.corner_radius * along)


def _cornered(dimensions: dict[str, float], corners: Floats, radius: float) -> _Drawn:
    """Round the corners (k, 2), if they have a radius, about the centroid of the whole."""
    outline = corners
    if radius:
        outline = np.concatenate(Arcs.rounding(corners, radius).points(_CHORDS))
    centroid = np.asarray(shapely.Polygon(outline).centroid.coords)[0]
    return _Drawn(dimensions, outline - centroid, corners - centroid, radius or None)


def _stadium(table: Table, along: float, across: float) -> _Drawn:
    length, width = _ordered(table.length * along, table.width * across)
    middle = shapely.LineString([[(width - length) / 2, 0.0], [(length - width) / 2, 0.0]])
    ring = shapely.orient_polygons(middle.buffer(width / 2, quad_segs=36)).exterior
    return _Drawn({"length": length, "width": width}, np.asarray(ring.coords)[:-1])


def _polygon(table: Table, along: float, across: float) -> _Drawn:
    scaled = np.array(table.corners) * (along, across)
    polygon = shapely.geometry.polygon.orient(shapely.Polygon(scaled))
    corners = np.asarray(polygon.exterior.coords)[:-1]
    return _cornered({}, corners, table.corner_radius * along)


def _corners(length: float, width: float, angle: float) -> Floats:
    u, v = np.array([length, 0.0]) / 2, width / 2 * np.array([np.cos(angle), np.sin(angle)])
    return np.array([-u - v, u - v, u + v, -u + v])


def _ordered(first: float, second: float) -> tuple[float, float]:
    return max(first, second), min(first, second)


def _ellipse(major: float, minor: float, count: int) -> Floats:
    phase = np.arange(count) * 2 * np.pi / count
    return np.column_stack([major / 2 * np.cos(phase), minor / 2 * np.sin(phase)])


_CHORDS = 11  # of a quarter circle


_DRAWN: dict[str, Callable[[Table, float, float], _Drawn]] = {
    CIRCLE.name: _circle,
    ELLIPSE.name: _elliptical,
    RECTANGLE.name: _rectangle,
    SQUARE.name: _square,
    PARALLELOGRAM.name: _parallelogram,
    STADIUM.name: _stadium,
    POLYGON.name: _polygon,
}
"""Draws a shape with the table's sizes times ``along`` and ``across``."""
