"""A table as solid parts in its own frame: every format writes these parts.

The table's frame has its origin on the floor under the top's ``pose``, x along the length and z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tablemap.geometry import Floats, Pose2
    from tablemap.model import TableModel


@dataclass(frozen=True)
class Box:
    """A cuboid about its middle: metres along x, y and z."""

    length: float
    width: float
    height: float


@dataclass(frozen=True)
class Cylinder:
    """An upright cylinder about its middle, metres."""

    radius: float
    height: float


@dataclass(frozen=True, eq=False)
class Prism:
    """An upright prism about its middle; ``ring`` (N, 2) metres, counter-clockwise, not closed."""

    ring: Floats
    height: float


@dataclass(frozen=True, eq=False)
class SolidPart:
    """The top or a leg: ``place`` in the table's frame, ``z`` the height of its middle, metres."""

    name: str
    shape: Box | Cylinder | Prism
    place: Pose2
    z: float

    @property
    def bottom(self) -> float:
        """Height of the lower face above the floor, metres."""
        return self.z - self.shape.height / 2

    def ring(self) -> Floats:
        """Return the outline (N, 2) in the table's frame; round ones within 0.05 mm."""
        from tablemap.export.rings import circle_ring, rectangle_ring

        match self.shape:
            case Box(length, width):
                ring = rectangle_ring(length, width)
            case Cylinder(radius):
                ring = circle_ring(radius)
            case Prism(ring):
                pass
        return self.place.apply(ring)


@dataclass(frozen=True, eq=False)
class Solid:
    """A table's parts, its pose, and the model from which they were made."""

    name: str
    model: TableModel
    map_from_table: Pose2
    height: float
    thickness: float
    top: SolidPart
    legs: tuple[SolidPart, ...]

    @property
    def parts(self) -> tuple[SolidPart, ...]:
        """The top, then the legs."""
        return (self.top, *self.legs)
