"""Comparisons of camera and laser, as rows of one least-squares problem."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.linalg import block_diag

from tablemap.geometry import Bools, Floats


@dataclass(frozen=True, eq=False)
class Rows:
    """n distances along normals, in the map, with the base placed by the laser.

    - ``arm``, ``ray``: (n, 2) metres in the map's axes, from the base and from the camera to the
      seen point
    - ``normal``: (n, 2) unit vectors
    - ``distance``: (n,) metres along the normal, from the expected place to the place seen by the
      camera
    - ``variance``: (n,) square metres, of the distance
    - ``stretch``: (n, 2) metres, shift of the seen against the expected place by a laser scale of 1
    - ``tilt``: (n, 2) derivatives by the camera's roll and pitch, metres a radian
    - ``bias``: (n, 5) derivatives by the errors that rows share, see `BIASES`
    - ``basis``: (n, k) derivatives by the unknowns of the outline or the legs
    - ``yaw``: (n,) radians, the base's heading
    - ``view``: (n,), the snapshot
    - ``is_leg``: (n,), 1 for legs and 0 for edges of the top
    """

    arm: Floats
    ray: Floats
    normal: Floats
    distance: Floats
    variance: Floats
    stretch: Floats
    tilt: Floats
    bias: Floats
    basis: Floats
    yaw: Floats
    view: Floats
    is_leg: Floats

    def __len__(self) -> int:
        return len(self.distance)

    @property
    def forward(self) -> Floats:
        """The base's axis that points forward, as (n, 2) unit vectors in the map."""
        return np.column_stack([np.cos(self.yaw), np.sin(self.yaw)])

    @property
    def left(self) -> Floats:
        """The base's axis that points to the left, as (n, 2) unit vectors in the map."""
        return np.column_stack([-np.sin(self.yaw), np.cos(self.yaw)])

    def only(self, keep: Bools) -> Rows:
        """Return the rows that ``keep`` (n,) selects."""
        return Rows(**{field.name: getattr(self, field.name)[keep] for field in fields(self)})


BIASES = ("near edges", "far edges", "width of silhouettes", "their middle", "depth of legs")


def bias_row(name: str, slope: Floats) -> Floats:
    """Return derivatives (n, 5) that are zero but for the named bias."""
    columns = np.zeros((len(slope), len(BIASES)))
    columns[:, BIASES.index(name)] = slope
    return columns


def stacked(parts: list[Rows]) -> Rows:
    """Join rows with the same unknowns: the columns of their ``basis`` stay."""
    return Rows(
        **{
            field.name: np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(Rows)
        }
    )


def together(parts: list[Rows]) -> Rows:
    """Join rows with different unknowns: each part gets its own columns of ``basis``."""
    bases = block_diag(*[part.basis for part in parts])
    heights = np.cumsum([len(part) for part in parts])[:-1]
    return stacked(
        [
            replace(part, basis=basis)
            for part, basis in zip(parts, np.split(bases, heights), strict=True)
        ]
    )
