"""The result of segmentation: labels, candidate tables, and the chosen one."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.stages.calibration import SeenTop


class Label(IntEnum):
    """The thing that a pixel shows, relative to the chosen table's top."""

    UNKNOWN = 0  # no depth
    FLOOR = 1  # on the floor; otherwise like BEHIND
    TOP = 2  # within the tolerance of the top's plane, and part of this top
    ON_TOP = 3  # part of a thing that stands on the top
    BEHIND = 4  # the ray passed the top's plane: there is no top where it crossed
    FRONT = 5  # above the plane and not on the top: occludes
    OTHER_TOP = 6  # another surface at about the same height


@dataclass(frozen=True, eq=False)
class ViewSegmentation:
    """The labels of one view, and the view's own height of the top.

    - ``labels``: (height, width) uint8 of `Label`
    - ``tolerance``: (height, width) float32, metres: a pixel within this vertical distance of the
      top's plane counts as in it; NaN without depth
    """

    index: int
    labels: NDArray[np.uint8]
    sees_table: bool
    reason: str | None
    height: float | None
    top_pixels: int
    tolerance: NDArray[np.float32] | None = None


@dataclass(frozen=True, eq=False)
class TableCandidate:
    """A horizontal surface that could be the table, placed in the map by the localisation.

    - ``views``: snapshot indices
    - ``spread``: from 0 to 1, how far round the surface the views stand
    - ``hull``: (n, 2) metres in the map, counter-clockwise
    - ``reason``: the reasons against it
    - ``is_closed``: whether a front closes the space under it, as of a box or a couch
    - ``rise``: metres from it up to the lowest thing that lies on it; None if nothing was seen
    """

    x: float
    y: float
    height: float
    area: float
    views: tuple[int, ...]
    spread: float
    weight: float
    hull: Floats
    chosen: bool
    reason: str | None
    is_closed: bool
    rise: float | None = None


@dataclass(frozen=True, eq=False)
class TablesFound:
    """Event: the surfaces that could be the table, before one is chosen; the best comes first."""

    candidates: tuple[TableCandidate, ...]


@dataclass(frozen=True, eq=False)
class TableRefused:
    """Event: a surface gave no table; ``views`` are labelled as if its top were level."""

    candidate: TableCandidate
    views: tuple[ViewSegmentation, ...]


@dataclass(frozen=True, eq=False)
class Segmentation:
    """The chosen table, its joint ``height`` above the floor (metres), and every view's labels.

    ``height_apart`` is how far off the height is in many other views, metres; 0 if in few.
    """

    views: tuple[ViewSegmentation, ...]
    height: float
    height_sigma: float
    candidates: tuple[TableCandidate, ...]
    warnings: tuple[ProcessWarning, ...]
    height_apart: float = 0.0

    @property
    def used(self) -> tuple[int, ...]:
        """Indices of the snapshots that see the table."""
        return tuple(view.index for view in self.views if view.sees_table)

    def top(self) -> SeenTop:
        """Return the pixels of the top in every view that sees the table."""
        masks = {view.index: view.labels == Label.TOP for view in self.views if view.sees_table}
        return SeenTop(self.height, masks)
