"""The records of all shapes; all code reads the facts about a shape from its record.

A new shape needs its record here and its fit in `tablemap.stages.surface.shapes`. To be simulated,
it also needs its outline in `tablemap.simulation.shapes`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from tablemap.errors import TablemapError


@dataclass(frozen=True, kw_only=True)
class ShapeRecord:
    """One shape, as in ``table.json``.

    name: its name in every file.
    adjective: for people, such as in "a round table".
    lengths: names of its lengths, metres, the longest first. The first is along x of the shape's
        own frame, the second across. Empty: only its outline gives its size.
    angle: name of the angle from the first length to the second, radians, counter-clockwise. None:
        a right angle.
    symmetry: the smallest turn that maps the shape onto itself, radians. 0: every turn. None: it
        depends on the outline.
    is_mirrored: whether mirroring at the axes of its own frame maps it onto itself; True also for
        shapes that only an outline gives.
    corners: number of corners. 0: its outline is a curve. None: it depends on the outline.
    is_elliptic: whether its lengths are the axes of an ellipse; a circle has one.
    broken_symmetries: number of equal lengths and right angles that it lacks.
    is_section: whether a leg's cross-section may have this name.
    """

    name: str
    adjective: str
    lengths: tuple[str, ...] = ()
    angle: str | None = None
    symmetry: float | None = None
    is_mirrored: bool = True
    corners: int | None = None
    is_elliptic: bool = False
    broken_symmetries: int = 2
    is_section: bool = False

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Names of its lengths and of its angle."""
        return self.lengths if self.angle is None else (*self.lengths, self.angle)

    @property
    def yaw_period(self) -> float:
        """The yaw is in [0, period), radians; with a period of 0 it is always 0.

        If the symmetry depends on the outline, the yaw is the axis of the longest side.
        """
        return math.pi if self.symmetry is None else self.symmetry

    @property
    def is_box(self) -> bool:
        """Whether its lengths are the sides of a rectangle; a square has one."""
        return self.corners == 4 and self.angle is None

    @property
    def is_round(self) -> bool:
        """Whether its outline is a curve."""
        return self.corners == 0

    @property
    def is_quadrilateral(self) -> bool:
        """Whether it has four corners."""
        return self.corners == 4

    def extents(self, sizes: Mapping[str, float]) -> tuple[float, float] | None:
        """Return its first and its last length, metres; None if ``sizes`` lack one."""
        if not self.lengths or not set(self.lengths) <= sizes.keys():
            return None
        return sizes[self.lengths[0]], sizes[self.lengths[-1]]


CIRCLE = ShapeRecord(
    name="circle",
    adjective="round",
    lengths=("diameter",),
    symmetry=0.0,
    corners=0,
    is_elliptic=True,
    broken_symmetries=0,
    is_section=True,
)
ELLIPSE = ShapeRecord(
    name="ellipse",
    adjective="elliptical",
    lengths=("major", "minor"),
    symmetry=math.pi,
    corners=0,
    is_elliptic=True,
    broken_symmetries=1,
)
RECTANGLE = ShapeRecord(
    name="rectangle",
    adjective="rectangular",
    lengths=("length", "width"),
    symmetry=math.pi,
    corners=4,
    broken_symmetries=1,
    is_section=True,
)
SQUARE = ShapeRecord(
    name="square",
    adjective="square",
    lengths=("side",),
    symmetry=math.pi / 2,
    corners=4,
    broken_symmetries=0,
)
PARALLELOGRAM = ShapeRecord(
    name="parallelogram",
    adjective="slanted",
    lengths=("length", "width"),
    angle="angle",
    symmetry=math.pi,
    is_mirrored=False,
    corners=4,
)
STADIUM = ShapeRecord(
    name="stadium",
    adjective="oblong",
    lengths=("length", "width"),
    symmetry=math.pi,
    corners=0,
    broken_symmetries=1,
)
"""A rectangle with half circles for its ends; its length is from end to end."""
POLYGON = ShapeRecord(name="polygon", adjective="angular")
MESH = ShapeRecord(name="mesh", adjective="irregular")
"""The hull of the seen top, if no primitive fits."""

SHAPES: dict[str, ShapeRecord] = {
    record.name: record
    for record in (CIRCLE, ELLIPSE, RECTANGLE, SQUARE, PARALLELOGRAM, STADIUM, POLYGON, MESH)
}
"""Every shape by its name, in the order in which they are listed."""


CORNER_RADIUS = "corner_radius"
"""The name of a figure that every shape with corners may have beside its dimensions."""

DIMENSIONS = "figures by name, lengths in metres and angles in radians; " + "; ".join(
    f"{record.name}: {', '.join(record.dimensions) or 'none'}" for record in SHAPES.values()
)
"""The names of each shape's dimensions, for the schemas."""


def shape_named(name: str) -> ShapeRecord:
    """Return the shape of a name. Raises `TablemapError` if there is none."""
    if name not in SHAPES:
        raise TablemapError(f"expected a shape ({', '.join(SHAPES)}), found {name!r}.")
    return SHAPES[name]


def is_angle(name: str) -> bool:
    """Say whether a dimension of this name is an angle; all others are lengths."""
    return any(name == record.angle for record in SHAPES.values())
