"""Furniture at the table and along the walls."""

from __future__ import annotations

import numpy as np
import shapely

from tablemap.geometry import Floats, Pose2
from tablemap.simulation.meshes import MeshPart, at, box, cylinder
from tablemap.simulation.shapes import Top

_PALETTE = (
    (0.75, 0.22, 0.2), (0.2, 0.45, 0.7), (0.9, 0.75, 0.25), (0.3, 0.6, 0.35),
    (0.55, 0.35, 0.6), (0.85, 0.85, 0.8), (0.25, 0.25, 0.3),
)  # fmt: skip

_STOOL = 0.36  # metres: the side of its seat
PUSHED_IN, DRAWN_OUT, SAT_ON = (-0.3, -0.2), (0.03, 0.15), (-0.02, 0.06)
"""Least and largest gap between a chair's seat and the table, metres."""
_KNEE, _THIGH = 0.42, 0.13  # metres: from the seat's middle to the shin, and thickness
_APART = 0.25  # metres between a thing under the top, its rim, its legs and other things
_SPARE = 0.14  # metres: things under the top are lower than it by more


def chair_places(
    top: Top, count: int, *, between: tuple[float, float], rng: np.random.Generator
) -> list[tuple[Pose2, shapely.Polygon]]:
    """Return the chairs' poses in the table's frame, x away from it, and their footprints.

    ``between`` are the least and the largest gap between seat and table, metres.
    """
    ring = shapely.LinearRing(top.outline)
    start = float(rng.uniform(0, ring.length))
    hull = top.polygon.convex_hull
    places: list[tuple[Pose2, shapely.Polygon]] = []
    for i in range(count):
        for shift in (0.0, 0.13, -0.13, 0.26, -0.26):
            along = (start + (i + shift) * ring.length / count) % ring.length
            place, outwards = rim(ring, along)
            gap = rng.uniform(*between)
            yaw = float(np.arctan2(outwards[1], outwards[0]) + rng.normal(0, 0.08))
            pose = at((place + outwards * (0.21 + gap)), yaw)
            outline = footprint(0.44, 0.44, pose)
            deep = outline.intersection(hull).area > 0.75 * outline.area
            if not deep and not any(outline.intersects(other) for _, other in places):
                places.append((pose, outline))
                break
    return places


def stool_places(
    top: Top, count: int, rng: np.random.Generator
) -> list[tuple[Pose2, shapely.Polygon]]:
    """Return the stools' poses in the table's frame, millimetres off it, and their footprints."""
    places = []
    for _ in range(count):
        place, outwards = rim_place(top, rng, spread=0.8)
        yaw = float(np.arctan2(outwards[1], outwards[0]))
        pose = at(place + outwards * (_STOOL / 2 + rng.uniform(0.002, 0.008)), yaw)
        places.append((pose, footprint(_STOOL, _STOOL, pose)))
    return places


def stool_parts(height: float, rng: np.random.Generator) -> list[MeshPart]:
    """Return a square stool round the origin."""
    return plain_table(_STOOL, _STOOL, height, rng)


def chair_parts(rng: np.random.Generator) -> list[MeshPart]:
    """Return a chair round the origin, its back at positive x."""
    colour = drawn_colour(rng)
    seat = float(rng.uniform(0.43, 0.47))
    legs = [
        box(0.035, 0.035, 0.0, seat - 0.03).placed(Pose2(sx * 0.19, sy * 0.19, 0.0))
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    back = box(0.025, 0.4, seat + 0.1, seat + float(rng.uniform(0.38, 0.5))).placed(
        Pose2(0.2, 0, 0)
    )
    posts = [
        box(0.03, 0.03, seat, seat + 0.12).placed(Pose2(0.2, sy * 0.18, 0.0)) for sy in (-1, 1)
    ]
    solids = [box(0.42, 0.42, seat - 0.03, seat), back, *legs, *posts]
    return [MeshPart(solid, colour) for solid in solids]


def sitter_parts(rng: np.random.Generator) -> list[MeshPart]:
    """Return somebody who sits on a chair round the origin, with shins at negative x."""
    colour = drawn_colour(rng)
    knee = float(rng.uniform(0.5, 0.54))
    solids = [cylinder(0.34, 0.45, 1.1), cylinder(0.2, 1.1, 1.35)]
    for side in (-0.11, 0.11):
        solids.append(cylinder(0.11, 0.05, knee).placed(Pose2(-_KNEE, side, 0.0)))
        solids.append(box(0.26, 0.09, 0.0, 0.07).placed(Pose2(-_KNEE - 0.06, side, 0.0)))
        thigh = box(_KNEE, _THIGH, knee - 0.05, knee - 0.05 + _THIGH)
        solids.append(thigh.placed(Pose2(-0.5 * _KNEE, side, 0.0)))
    return [MeshPart(solid, colour) for solid in solids]


def shins(chair: Pose2) -> Floats:
    """Return the place (2,) between the shins of who sits on a chair."""
    return chair.apply(np.array([-_KNEE, 0.0]))


def things_below(
    top: Top, taken: list[Floats], count: int, rng: np.random.Generator
) -> list[MeshPart]:
    """Draw bins and boxes that stand on the floor under the top, away from ``taken`` places."""
    parts: list[MeshPart] = []
    free = top.polygon.buffer(-_APART / 2)
    for i in range(count):
        size, tall = float(rng.uniform(0.08, 0.14)), float(rng.uniform(0.3, 0.58))
        tall = min(tall, top.height - _SPARE)
        yaw = float(rng.uniform(-np.pi, np.pi))
        for _ in range(30):
            place = rng.uniform(top.outline.min(axis=0), top.outline.max(axis=0))
            near = any(np.linalg.norm(place - other) < _APART for other in taken)
            if near or not free.contains(shapely.Point(place)):
                continue
            taken = [*taken, place]
            solid = box(size, 0.8 * size, 0.0, tall) if i % 2 else cylinder(size, 0.0, tall)
            parts.append(MeshPart(solid.placed(at(place, yaw)), drawn_colour(rng)))
            break
    return parts


def couch_parts(length: float, rng: np.random.Generator) -> list[MeshPart]:
    """Return a couch along x, its back at positive y."""
    colour = drawn_colour(rng)
    seat = box(length, 0.8, 0.1, 0.42)
    back = box(length, 0.2, 0.42, 0.8).placed(Pose2(0.0, 0.3, 0.0))
    arms = [box(0.18, 0.8, 0.42, 0.6).placed(Pose2(s * (length / 2 - 0.09), 0, 0)) for s in (-1, 1)]
    feet = [
        cylinder(0.05, 0.0, 0.1).placed(Pose2(sx * (length / 2 - 0.1), sy * 0.3, 0.0))
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    return [MeshPart(solid, colour, 0.5) for solid in (seat, back, *arms, *feet)]


def plain_table(
    length: float, width: float, height: float, rng: np.random.Generator
) -> list[MeshPart]:
    """Return another table round the origin, on four legs."""
    colour = drawn_colour(rng)
    legs = [
        box(0.05, 0.05, 0.0, height - 0.03).placed(
            Pose2(sx * (length / 2 - 0.06), sy * (width / 2 - 0.06), 0.0)
        )
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    return [MeshPart(solid, colour) for solid in (box(length, width, height - 0.03, height), *legs)]


def cabinet(length: float, depth: float, height: float, rng: np.random.Generator) -> list[MeshPart]:
    """Return a cupboard, or a shelf on four posts, round the origin."""
    colour = drawn_colour(rng)
    if rng.random() < 0.6:
        return [MeshPart(box(length, depth, 0.0, height), colour)]
    posts = [
        box(0.04, 0.04, 0.0, height).placed(
            Pose2(sx * (length / 2 - 0.02), sy * (depth / 2 - 0.02), 0)
        )
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    boards = [box(length, depth, z, z + 0.02) for z in np.arange(0.3, height, 0.35)]
    return [MeshPart(solid, colour) for solid in (*posts, *boards)]


def drawn_colour(rng: np.random.Generator) -> tuple[float, float, float]:
    """Draw a colour of the palette."""
    return _PALETTE[int(rng.integers(len(_PALETTE)))]


def footprint(along: float, across: float, pose: Pose2) -> shapely.Polygon:
    """Return a rectangle round a pose."""
    x, y = along / 2, across / 2
    return shapely.Polygon(pose.apply([[-x, -y], [x, -y], [x, y], [-x, y]]))


def rim_place(top: Top, rng: np.random.Generator, *, spread: float) -> tuple[Floats, Floats]:
    """Draw a place on the rim, near the middle of a side where the top has corners."""
    ring = shapely.LinearRing(top.outline)
    if len(top.corners) == 0:
        return rim(ring, float(rng.uniform(0, ring.length)))
    ends = np.roll(top.corners, -1, axis=0)
    lengths = np.linalg.norm(ends - top.corners, axis=1)
    i = int(rng.choice(len(lengths), p=lengths / lengths.sum()))
    fraction = 0.5 + spread * float(rng.uniform(-0.5, 0.5))
    place = (1 - fraction) * top.corners[i] + fraction * ends[i]
    return rim(ring, float(ring.project(shapely.Point(place))))


def rim(ring: shapely.LinearRing, along: float) -> tuple[Floats, Floats]:
    """Return the place at a distance along the rim, and the outward normal of its side there."""
    at, before, after = (
        np.array(ring.interpolate((along + step) % ring.length).coords[0])
        for step in (0, -1e-3, 1e-3)
    )
    tangent = (after - before) / np.linalg.norm(after - before)
    return at, np.array([tangent[1], -tangent[0]])
