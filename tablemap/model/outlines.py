"""The polygon of an outline that may cross itself."""

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
    parts = [
        part
        for part in shapely.get_parts(shapely.make_valid(polygon)).tolist()
        if isinstance(part, shapely.Polygon)
    ]
    return max(parts, key=shapely.area, default=shapely.Polygon())
