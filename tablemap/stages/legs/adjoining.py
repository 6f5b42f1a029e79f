"""Two pieces of furniture that touch at one height, told apart by their legs.

No depth camera sees a gap of millimetres: the outline is then that of both pieces. A table and a
stool pushed against it each stand on their own legs, placed evenly about their own middle. The arm
of an L-shaped desk has no such legs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import shapely
from shapely.geometry import LineString, Point, Polygon

from tablemap.errors import ProcessWarning, WarnedPlace
from tablemap.geometry import Floats, Pose2
from tablemap.model.outlines import simple_polygon
from tablemap.stages.legs import Legs, is_standing
from tablemap.stages.outline import Outline, ViewEdges
from tablemap.stages.surface import Surface
from tablemap.stages.surface.shapes.shape import extents

_STRAIGHT = 0.01  # metres: a smaller bend of the outline makes no corner
_SLIVER = 0.03  # metres: a narrower piece does not count
_SAW = 1e-4  # metres: half the width of a cut
_FEWEST = 4  # legs of two pieces, of which one may be a pedestal's
_CLOSE = 0.04  # metres: points farther from a piece are not part of it
_SEAT = 0.6  # metres: a piece no longer than this is a seat, and no part of a table's top


@dataclass(frozen=True, eq=False)
class Adjoining:
    """A surface that touches the table at its height.

    - ``own``: (n, 2) metres in the map, outline of the table's part of the supposed single top
    - ``beside``: (n, 2) metres in the map, outline of the rest
    - ``legs``: how many legs carry the rest
    """

    own: Floats
    beside: Floats
    legs: int

    @property
    def is_seat(self) -> bool:
        """Whether the surface beside the table is as small as a seat."""
        return extents(self.beside)[0] <= _SEAT

    @property
    def warning(self) -> ProcessWarning:
        """The warning that says what was cut off, where, and why."""
        x, y = np.asarray(Polygon(self.beside).centroid.coords[0])
        length, width = extents(self.beside)
        on = "a leg in its middle" if self.legs == 1 else f"{self.legs} legs of its own"
        message = (
            f"A surface of {length:.2f} by {width:.2f} m at ({x:.2f}, {y:.2f}) touches the table "
            f"at its height and stands on {on}; it was taken for another piece of furniture."
        )
        code = "surface.adjoining" if self.is_seat else "accuracy.adjoining"
        places = (WarnedPlace.ring(self.beside),)
        return ProcessWarning(code, "surface", message, places=places)


def find_adjoining(
    surface: Surface, legs: Legs, *, near: tuple[float, float] | None = None
) -> Adjoining | None:
    """Cut the outline in two so that each part stands on its own legs; None if no cut does this.

    Cuts begin at corners that point inwards. Only measured legs count (`legs.is_standing`). The
    table is the part at ``near``; without ``near`` it is the larger part.
    """
    outline = shapely.simplify(simple_polygon(surface.outline), _STRAIGHT)
    places = np.array([(leg.x, leg.y) for leg in legs.legs if leg.status == "measured"])
    if not isinstance(outline, Polygon) or len(places) < _FEWEST:
        return None
    for parts in _cuts(outline):
        held = [places[shapely.contains_xy(part, places)] for part in parts]
        if not all(is_standing(part, own) for part, own in zip(parts, held, strict=True)):
            continue
        first = 0
        if near is not None:
            place = Point(near)
            first = int(parts[1].distance(place) < parts[0].distance(place))
        own, beside = parts[first], parts[1 - first]
        return Adjoining(_ring(own), _ring(beside), len(held[1 - first]))
    return None


def _cuts(outline: Polygon) -> list[tuple[Polygon, Polygon]]:
    """Cut an outline in two from each inward corner; the shortest cut first, the larger part first.

    A cut extends a side until it meets the outline, or joins two inward corners.
    """
    corners = _ring(outline)
    onto, off = corners - np.roll(corners, 1, 0), np.roll(corners, -1, 0) - corners
    inward = np.flatnonzero(onto[:, 0] * off[:, 1] - onto[:, 1] * off[:, 0] < 0)
    ends = [(corners[i], corners[k]) for i, k in combinations(inward, 2)]
    for i in inward:
        for along in (onto[i], -off[i]):
            end = _hit(outline, corners[i], along / np.linalg.norm(along))
            ends += [(corners[i], end)] if end is not None else []
    found = []
    for start, end in ends:
        length = float(np.linalg.norm(end - start))
        past = (end - start) / max(length, 1e-9) * 1e-3
        saw = LineString([start - past, end + past]).buffer(_SAW)
        opened = outline.difference(saw).buffer(-_SLIVER / 2)
        pieces = shapely.get_parts(opened.buffer(_SLIVER / 2, join_style="mitre"))
        parts = [piece for piece in pieces if piece.area > _SLIVER**2]
        if len(parts) == 2:
            smaller, larger = sorted(parts, key=lambda part: part.area)
            found.append((length, larger, smaller))
    return [(larger, smaller) for _, larger, smaller in sorted(found, key=lambda each: each[0])]


def _hit(outline: Polygon, corner: Floats, ahead: Floats) -> Floats | None:
    """Return where a ray from a corner first meets the outline again."""
    ray = LineString([corner + _SLIVER * ahead, corner + 20.0 * ahead])
    hits = shapely.get_coordinates(outline.exterior.intersection(ray))
    return hits[np.argmin((hits - corner) @ ahead)] if len(hits) else None


def without(outline: Outline, adjoining: Adjoining, poses: Sequence[Pose2]) -> Outline:
    """Return the outline without the edges and votes of the surface beside it, and add a warning.

    ``poses`` (map from base) place the views, by snapshot index.
    """
    own, beside = Polygon(adjoining.own), Polygon(adjoining.beside)

    def is_own(in_base: Floats, view: ViewEdges) -> np.ndarray:
        places = shapely.points(poses[view.index].apply(in_base))
        # Stray points, far from both parts, do not belong to the part beside.
        other = shapely.distance(places, beside)
        kept: np.ndarray = (shapely.distance(places, own) <= other) | (other > _CLOSE)
        return kept

    views = [
        replace(view.only(is_own(view.points, view)), top=view.top[is_own(view.top, view)])
        for view in outline.views
    ]
    warnings = (*outline.warnings, adjoining.warning)
    return replace(outline, views=tuple(views), warnings=warnings, beside=adjoining.beside)


def _ring(polygon: Polygon) -> Floats:
    ring: Floats = np.asarray(shapely.geometry.polygon.orient(polygon).exterior.coords)[:-1]
    return ring
