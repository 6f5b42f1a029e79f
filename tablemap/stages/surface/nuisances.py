"""The joint fit's unknowns beside the shape: errors of the camera and of the views' poses.

Code names a nuisance, and never uses its number: the place in the fit's vectors follows from the
order of the fields.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import ClassVar, Self

import numpy as np

from tablemap.geometry import Floats


@dataclass(frozen=True)
class CommonNuisances:
    """The nuisances that all views share.

    scale: how much farther the top is from the camera than the calibration says, a share
    roll, pitch, yaw: turn of the camera about the axes of the base, or of the head, radians
    focal: how much farther all bearings are from the optical axis, a share
    near_bias: outward bias of near edges, in sigmas of a point
    widening: by how much depth makes the top wider where the background begins, pixels
    shift_x, shift_y: shift of the camera in the base, metres
    set_back: distance of far edges inward from the outline, metres
    slope_x, slope_y: slope of the top in the map
    sag: how much higher the top's middle lies than its rim, metres
    stretch: how much farther the views' poses are from their middle, a share
    """

    scale: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    focal: float = 0.0
    near_bias: float = 0.0
    widening: float = 0.0
    shift_x: float = 0.0
    shift_y: float = 0.0
    set_back: float = 0.0
    slope_x: float = 0.0
    slope_y: float = 0.0
    sag: float = 0.0
    stretch: float = 0.0

    COUNT: ClassVar[int]

    @classmethod
    def unpack(cls, values: Floats) -> Self:
        """Name the values of a vector (COUNT,)."""
        return cls(*(float(value) for value in values))

    def pack(self) -> Floats:
        """Return the vector (COUNT,) in the order of the fields."""
        return np.array([getattr(self, field.name) for field in fields(self)])

    @classmethod
    def place(cls, name: str) -> int:
        """Return the place of a nuisance in the vector."""
        return [field.name for field in fields(cls)].index(name)

    @classmethod
    def stack(cls, **rows: Floats) -> Floats:
        """Stack one row (N,) a nuisance, given by name, to (COUNT, N)."""
        return np.vstack([rows[field.name] for field in fields(cls)])


CommonNuisances.COUNT = len(fields(CommonNuisances))


@dataclass(frozen=True, eq=False)
class ViewCorrections:
    """The nuisances of each of n views, each (n,).

    x, y, yaw: correction of the base's pose, metres and radians
    scale, roll, pitch, pan: errors of the camera in this view, added to the common ones
    """

    x: Floats
    y: Floats
    yaw: Floats
    scale: Floats
    roll: Floats
    pitch: Floats
    pan: Floats

    COUNT: ClassVar[int]

    @classmethod
    def unpack(cls, values: Floats) -> Self:
        """Name the columns of values (n * COUNT,), view by view."""
        return cls(*values.reshape(-1, cls.COUNT).T)

    @property
    def poses(self) -> Floats:
        """The corrections of the poses (n, 3)."""
        return np.column_stack([self.x, self.y, self.yaw])

    @classmethod
    def place(cls, name: str) -> int:
        """Return the place of a correction within one view's corrections."""
        return [field.name for field in fields(cls)].index(name)

    @classmethod
    def stack(cls, **rows: Floats) -> Floats:
        """Stack one row (N,) a correction, given by name, to (COUNT, N)."""
        return np.stack([rows[field.name] for field in fields(cls)])


ViewCorrections.COUNT = len(fields(ViewCorrections))
