"""All fits of shapes; each class carries the record of the shape that it fits."""

from __future__ import annotations

from tablemap.stages.surface.shapes.curved import Circle, Ellipse
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
    Stadium,
)
"""Fits with a fixed number of parameters; each is tried on every top, in this order."""
POLYGONS: tuple[type[Shape], ...] = (Rectilinear, Polygon)
"""Fits whose number of parameters grows with the number of sides."""
