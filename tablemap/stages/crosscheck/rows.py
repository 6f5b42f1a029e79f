"""Comparisons of what the camera sees with where the laser has it, as rows of one problem."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from tablemap.geometry import Floats


@dataclass(frozen=True, eq=False)
class Rows:
    """Distances along normals, n of them, in the map as the laser places the base.

    ``arm`` (n, 2) leads from the base to what was seen, ``ray`` (n, 2) from the camera, both in
    the map's axes. ``distance`` (n,) is along ``normal`` (n, 2) from where it should be to where
    the camera sees it, with ``variance`` (n,). ``stretch`` (n, 2) is how far a laser scale of one
    moves the seen against the expected. ``bias`` (n, 5) are the slopes in the errors that rows
    share (see `BIASES`), ``basis`` (n, k) those in the freedom of what is compared with.
    ``yaw`` and ``view`` (n,) are the base's heading and the snapshot. ``is_leg`` (n,) is 1 for
    legs and 0 for edges of the top.
    """

    arm: Floats
    ray: Floats
    normal: Floats
    distance: Floats
    variance: Floats
    stretch: Floats
    bias: Floats
    basis: Floats
    yaw: Floats
    view: Floats
    is_leg: Floats

    def __len__(self) -> int:
        return len(self.distance)

    def only(self, keep: NDArray[np.bool_]) -> Rows:
        """Return the rows that ``keep`` (n,) selects."""
        return Rows(**{field.name: getattr(self, field.name)[keep] for field in fields(self)})


BIASES = ("near edges", "far edges", "width of silhouettes", "their middle", "depth of legs")


def bias_row(name: str, slope: Floats) -> Floats:
    """Return (n, 5) slopes, all but the named one zero."""
    columns = np.zeros((len(slope), len(BIASES)))
    columns[:, BIASES.index(name)] = slope
    return columns


def stacked(parts: list[Rows]) -> Rows:
    """Join rows of one freedom: their columns are the same unknowns."""
    return Rows(
        **{
            field.name: np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(Rows)
        }
    )


def together(parts: list[Rows]) -> Rows:
    """Join rows whose freedoms are not shared: each keeps columns of its own."""
    bases = block_diag(*[part.basis for part in parts])
    heights = np.cumsum([len(part) for part in parts])[:-1]
    return stacked(
        [
            replace(part, basis=basis)
            for part, basis in zip(parts, np.split(bases, heights), strict=True)
        ]
    )
