"""Clutter: things that stand on the table."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely

from tablemap.geometry import Floats
from tablemap.simulation.furniture import drawn_colour, footprint, rim, rim_place
from tablemap.simulation.meshes import Mesh, MeshPart, at, box, cylinder, revolve
from tablemap.simulation.scenario import Clutter
from tablemap.simulation.shapes import Top

_TRIES, _PLACES = 150, 150
_CROWD_SCALES = 1.1, 0.5
_LOW = np.array([1.0, 1.0, 0.6])  # things that fill a table are lower than single things on it
_RIM_GAP = 0.003, 0.02  # metres
_INWARDS = np.arange(6) * 0.01
_PHASES = np.arange(24) * 2 * np.pi / 24
_CIRCLE = np.column_stack([np.cos(_PHASES), np.sin(_PHASES)]) / np.cos(np.pi / 24)
"""A polygon round the unit circle: round things stay inside of their footprint."""


def draw_clutter(
    clutter: Clutter, top: Top, rng: np.random.Generator, crowd: np.random.Generator
) -> list[MeshPart]:
    """Draw the things on the top, in the table's frame; no two of them touch.

    ``crowd`` gives the random numbers for things at the rim and for things that fill the top.
    """
    parts: list[MeshPart] = []
    taken: list[shapely.Polygon] = []
    scale = float(np.clip(np.sqrt(top.polygon.area) / 0.9, 0.5, 1.0))
    for i in range(clutter.flush + clutter.overhang):
        flush = i < clutter.flush
        place, outwards = rim_place(top, rng, spread=0.5)
        along, across, tall = scale * rng.uniform((0.14, 0.12, 0.05), (0.28, 0.22, 0.2))
        beyond = 0.0 if flush else across * rng.uniform(0.25, 0.45)
        centre = place + outwards * (beyond - across / 2)
        pose = at(centre, float(np.arctan2(outwards[1], outwards[0]) - np.pi / 2))
        outline = footprint(along, across, pose)
        if any(outline.intersects(other) for other in taken):
            continue
        taken.append(outline.buffer(0.03))
        if not flush and i % 2:
            # A runner: a thin cloth that lies on the top and hangs down over its edge.
            flap = at((place + outwards * 0.004), pose.yaw)
            runner = box(along, across, top.height, top.height + 0.003)
            inside = at((place - outwards * across / 2), pose.yaw)
            hanging = box(along, 0.004, top.height - 0.18, top.height + 0.003)
            parts += [
                MeshPart(runner.placed(inside), drawn_colour(rng)),
                MeshPart(hanging.placed(flap), drawn_colour(rng)),
            ]
        else:
            parts.append(
                MeshPart(
                    box(along, across, top.height, top.height + tall).placed(pose),
                    drawn_colour(rng),
                )
            )
    for i in range(clutter.count):
        kind = clutter.items[i % len(clutter.items)]
        thing = _item(kind, scale, rng)
        solid, radius = thing.part, thing.radius
        free = top.polygon.buffer(-radius - 0.03)
        for _ in range(20):
            place = rng.uniform(top.outline.min(axis=0), top.outline.max(axis=0))
            disc = shapely.Point(place).buffer(radius)
            if not free.contains(shapely.Point(place)) or any(disc.intersects(t) for t in taken):
                continue
            taken.append(disc.buffer(0.02))
            pose = at(place, float(rng.uniform(-np.pi, np.pi)))
            parts.append(solid.of(solid.mesh.placed(pose, top.height)))
            break
    return (
        parts + _at_the_rim(clutter, top, taken, scale, crowd) + _crowd(clutter, top, taken, crowd)
    )


def _at_the_rim(
    clutter: Clutter,
    top: Top,
    taken: list[shapely.Polygon],
    scale: float,
    rng: np.random.Generator,
) -> list[MeshPart]:
    """Draw things all round the top, about a centimetre inside of the rim."""
    parts: list[MeshPart] = []
    ring = shapely.LinearRing(top.outline)
    start = float(rng.uniform(0, ring.length))
    for i in range(clutter.rim):
        along = start + (i + float(rng.uniform(-0.3, 0.3))) * ring.length / clutter.rim
        place, outwards = rim(ring, along % ring.length)
        yaw = float(np.arctan2(outwards[1], outwards[0]) + np.pi / 2)
        thing = _item(clutter.items[i % len(clutter.items)], scale, rng)
        gap = thing.across / 2 + float(rng.uniform(*_RIM_GAP))
        places = place - outwards * (gap + _INWARDS[:, None])
        parts += _stood(thing, places, np.full(len(places), yaw), top, taken)
    return parts


def _crowd(
    clutter: Clutter,
    top: Top,
    taken: list[shapely.Polygon],
    rng: np.random.Generator,
) -> list[MeshPart]:
    """Draw more and smaller things until they cover enough of the top."""
    parts: list[MeshPart] = []
    low, high = top.outline.min(axis=0), top.outline.max(axis=0)
    for scale in np.linspace(*_CROWD_SCALES, _TRIES) if clutter.cover else ():
        covered = shapely.union_all(taken).intersection(top.polygon).area
        if covered >= clutter.cover * top.polygon.area:
            break
        kind = clutter.items[int(rng.integers(len(clutter.items)))]
        thing = _item(kind, float(scale), rng)
        mesh = thing.part.mesh
        flattened = Mesh(mesh.vertices * _LOW, mesh.triangles)
        thing = replace(thing, part=thing.part.of(flattened))
        places = rng.uniform(low, high, (_PLACES, 2))
        parts += _stood(thing, places, rng.uniform(-np.pi, np.pi, _PLACES), top, taken)
    return parts


def _stood(
    thing: _Thing, places: Floats, yaws: Floats, top: Top, taken: list[shapely.Polygon]
) -> list[MeshPart]:
    """Put a thing at the first free place and return it; nothing if no place is free.

    At a free place it touches nothing else and does not reach over the rim.
    """
    c, s = np.cos(yaws), np.sin(yaws)
    turns = np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
    outlines = shapely.polygons(thing.footprint @ turns.transpose(0, 2, 1) + places[:, None])
    free = shapely.contains(top.polygon, outlines)
    free &= ~shapely.intersects(shapely.union_all(taken), outlines)
    if not free.any():
        return []
    first = int(free.argmax())
    taken.append(outlines[first])
    pose = at(places[first], float(yaws[first]))
    return [thing.part.of(thing.part.mesh.placed(pose, top.height))]


@dataclass(frozen=True, eq=False)
class _Thing:
    """Something round the origin; ``radius`` is the room it needs in any orientation.

    footprint: (n, 2), its outline on the top
    """

    part: MeshPart
    footprint: Floats
    radius: float

    @property
    def across(self) -> float:
        return float(np.ptp(self.footprint[:, 1]))


def _item(kind: str, scale: float, rng: np.random.Generator) -> _Thing:
    colour = drawn_colour(rng)
    reflectance = float(rng.uniform(0.25, 0.9))
    if kind == "cylinder":
        diameter, tall = scale * rng.uniform((0.05, 0.08), (0.1, 0.25))
        solid = MeshPart(cylinder(diameter, 0.0, tall), colour, reflectance)
        return _Thing(solid, diameter / 2 * _CIRCLE, diameter / 2)
    if kind == "bowl":
        radius = scale * float(rng.uniform(0.07, 0.12))
        profile = [(0.4 * radius, 0.0), (radius, 0.6 * radius), (0.93 * radius, 0.6 * radius)]
        solid = MeshPart(revolve([*profile, (0.35 * radius, 0.008)]), colour, reflectance)
        return _Thing(solid, radius * _CIRCLE, radius)
    low, high = ((0.1, 0.08, 0.06), (0.28, 0.22, 0.3))
    if kind == "book":
        low, high = ((0.15, 0.12, 0.01), (0.3, 0.22, 0.05))
    along, across, tall = scale * rng.uniform(low, high)
    solid = MeshPart(box(along, across, 0.0, tall), colour, reflectance)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2 * (along, across)
    return _Thing(solid, corners, float(np.hypot(along, across)) / 2)
