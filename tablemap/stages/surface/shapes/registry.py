"""Which fit makes which shape: each class carries the record of the shape that it is fitted for."""

from __future__ import annotations

from tablemap.stages.surface.shapes.curved import Circle, Ellipse, RoundedRectangle
from tablemap.stages.surface.shapes.shape import Shape
from tablemap.stages.surface.shapes.stadium import Stadium
from tablemap.stages.surface.shapes.straight import (
    Parallelogram,
    Polygon,
    Rectangle,
    Rectilinear,
    Square,
)

PRIMITIVES: tuple[type[Shape], ...] = (
    Circle,
    Ellipse,
    Rectangle,
    Square,
    Parallelogram,
    RoundedRectangle,
    Stadium,
)
"""Fits with a fixed number of parameters, each tried on every top, in this order."""
POLYGONS: tuple[type[Shape], ...] = (Rectilinear, Polygon)
"""Fits with as many parameters as the top has sides."""
