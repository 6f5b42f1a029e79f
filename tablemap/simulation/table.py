"""The table that is to be modelled: its parts and the truth about its legs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from tablemap.geometry import Floats, Pose2
from tablemap.model.shapes import RECTANGLE, SQUARE, ShapeRecord, shape_named
from tablemap.simulation.meshes import Mesh, MeshPart, at, box, cylinder, inset, loft, plate, prism
from tablemap.simulation.scenario import LegsSection, Table
from tablemap.simulation.shapes import Top

_APRON_THICKNESS = 0.018
_LEG_COLOUR = (0.35, 0.3, 0.28)


@dataclass(frozen=True, eq=False)
class SimulatedLeg:
    """A leg in the table's frame; ``length`` is a circle's diameter."""

    shape: ShapeRecord
    pose: Pose2
    length: float
    width: float

    def truth(self, map_from_table: Pose2) -> dict[str, object]:
        """Return the truth file's entry: place in the map, yaw in the range of its symmetry."""
        pose = map_from_table @ self.pose
        turn = self.shape.yaw_period
        if self.shape.is_box and self.length == self.width:
            turn = SQUARE.yaw_period
        place = {"x": pose.x, "y": pose.y, "yaw": float(pose.yaw % turn) if turn else 0.0}
        dimensions = dict(zip(self.shape.lengths, (self.length, self.width), strict=False))
        return {"shape": self.shape.name, **place, "dimensions": dimensions}


def draw_legs(
    legs: LegsSection, top: Top, rng: np.random.Generator, *, nominal: bool
) -> list[SimulatedLeg]:
    """Draw where the legs stand, in the table's frame."""
    spread = 0.0 if nominal else legs.inset_spread
    depth = max(legs.inset + spread * float(rng.uniform(-1, 1)), legs.size / 2)
    low, high = top.outline.min(axis=0), top.outline.max(axis=0)
    length, width = (float(value) for value in high - low)
    if legs.layout == "none":
        return []
    if legs.layout == "pedestal":
        return [_leg(legs, Pose2())]
    if legs.layout == "trestle":
        places = [(sx * (length / 2 - depth), sy * 0.3 * width) for sx in (-1, 1) for sy in (-1, 1)]
        return [_leg(legs, Pose2(x, y, 0.0)) for x, y in places]
    if legs.layout == "panels":
        panel = 0.8 * width
        across = (sx * (length / 2 - depth) for sx in (-1, 1))
        return [SimulatedLeg(RECTANGLE, Pose2(x, 0.0, np.pi / 2), panel, legs.size) for x in across]
    if top.corner_radius and legs.layout in ("four", "polygon"):
        depth = max(depth, 0.6 * top.corner_radius)
    if legs.layout == "polygon":
        convex = _convex(top.corners)
        return [_leg(legs, at(place, 0.0)) for place in inset(top.corners, depth)[convex]]
    if len(top.corners) == 4 and legs.layout == "four":
        return [_leg(legs, at(place, 0.0)) for place in inset(top.corners, depth)]
    count = 3 if legs.layout == "three" else 4
    phase = np.pi / count + np.arange(count) * 2 * np.pi / count
    semi = np.array([length, width]) / 2 - depth
    around = semi * np.column_stack([np.cos(phase), np.sin(phase)])
    return [_leg(legs, at(place, 0.0)) for place in around]


def table_parts(table: Table, top: Top, legs: list[SimulatedLeg]) -> list[MeshPart]:
    """Return the table's solids in its own frame, its top first."""
    under = top.height - table.thickness
    slab = plate(top.outline, under, top.height, edge=table.edge, edge_size=table.edge_size)
    if table.cloth:
        slab = _cloth(top, table.cloth)
    parts = [MeshPart(slab, table.colour, table.reflectance, table.gloss, texture=table.texture)]
    if table.apron:
        outer = inset(top.outline, table.apron_inset)
        inner = inset(top.outline, table.apron_inset + _APRON_THICKNESS)
        for i in range(len(outer)):
            j = (i + 1) % len(outer)
            board = prism(
                np.array([outer[i], outer[j], inner[j], inner[i]]), under - table.apron, under
            )
            parts.append(MeshPart(board, table.colour, table.reflectance))
    for leg in legs:
        if leg.shape.is_elliptic:
            solid = cylinder(leg.length, 0.0, under)
        else:
            solid = box(leg.length, leg.width, 0.0, under)
        reflectance = table.legs.reflectance or table.reflectance
        parts.append(MeshPart(solid.placed(leg.pose), _LEG_COLOUR, reflectance))
    span = float(np.ptp(top.outline[:, 1]))
    if table.legs.layout == "pedestal":
        parts.append(MeshPart(cylinder(0.6 * span, 0.0, 0.03), _LEG_COLOUR))
    if table.legs.layout == "trestle":
        for x in sorted({leg.pose.x for leg in legs}):
            for low, high in ((0.0, 0.05), (under - 0.05, under)):
                bar = box(table.legs.size, 0.8 * span, low, high).placed(Pose2(x, 0.0, 0.0))
                parts.append(MeshPart(bar, _LEG_COLOUR))
    return parts


def _leg(legs: LegsSection, pose: Pose2) -> SimulatedLeg:
    section = shape_named(legs.section)
    # A square leg is a rectangle in table.json.
    return SimulatedLeg(section if section.is_section else RECTANGLE, pose, legs.size, legs.size)


def _convex(corners: Floats) -> list[int]:
    before = corners - np.roll(corners, 1, axis=0)
    after = np.roll(corners, -1, axis=0) - corners
    return np.flatnonzero(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] > 0).tolist()


def _cloth(top: Top, drop: float) -> Mesh:
    """Drape a cloth: flat on the top, in folds that widen downwards at the sides."""
    line = shapely.LinearRing(top.outline)
    along = np.arange(0, line.length, 0.02)
    ring = np.array([line.interpolate(distance).coords[0] for distance in along])
    folds = 0.006 * (1 - np.cos(along * 2 * np.pi / (line.length / round(line.length / 0.2))))
    away = ring / np.linalg.norm(ring, axis=1, keepdims=True)
    return loft([ring + away * folds[:, None], ring], [top.height - drop, top.height])
