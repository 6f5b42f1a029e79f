"""Table tops as outlines, and what the truth says of them.

Conventions are those of table.json: the pose is the area centroid, x runs along the length,
outlines are counter-clockwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from tablemap.errors import ConfigError
from tablemap.geometry import Floats, Pose2
from tablemap.simulation.scenario import Table

_TURNS = {"square": np.pi / 2, "circle": 0.0}
_SIZES = {
    "circle": ("diameter",),
    "ellipse": ("major", "minor"),
    "rectangle": ("length", "width"),
    "square": ("side",),
    "parallelogram": ("length", "width"),
    "polygon": ("corners",),
}


@dataclass(frozen=True, eq=False)
class Top:
    """A table top: ``outline`` (n, 2) counter-clockwise round its centroid, in its own frame.

    ``corners`` (k, 2) are its few corners (empty where it is round), for legs and chairs.
    """

    shape: str
    dimensions: dict[str, float]
    corner_radius: float | None
    outline: Floats
    corners: Floats
    height: float

    @property
    def polygon(self) -> shapely.Polygon:
        """The outline as a polygon."""
        return shapely.Polygon(self.outline)


def draw_top(table: Table, rng: np.random.Generator, *, nominal: bool) -> Top:
    """Draw a top's sizes, each within the table's spread of the nominal one.

    Raises `ConfigError` where a size that the shape needs is missing.
    """
    for size in _SIZES[table.shape]:
        if not getattr(table, size):
            raise ConfigError(
                f"A table of shape {table.shape!r} needs table.{size}; it is missing."
            )
    factors = 1 + table.size_spread * rng.uniform(-1, 1, 3)
    if nominal:
        factors = np.ones(3)
    along, across, up = (float(factor) for factor in factors)
    height = table.height * up
    radius: float | None = None
    corners: Floats = np.zeros((0, 2))
    dimensions: dict[str, float] = {}
    if table.shape == "circle":
        dimensions = {"diameter": table.diameter * along}
        outline = _ellipse(dimensions["diameter"], dimensions["diameter"])
    elif table.shape == "ellipse":
        major, minor = _ordered(table.major * along, table.minor * across)
        dimensions = {"major": major, "minor": minor}
        outline = _ellipse(major, minor)
    elif table.shape == "polygon":
        scaled = np.array(table.corners) * (along, across)
        polygon = shapely.geometry.polygon.orient(shapely.Polygon(scaled))
        outline = np.asarray(polygon.exterior.coords)[:-1]
        outline = outline - np.asarray(polygon.centroid.coords)[0]
        corners = outline
    else:
        length, width = _ordered(table.length * along, table.width * across)
        angle = np.pi / 2
        if table.shape == "square":
            length = width = table.side * along
            dimensions = {"side": length}
        else:
            dimensions = {"length": length, "width": width}
        if table.shape == "parallelogram":
            angle = np.deg2rad(table.angle_deg)
            dimensions["angle"] = float(angle)
        u, v = np.array([length, 0.0]) / 2, width / 2 * np.array([np.cos(angle), np.sin(angle)])
        corners = np.array([-u - v, u - v, u + v, -u + v])
        outline = corners
        if table.corner_radius:
            radius = table.corner_radius * along
            outline = _rounded(length, width, radius)
    return Top(table.shape, dimensions, radius, outline, corners, height)


def place_top(top: Top, pose: Pose2) -> Pose2:
    """Turn a pose by the shape's symmetry into the yaw range of table.json."""
    turn = _TURNS.get(top.shape, np.pi)
    if top.shape == "polygon":
        return pose
    yaw = float(pose.yaw % turn) if turn else 0.0
    return Pose2(pose.x, pose.y, yaw)


def surface_truth(top: Top, pose: Pose2, *, tolerance: float) -> dict[str, object]:
    """Return the truth file's ``surface``; ``tolerance`` is how far sizes are open (metres)."""
    outline = _ellipse_in_72(top) if top.shape in ("circle", "ellipse") else top.outline
    return {
        "shape": top.shape,
        "pose": {"x": pose.x, "y": pose.y, "yaw": pose.yaw},
        "height": top.height,
        "dimensions": top.dimensions,
        "corner_radius": top.corner_radius,
        "outline": pose.apply(outline).tolist(),
        "tolerance": {"dimensions": tolerance, "height": 0.0},
    }


def _ordered(first: float, second: float) -> tuple[float, float]:
    return max(first, second), min(first, second)


def _ellipse(major: float, minor: float, count: int = 144) -> Floats:
    phase = np.arange(count) * 2 * np.pi / count
    return np.column_stack([major / 2 * np.cos(phase), minor / 2 * np.sin(phase)])


def _ellipse_in_72(top: Top) -> Floats:
    sizes = list(top.dimensions.values())
    return _ellipse(sizes[0], sizes[-1], 72)


def _rounded(length: float, width: float, radius: float, count: int = 12) -> Floats:
    quarter = np.linspace(0, np.pi / 2, count)
    arcs = []
    for i, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        centre = np.array([sx * (length / 2 - radius), sy * (width / 2 - radius)])
        phase = quarter + i * np.pi / 2
        arcs.append(centre + radius * np.column_stack([np.cos(phase), np.sin(phase)]))
    return np.concatenate(arcs)
