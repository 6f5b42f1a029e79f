"""What the outline stage hands on."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.stages.calibration import TopBelief


class EdgeKind(IntEnum):
    """What ends the seen top at an edge point."""

    TABLE = 0  # something lower begins: the top's own edge
    BORDER = 1  # the image ends
    OCCLUDED = 2  # something in front
    MISSING = 3  # no depth
    BENT = 4  # nothing: the depth bends away from the plane of the top, without a step


@dataclass(frozen=True, eq=False)
class ViewEdges:
    """One view's edge points, in that snapshot's base frame, on the top's plane.

    ``points`` (n, 2) metres; ``normals`` (n, 2) outward units; ``sigma`` (n,) metres along the
    normal; ``kind`` (n,) uint8 of `EdgeKind`; ``is_near`` (n,) bool: the side face is towards the
    camera; ``pixels`` (n, 2) float column, row. ``camera_xy`` (2,) is the camera's place in the
    base, ``drop`` how far it is above the top (metres), ``axis`` (3,) its optical axis: a camera
    that errs moves a point by them. ``scale_sigma`` is how well, as a share of it, the view knows
    its drop beside what all views share. ``top`` (m, 2) and ``free`` (k, 2) are thinned points of
    the plane that this view saw as top, and saw through.

    Neighbouring points share pixels and a view's systematic error, so ``n`` of them are worth about
    ``n / kappa`` independent ones: kappa is 4 to 12 at the default thinning.
    """

    index: int
    points: Floats
    normals: Floats
    sigma: Floats
    kind: NDArray[np.uint8]
    is_near: NDArray[np.bool_]
    pixels: Floats
    camera_xy: Floats
    drop: float
    axis: Floats
    top: Floats
    free: Floats
    scale_sigma: float = 0.0

    def only(self, kept: NDArray[np.bool_]) -> ViewEdges:
        """Return this view with those of its edge points (n,) alone."""
        return replace(
            self,
            points=self.points[kept],
            normals=self.normals[kept],
            sigma=self.sigma[kept],
            kind=self.kind[kept],
            is_near=self.is_near[kept],
            pixels=self.pixels[kept],
        )


@dataclass(frozen=True, eq=False)
class Outline:
    """All views' edges; the top's height above the floor, its thickness where a face shows it.

    ``rim`` is how far the side face lies outside the line where near edges were first placed: near
    nought at a sharp edge, millimetres at a bevelled or rounded one (metres; None: no face seen).
    Near edges are at the face; far ones end where the flat top does, somewhere within.
    ``camera`` is what the calibration leaves open (None: no calibration given), ``turns`` by view
    how far its head was turned, radians.
    ``beside`` (n, 2) in the map is the outline of what touches the table at its height and was
    taken off, None where nothing does.
    """

    views: tuple[ViewEdges, ...]
    height: float
    height_sigma: float
    height_by_view: dict[int, float]
    thickness: float | None
    thickness_sigma: float | None
    warnings: tuple[ProcessWarning, ...]
    rim: float | None = None
    rim_sigma: float | None = None
    camera: TopBelief | None = None
    turns: dict[int, float] = field(default_factory=dict)
    beside: Floats | None = None

    @property
    def is_dull(self) -> bool:
        """Whether the rim is bevelled or rounded, beyond doubt."""
        if self.rim is None or self.rim_sigma is None:
            return False
        return self.rim > 3 * self.rim_sigma
