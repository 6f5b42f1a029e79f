"""Closed bodies under a part of the top: a cupboard beside a table, or a desk's own drawers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy import ndimage
from shapely.geometry import LinearRing, LineString, Polygon
from shapely.ops import substring

from tablemap.errors import ProcessWarning, WarnedPlace
from tablemap.geometry import Bools, Floats, Ints, Pose2
from tablemap.model.outlines import largest_polygon
from tablemap.stages.snapshots import Snapshot
from tablemap.stages.surface.shapes.shape import extents

_STATION, _LAYER = 0.02, 0.05  # metres along the edge, and up
_LOW, _BELOW = 0.10, 0.05  # metres above the floor, and under the top
_ABOVE = (0.06, 0.12)  # metres: what stands so far above the top is a wall, or a chair's back
_FLUSH, _BEYOND = 0.03, 0.08  # metres from the edge: a front is nearer, what lies behind is not
_LEAST_FACING = 0.35  # cosine: at a glance, the place of a front is uncertain
_LEAST_LOOKS = 3
_OPEN = 0.25  # of the looks: with more that go through there is no front
_GAP = 0.10  # metres of a front that something hides
_FILLED = 0.75  # of the rectangle round it: fronts on two sides alone cut off a triangle
_THICK = 0.12  # metres: what is thinner is a panel
_SLIVER = 0.03  # metres: half the width of what is not counted beside a body
_TABLE = 0.30  # metres: what is narrower beside the bodies is no table


@dataclass(frozen=True, eq=False)
class ClosedBody:
    """A part of the top under whose edge only an upright front was seen.

    - ``outline``: (n, 2) metres in the map, of this part of the top
    - ``rest``: (m, 2) metres in the map, of the top without all such parts
    """

    outline: Floats
    rest: Floats

    def warning(self, others: Sequence[ClosedBody] = ()) -> ProcessWarning:
        """Doubt the top: where the body stands, and how large the top is without it.

        ``others`` are drawn with it.
        """
        x, y = np.asarray(Polygon(self.outline).centroid.coords[0])
        body, rest = extents(self.outline), extents(self.rest)
        message = (
            f"A closed body stands under a part of the top, about {body[0]:.2f} by {body[1]:.2f} m "
            f"at ({x:.2f}, {y:.2f}), flush with its edge. If it is a cupboard beside the table, "
            f"the table's own top is only about {rest[0]:.2f} by {rest[1]:.2f} m."
        )
        places = tuple(WarnedPlace.ring(one.outline).standing() for one in (self, *others))
        return ProcessWarning("accuracy.closed_body", "legs", message, places=places)


def find_bodies(
    snapshots: tuple[Snapshot, ...],
    poses: dict[int, Pose2],
    by_laser: Floats,
    outline: Polygon,
    height: float,
) -> list[ClosedBody]:
    """Return the parts of a top that seem to be those of closed bodies, the largest first.

    ``by_laser`` (n, 2) are places in the map where the laser's beams ended. No depth camera sees a
    gap of millimetres between a table and a cupboard of its height. But below the cupboard's edges
    there is a front, and below the table's there are legs and free space. A part that has a front
    on three sides is a body's. If no table is left beside the bodies, there is none.
    """
    ring = outline.exterior
    closed = _closed(snapshots, poses, by_laser, ring, height)
    parts = [_part(ring, run * ring.length / len(closed)) for run in _runs(closed)]
    parts = [part for part in parts if _is_body(part)]
    rest = outline.difference(shapely.union_all(parts)).buffer(-_SLIVER)
    rest = largest_polygon(rest.buffer(_SLIVER, join_style="mitre"))
    if rest.buffer(-_TABLE / 2).is_empty:
        return []
    parts.sort(key=lambda part: -part.area)
    return [ClosedBody(_corners(part), _corners(rest)) for part in parts]


def _closed(
    snapshots: tuple[Snapshot, ...],
    poses: dict[int, Pose2],
    by_laser: Floats,
    ring: LinearRing,
    height: float,
) -> Bools:
    """Tell at which stations along the outline there is a front below, and nothing above."""
    count = max(int(ring.length / _STATION), 1)
    at = (np.arange(count) + 0.5) * ring.length / count
    places = shapely.get_coordinates(shapely.line_interpolate_point(ring, at))
    ahead = np.roll(places, -1, axis=0) - np.roll(places, 1, axis=0)
    across = np.column_stack([ahead[:, 1], -ahead[:, 0]])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    heights = np.arange(_LOW, height - _BELOW, _LAYER)
    looks = np.zeros((2, count, len(heights) + len(_ABOVE)))
    for index, map_from_base in poses.items():
        levels = np.concatenate([heights, height + np.array(_ABOVE)])
        looks += _looks(snapshots[index], map_from_base, places, across, levels)
    met, passed = looks
    is_upper = np.arange(len(heights)) >= len(heights) // 2
    below = slice(0, len(heights))
    upper, lower = (
        (met[:, below][:, chosen].sum(axis=1), passed[:, below][:, chosen].sum(axis=1))
        for chosen in (is_upper, ~is_upper)
    )
    beams = np.zeros(count, dtype=bool)
    if len(by_laser):
        ends = shapely.points(by_laser)
        ends = ends[shapely.distance(ends, ring) < _FLUSH]
        beams[(shapely.line_locate_point(ring, ends) / ring.length * count).astype(int) % count] = 1
    is_front = (_is_met(*lower) | beams) & ~_is_passed(*lower)
    is_front &= _is_met(*upper) | (beams & ~_is_passed(*upper))
    taller = _is_met(met[:, len(heights) :].sum(axis=1), passed[:, len(heights) :].sum(axis=1))
    closed: Bools = is_front & ~taller
    return closed


def _is_met(met: Floats, passed: Floats) -> Bools:
    known: Bools = (met >= _LEAST_LOOKS) & (passed <= _OPEN * (met + passed))
    return known


def _is_passed(met: Floats, passed: Floats) -> Bools:
    known: Bools = (met + passed >= _LEAST_LOOKS) & (passed > _OPEN * (met + passed))
    return known


def _looks(
    snapshot: Snapshot, map_from_base: Pose2, places: Floats, across: Floats, heights: Floats
) -> Floats:
    """Return (2, n, k): whether a view met something at a place and height, or saw through it."""
    base_from_map = map_from_base.inverse()
    in_base = base_from_map.apply(places)
    normals = base_from_map.rotate(across)
    sight = in_base - snapshot.base_from_camera[:2, 3]
    distance = np.maximum(np.linalg.norm(sight, axis=1), 1e-6)
    facing = np.abs(np.einsum("ij,ij->i", sight, normals)) / distance
    points = np.concatenate(
        [
            np.repeat(in_base, len(heights), axis=0),
            np.tile(heights, len(places))[:, None],
        ],
        axis=1,
    )
    z, depth = (each.reshape(len(places), -1) for each in snapshot.depth_at(points))
    depth[facing <= _LEAST_FACING] = np.nan
    # The depth's difference as a distance across the front.
    with np.errstate(divide="ignore", invalid="ignore"):
        behind = (depth / z - 1.0) * (distance * facing)[:, None]
        return np.stack([np.abs(behind) < _FLUSH, behind > _BEYOND]).astype(np.float64)


def _runs(closed: Bools) -> list[Ints]:
    """Return where each run on the ring begins and ends, in stations, short gaps bridged.

    There is none if all of the ring is closed.
    """
    gap = int(_GAP / _STATION)
    three = ndimage.binary_closing(np.tile(closed, 3), np.ones(gap + 1))
    ring = three[len(closed) : 2 * len(closed)]
    if ring.all():
        return []
    shift = int(np.argmin(ring))
    labels, count = ndimage.label(np.roll(ring, -shift))
    runs = [np.flatnonzero(labels == k) + shift for k in range(1, count + 1)]
    return [np.array([run[0], run[-1] + 1]) for run in runs]


def _part(ring: LinearRing, run: Floats) -> Polygon:
    """Return what a straight cut between the ends of a run, metres along a ring, cuts off."""
    corners = shapely.get_coordinates(ring)
    twice = LineString(np.concatenate([corners[:-1], corners]))
    arc = shapely.get_coordinates(substring(twice, *run))
    return largest_polygon(Polygon(arc).buffer(0)) if len(arc) > 2 else Polygon()


def _is_body(part: Polygon) -> bool:
    """Tell whether a part is that of a body: not of a panel along one side or along two."""
    if part.buffer(-_THICK / 2).is_empty:
        return False
    return bool(part.area >= _FILLED * part.minimum_rotated_rectangle.area)


def _corners(polygon: Polygon) -> Floats:
    corners: Floats = shapely.get_coordinates(polygon.exterior)[:-1]
    return corners
