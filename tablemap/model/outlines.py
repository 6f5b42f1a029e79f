"""Polygons of outlines and shapes that may fall into several parts."""

from __future__ import annotations

import shapely
from numpy.typing import ArrayLike


def simple_polygon(outline: ArrayLike) -> shapely.Polygon:
    """Return the polygon of an outline (n, 2); if it crosses itself, return the largest part.

    The polygon is empty if the outline encloses nothing.
    """
    polygon = shapely.Polygon(outline)
    if polygon.is_valid:
        simple = polygon.buffer(0)
        return simple if isinstance(simple, shapely.Polygon) else shapely.Polygon()
    return largest_polygon(shapely.make_valid(polygon))


def largest_polygon(shape: shapely.Geometry) -> shapely.Polygon:
    """Return the largest polygon of a shape's parts; it is empty if there is none."""
    parts = [part for part in shapely.get_parts(shape) if isinstance(part, shapely.Polygon)]
    return max(parts, key=shapely.area, default=shapely.Polygon())
