"""The world of a recording: the table, its surroundings, and the robot's path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from tablemap.geometry import Floats, Pose2
from tablemap.simulation.clutter import draw_clutter
from tablemap.simulation.furniture import (
    DRAWN_OUT,
    PUSHED_IN,
    SAT_ON,
    cabinet,
    chair_parts,
    chair_places,
    couch_parts,
    plain_table,
    shins,
    sitter_parts,
    stool_parts,
    stool_places,
    things_below,
)
from tablemap.simulation.meshes import MeshPart, at, box, cylinder, prism
from tablemap.simulation.relief import Relief, Waves, draw_relief, draw_waves, wavy_floor
from tablemap.simulation.scenario import Scenario
from tablemap.simulation.seeds import Generators
from tablemap.simulation.shapes import Top, draw_top, place_top
from tablemap.simulation.table import SimulatedLeg, draw_legs, table_parts

_WALL_HEIGHT = 2.4
_LEG_ROOM = 0.25  # metres between the middle of who sits there and a leg


@dataclass(frozen=True, eq=False)
class Person:
    """Somebody who walks to and fro between two places (2,) in the map, ``speed`` in m/s."""

    first: Floats
    second: Floats
    speed: float
    phase: float
    ankle: float = 0.12

    def ankles(self, seconds: Floats) -> Floats:
        """Return where both ankles are: (n, 2, 2) for times (n,)."""
        way = self.second - self.first
        length = float(np.linalg.norm(way))
        ahead = way / length
        walked = (self.speed * seconds + self.phase * length) % (2 * length)
        middle = self.first + np.minimum(walked, 2 * length - walked)[:, None] * ahead
        step = 0.25 * np.sin(2 * np.pi * 0.9 * seconds)[:, None] * ahead
        aside = 0.11 * np.array([-ahead[1], ahead[0]])
        return np.stack([middle + step + aside, middle - step - aside], axis=1)

    def parts(self, second: float) -> list[MeshPart]:
        """Return the body at a time, for the depth camera."""
        ankles = self.ankles(np.array([second]))[0]
        legs = [cylinder(self.ankle, 0.0, 0.85).placed(at(ankle, 0.0)) for ankle in ankles]
        torso = cylinder(0.4, 0.85, 1.75).placed(at(ankles.mean(axis=0), 0.0))
        return [MeshPart(solid, (0.3, 0.35, 0.55)) for solid in (*legs, torso)]


@dataclass(frozen=True, eq=False)
class World:
    """Everything in the map frame; the floor is z = 0.

    - ``path``: the closed line round the table on which the base drives
    - ``before``, ``after``: the furniture that is moved halfway, before and after the move
    - ``relief``, ``waves``: deviations of the top and of the floor from a plane, None if flat
    """

    top: Top
    map_from_table: Pose2
    legs: tuple[SimulatedLeg, ...]
    parts: tuple[MeshPart, ...]
    before: tuple[MeshPart, ...]
    after: tuple[MeshPart, ...]
    people: tuple[Person, ...]
    path: shapely.LinearRing
    away_from_wall: float
    relief: Relief | None
    waves: Waves | None


def draw_world(scenario: Scenario, generator: Generators, *, nominal: bool) -> World:
    """Draw the world of a scenario."""
    rng = generator("world")
    table, around = scenario.table, scenario.surroundings
    top = draw_top(table, rng, nominal=nominal)
    drawn = rng.uniform((-0.6, -0.6, 0.0), (0.6, 0.6, np.pi))
    pose = place_top(top, Pose2.from_array(drawn if table.pose is None else table.pose))
    legs = draw_legs(table.legs, top, rng, nominal=nominal)
    local = table_parts(table, top, legs)
    local += draw_clutter(scenario.clutter, top, rng, generator("crowd"))
    relief = draw_relief(table, top, generator)
    if relief:
        local = relief.shaped(local, top)
    waves = draw_waves(scenario.ground, generator)
    obstacles = [top.polygon]
    between = PUSHED_IN if around.chairs_pushed_in else DRAWN_OUT
    for chair, footprint in chair_places(top, around.chairs, between=between, rng=rng):
        local += _moved(chair_parts(rng), chair)
        obstacles.append(footprint)
    feet = [leg.pose.translation for leg in legs]
    sitting = generator("seated")
    for chair, footprint in chair_places(top, around.seated, between=SAT_ON, rng=sitting):
        if all(np.linalg.norm(shins(chair) - foot) > _LEG_ROOM for foot in feet):
            local += _moved([*chair_parts(sitting), *sitter_parts(sitting)], chair)
            obstacles.append(footprint)
            feet.append(shins(chair))
    local += things_below(top, feet, around.below, generator("below"))
    for stool, footprint in stool_places(top, around.stools, rng):
        local += _moved(stool_parts(top.height + float(rng.uniform(-0.004, 0.004)), rng), stool)
        obstacles.append(footprint)
    for i in range(around.neighbours):
        parts, footprint = _neighbour(top, rng, side=-1 if i % 2 else 1)
        local += parts
        obstacles.append(footprint)
    clearance = scenario.robot.clearance
    if not nominal:
        clearance += scenario.robot.clearance_spread * float(rng.uniform(-1, 1))
    driven = shapely.union_all(obstacles).convex_hull.buffer(clearance)
    room, room_pose = _room(scenario, top, driven, pose, rng)
    parts = _moved(local, pose)
    parts += _walls(scenario, room, room_pose, waves, rng)
    map_driven = shapely.Polygon(pose.apply(np.asarray(driven.exterior.coords)))
    free = map_driven.buffer(0.4)
    parts += _along_walls(scenario, room, room_pose, free, rng)
    before, after = _moved_furniture(around.moved, map_driven, rng)
    people = tuple(_person(map_driven, rng) for _ in range(around.people))
    path = shapely.LinearRing(shapely.geometry.polygon.orient(map_driven, -1.0).exterior.coords)
    return World(
        top,
        pose,
        tuple(legs),
        tuple(parts),
        before,
        after,
        people,
        path,
        pose.yaw - np.pi / 2,
        relief,
        waves,
    )


def _moved(parts: list[MeshPart], pose: Pose2) -> list[MeshPart]:
    return [part.of(part.mesh.placed(pose)) for part in parts]


def _neighbour(
    top: Top, rng: np.random.Generator, *, side: int
) -> tuple[list[MeshPart], shapely.Polygon]:
    """Draw another table beside the first, across its length, with a gap between them."""
    length, width = rng.uniform((0.9, 0.6), (1.3, 0.8))
    gap = float(rng.uniform(0.15, 0.3))
    reach = float(np.max(side * top.outline[:, 1]))
    pose = Pose2(float(rng.uniform(-0.2, 0.2)), side * (reach + gap + width / 2), 0.0)
    parts = plain_table(length, width, top.height + float(rng.uniform(-0.04, 0.04)), rng)
    x, y = length / 2, width / 2
    return _moved(parts, pose), shapely.Polygon(pose.apply([[-x, -y], [x, -y], [x, y], [-x, y]]))


def _room(
    scenario: Scenario, top: Top, driven: shapely.Polygon, pose: Pose2, rng: np.random.Generator
) -> tuple[Floats, Pose2]:
    """Draw the room: (xmin, ymin, xmax, ymax) in its own frame, and that frame in the map."""
    around = scenario.surroundings
    turn = 0.0 if around.against_wall else float(rng.uniform(-np.pi / 4, np.pi / 4))
    frame = Pose2(pose.x, pose.y, pose.yaw + turn)
    outline = (frame.inverse() @ pose).apply(np.asarray(driven.exterior.coords))
    margins = around.margin + rng.uniform(0.0, 1.2, 4)
    if around.room == "hall":
        margins = rng.uniform(6.0, 8.0, 4)
    if around.room == "corridor":
        margins[[0, 2]] = 30.0
    bounds = np.concatenate([outline.min(axis=0) - margins[:2], outline.max(axis=0) + margins[2:]])
    if around.against_wall:
        bounds[3] = float(top.outline[:, 1].max()) + rng.uniform(0.005, 0.03)
    return bounds, frame


def _walls(
    scenario: Scenario,
    room: Floats,
    frame: Pose2,
    waves: Waves | None,
    rng: np.random.Generator,
) -> list[MeshPart]:
    xmin, ymin, xmax, ymax = (float(value) for value in room)
    corners = np.array([[xmin, ymin], [xmax, ymin], [xmax, ymax], [xmin, ymax]])
    beyond = np.array([[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]])
    outline = corners + beyond
    floor = prism(outline, -0.1, 0.0).placed(frame)
    if waves:
        floor = wavy_floor(waves, outline[0], outline[2], frame)
    parts: list[MeshPart] = []
    glass_side = int(rng.integers(4)) if scenario.surroundings.glass else -1
    if scenario.surroundings.against_wall and glass_side == 2:
        glass_side = 0
    for side in range(4):
        ends = corners[side], corners[(side + 1) % 4]
        length = float(np.linalg.norm(ends[1] - ends[0]))
        along = (ends[1] - ends[0]) / length
        out = np.array([along[1], -along[0]])
        middle = (ends[0] + ends[1]) / 2
        yaw = float(np.arctan2(along[1], along[0]))
        outwards = 2.5 if side == glass_side else 0.0
        wall = at((middle + out * (0.05 + outwards)), yaw)
        wide = box(length + (8.0 if outwards else 0.2), 0.1, 0.0, _WALL_HEIGHT)
        parts.append(MeshPart(wide.placed(wall), (0.85, 0.84, 0.8)))
        if outwards:
            pane = at((middle + out * 0.005), yaw)
            parts.append(
                MeshPart(
                    box(length, 0.01, 0.0, _WALL_HEIGHT).placed(pane), (0.7, 0.8, 0.8), glass=True
                )
            )
        elif scenario.surroundings.room == "furnished":
            skirting = at((middle - out * 0.0075), yaw)
            parts.append(MeshPart(box(length, 0.015, 0.0, 0.08).placed(skirting), (0.5, 0.4, 0.3)))
            pillar = at((middle + along * length * rng.uniform(-0.35, 0.35) - out * 0.08), yaw)
            against = scenario.surroundings.against_wall and side == 2
            if not against:
                size = float(rng.uniform(0.2, 0.45))
                parts.append(
                    MeshPart(box(size, 0.16, 0.0, _WALL_HEIGHT).placed(pillar), (0.8, 0.78, 0.74))
                )
    return [MeshPart(floor, (0.62, 0.6, 0.56)), *_moved(parts, frame)]


def _along_walls(
    scenario: Scenario,
    room: Floats,
    frame: Pose2,
    free: shapely.Polygon,
    rng: np.random.Generator,
) -> list[MeshPart]:
    """Put cupboards, shelves and couches against the walls, clear of the robot's path."""
    xmin, ymin, xmax, ymax = (float(value) for value in room)
    taken = [free]
    parts: list[MeshPart] = []
    around = scenario.surroundings
    pieces = ["couch"] * around.couches
    pieces += ["cabinet"] * (around.cabinets if around.room == "furnished" else 0)
    for piece in pieces:
        length, depth, height = rng.uniform((0.5, 0.25, 0.5), (1.3, 0.5, 2.0))
        if piece == "couch":
            length, depth = float(rng.uniform(1.5, 2.1)), 0.82
        built = (
            couch_parts(length, rng) if piece == "couch" else cabinet(length, depth, height, rng)
        )
        for _ in range(25):
            side = int(rng.integers(3 if around.against_wall else 4))
            fraction = float(rng.uniform(0.1, 0.9))
            off = depth / 2 + 0.02
            x, y = xmin + fraction * (xmax - xmin), ymin + fraction * (ymax - ymin)
            local = (
                Pose2(x, ymin + off, np.pi),
                Pose2(xmax - off, y, -np.pi / 2),
                Pose2(xmin + off, y, np.pi / 2),
                Pose2(x, ymax - off, 0.0),
            )[side]
            pose = frame @ local
            a, b = length / 2, depth / 2
            footprint = shapely.Polygon(pose.apply([[-a, -b], [a, -b], [a, b], [-a, b]]))
            if not any(footprint.intersects(other) for other in taken):
                taken.append(footprint.buffer(0.1))
                parts += _moved(built, pose)
                break
    return parts


def _moved_furniture(
    count: int, driven: shapely.Polygon, rng: np.random.Generator
) -> tuple[tuple[MeshPart, ...], tuple[MeshPart, ...]]:
    before: list[MeshPart] = []
    after: list[MeshPart] = []
    ring = driven.buffer(0.65).exterior
    for _ in range(count):
        along = float(rng.uniform(0, ring.length))
        length, depth, height = rng.uniform((0.3, 0.3, 0.4), (0.6, 0.45, 1.0))
        piece = [MeshPart(box(length, depth, 0.0, height), (0.5, 0.42, 0.3))]
        for parts, shift in ((before, 0.0), (after, float(rng.uniform(0.25, 0.8)))):
            place = ring.interpolate((along + shift) % ring.length).coords[0]
            parts += _moved(piece, at(place, float(rng.uniform(0, np.pi))))
    return tuple(before), tuple(after)


def _person(driven: shapely.Polygon, rng: np.random.Generator) -> Person:
    """Draw somebody who walks past the robot's path, outside of it."""
    ring = driven.buffer(float(rng.uniform(0.45, 0.7))).exterior
    hull = driven.centroid
    along = float(rng.uniform(0, ring.length))
    place = np.array(ring.interpolate(along).coords[0])
    out = place - np.array(hull.coords[0])
    out /= np.linalg.norm(out)
    tangent = np.array([-out[1], out[0]])
    reach = float(rng.uniform(1.0, 1.8))
    return Person(
        place - reach * tangent,
        place + reach * tangent,
        float(rng.uniform(0.5, 1.0)),
        float(rng.uniform(0, 2)),
    )
