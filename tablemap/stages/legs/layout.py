"""How legs stand under a top: symmetric partners, corners, the middle."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import shapely
from shapely.geometry import Point, Polygon

from tablemap.geometry import Bools, Floats
from tablemap.model.outlines import largest_polygon
from tablemap.model.shapes import ShapeRecord, shape_named
from tablemap.stages.surface import Surface

_CARRY = 3  # fewest legs that carry a part, unless one stands in its middle
_ACROSS = 0.04  # metres from a leg's mirror image to its partner
_SYMMETRY = 0.03  # metres between a partner and its place by symmetry
_SETS = (4, 3, 2)  # sizes of a set of legs that a turn maps onto itself
_ALIKE, _ALIKE_M = 0.2, 0.006  # share of its size, and metres: legs of one table differ by less
_ASKEW = 0.06  # largest cosine of the angle between the sides of four legs
_WIDER = 0.6  # metres: the feet of a chair are nearer to each other
_BEYOND = 0.02  # metres outside the outline: errors of top and place explain so much


@dataclass(frozen=True, eq=False)
class Frame:
    """The top's ``polygon`` in the map, and its own frame, into which `local` maps places."""

    surface: Surface
    polygon: Polygon

    @property
    def record(self) -> ShapeRecord:
        """The record of the top's shape."""
        return shape_named(self.surface.shape)

    def local(self, places: Floats) -> Floats:
        """Map (n, 2) places to the top's frame."""
        return self.surface.pose.inverse().apply(places)

    def is_beside(self, place: Floats) -> bool:
        """Tell whether a place lies under the other surface that touches the table."""
        beside = self.surface.beside
        return beside is not None and Polygon(beside).contains(Point(*place))

    @property
    def half(self) -> Floats:
        """The (2,) half extents of the outline along the top's axes."""
        corners = self.local(self.surface.outline)
        half: Floats = np.maximum(0.5 * np.ptp(corners, axis=0), 1e-3)
        return half

    def is_central(self, place: Floats) -> bool:
        """Tell whether a place is in the middle tenth of the top, where pedestals stand."""
        u, v = self.local(place[None])[0]
        half = self.half
        return bool(abs(u) < max(0.12 * half[0], 0.05) and abs(v) < max(0.12 * half[1], 0.05))

    def inset(self, place: Floats) -> float:
        """Return how far inside the outline a place is (negative: outside)."""
        point = Point(*place)
        distance = float(self.polygon.exterior.distance(point))
        return distance if self.polygon.contains(point) else -distance

    def is_beyond(self, place: Floats) -> bool:
        """Tell whether a place is too far outside the outline for the top to cover it."""
        return self.inset(place) < -_BEYOND

    def near_corner(self, place: Floats) -> bool:
        """Tell whether a place lies near a corner, or near the rim of a round top."""
        u, v = np.abs(self.local(place[None])[0]) / self.half
        if self.record.is_round:
            return bool(np.hypot(u, v) > 0.4)
        if self.record.is_quadrilateral:
            return bool(u > 0.5 and v > 0.4)
        corners = np.asarray(self.polygon.simplify(0.02).exterior.coords)
        return bool(np.linalg.norm(corners - place, axis=1).min() < 0.35)


def symmetric_sets(
    frame: Frame, places: Floats, tolerance: float
) -> list[tuple[tuple[int, ...], Floats]]:
    """Return sets of places that map onto each other under the top's symmetry.

    Each set is (members, missing places (m, 2) in the map). The sets are complete sets of four,
    three and two, and sets of four with one place missing. Sets under the top come first, then
    complete ones, then outer ones.
    """
    if not len(places):
        return []
    local = frame.local(places)
    sets: dict[tuple[int, ...], Floats] = {}
    for orbit in _orbits(frame, local):
        distance = np.linalg.norm(orbit[:, None] - local[None], axis=2)
        nearest = distance.argmin(axis=1)
        matched = distance[np.arange(len(orbit)), nearest] < tolerance
        members = tuple(sorted({int(i) for i in nearest[matched]}))
        missing = frame.surface.pose.apply(orbit[~matched])
        enough = matched.all() or (len(orbit) == 4 and matched.sum() == 3)
        if enough and len(members) == int(matched.sum()) and len(members) > 1:
            known = sets.get(members)
            if known is None or len(missing) < len(known):
                sets[members] = missing

    beyond = np.array([frame.is_beyond(place) for place in places])

    def order(item: tuple[tuple[int, ...], Floats]) -> tuple[float, ...]:
        members, missing = item
        chosen = list(members)
        outer = float(np.mean(np.abs(local[chosen]) / frame.half))
        full = -len(members) - 0.5 * (len(missing) == 0)
        return (float(beyond[chosen].any()), full, -outer, float(members[0]))

    return sorted(sets.items(), key=order)


def partners(frame: Frame, places: Floats) -> Floats:
    """Return the places (m, 2) in the map of all partners of ``places`` (n, 2) by symmetry."""
    found = np.concatenate([np.zeros((0, 2)), *_orbits(frame, frame.local(places))])
    mapped: Floats = frame.surface.pose.apply(found)
    return mapped


def are_alike(sizes: Floats, size: float) -> Bools:
    """Tell which of ``sizes`` (n,) metres are as legs made alike with one of ``size`` are."""
    alike: Bools = np.abs(sizes - size) < max(_ALIKE * size, _ALIKE_M)
    return alike


def rectangles(places: Floats, sizes: Floats) -> list[tuple[int, ...]]:
    """Return fours of places (n, 2) of things alike in size (n,) that stand in a rectangle.

    This needs no symmetry of the top: legs stand in a rectangle under tops of many shapes. The
    longer side is longer than between the feet of a chair.
    """
    found: set[tuple[int, ...]] = set()
    for corner in range(len(places)):
        alike = are_alike(sizes, float(sizes[corner]))
        own = [int(i) for i in np.flatnonzero(alike) if i != corner]
        for i, j in combinations(own, 2):
            first, second = places[i] - places[corner], places[j] - places[corner]
            lengths = np.hypot(*first), np.hypot(*second)
            if abs(float(first @ second)) > _ASKEW * lengths[0] * lengths[1]:
                continue
            away = np.linalg.norm(places[own] - (places[i] + second), axis=1)
            fourth = own[int(away.argmin())]
            members = tuple(sorted({corner, i, j, fourth}))
            if away.min() < _SYMMETRY and len(members) == 4 and max(lengths) > _WIDER:
                found.add(members)
    return sorted(found)


def table_sets(
    frame: Frame, places: Floats, slender: list[int], wide: list[int]
) -> tuple[set[int], set[int], set[int]]:
    """Return the places in complete sets, those in partial sets, and those of the table's own set.

    ``places`` are (n, 2) in the map; ``slender`` and ``wide`` are indices of those that may be
    legs. The table's own set is the first one near the corners that has three or more places, or
    four of which one is missing. If the table has its own set, places beyond the top belong to no
    set.
    """
    complete: set[int] = set()
    partial: set[int] = set()
    own: set[int] = set()
    for group in (slender, wide):
        for rank, (members, missing) in enumerate(symmetric_sets(frame, places[group], _SYMMETRY)):
            chosen = {group[i] for i in members}
            if own and any(frame.is_beyond(places[i]) for i in chosen):
                continue
            full = len(missing) == 0 and (len(chosen) >= 3 or group is wide)
            if full and (rank == 0 or not complete):
                complete |= chosen
            else:
                partial |= chosen
            if len(chosen) >= 3 and not own and all(frame.near_corner(places[i]) for i in chosen):
                own = chosen
    return complete, partial, own


def _orbits(frame: Frame, local: Floats) -> list[Floats]:
    """Return, for every place, the places of its partners by symmetry (itself first)."""
    turns = _turns(frame.record)
    orbits: list[Floats] = []
    for u, v in local:
        if frame.record.is_mirrored and frame.record.yaw_period:
            if abs(u) < 0.03 or abs(v) < 0.03:
                orbits.append(np.array([[u, v], [-u, -v]]))
            else:
                orbits.append(np.array([[u, v], [-u, v], [-u, -v], [u, -v]]))
        for count in turns:
            angles = 2 * np.pi * np.arange(count) / count
            c, s = np.cos(angles), np.sin(angles)
            orbits.append(np.column_stack([c * u - s * v, s * u + c * v]))
    return [*orbits, *_skewed_orbits(frame, local)]


def _turns(record: ShapeRecord) -> tuple[int, ...]:
    """Return the sizes of sets that a turn maps onto themselves and a mirror does not."""
    if record.symmetry == 0:
        return _SETS
    if record.symmetry is None or (record.is_mirrored and record.symmetry == np.pi):
        return ()
    fold = round(2 * np.pi / record.symmetry)
    return tuple(count for count in _SETS if fold % count == 0)


def _skewed_orbits(frame: Frame, local: Floats) -> list[Floats]:
    """Return the partners along the sides of a top whose angle is not a right angle."""
    name = frame.record.angle
    angle = frame.surface.dimensions.get(name) if name else None
    if angle is None or not 0.1 < angle.value < np.pi - 0.1:
        return []
    axes = np.array([[1.0, np.cos(angle.value)], [0.0, np.sin(angle.value)]])
    oblique = local @ np.linalg.inv(axes).T
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], dtype=np.float64)
    return [(signs * place) @ axes.T for place in oblique]


def is_standing(part: Polygon, places: Floats) -> bool:
    """Tell whether a part of a top would stand on its own on legs at (n, 2) places.

    It stands on three legs or more if all but one have a partner across its middle. It also stands
    on one leg in its middle.
    """
    if part.is_empty or not len(places):
        return False
    away = places - np.asarray(part.centroid.coords[0])
    alone = np.linalg.norm(away[:, None] + away[None], axis=2).min(axis=1) > _ACROSS
    if len(places) < _CARRY:
        return len(places) == 1 and not alone.any()
    return bool(alone.sum() <= 1)


def two_tables(frame: Frame, places: Floats) -> tuple[Floats, ...]:
    """Return the halves of a top that each stand on three legs or more; none where no cut does so.

    Each half is an outline (n, 2), metres in the map. The cut is straight and between the legs.
    """
    local = frame.local(places)
    reach = 2.0 * float(frame.half.max())
    for axis in (0, 1):
        order = np.sort(local[:, axis])
        for cut in (order[_CARRY - 1 : -_CARRY] + order[_CARRY : 1 - _CARRY]) / 2:
            low = local[:, axis] < cut
            box = [-reach, -reach, reach, reach]
            box[2 + axis] = float(cut)
            half = Polygon(frame.surface.pose.apply(np.asarray(shapely.box(*box).exterior.coords)))
            parts = frame.polygon.intersection(half), frame.polygon.difference(half)
            if is_standing(parts[0], places[low]) and is_standing(parts[1], places[~low]):
                halves = map(largest_polygon, parts)
                return tuple(shapely.get_coordinates(half.exterior)[:-1] for half in halves)
    return ()
