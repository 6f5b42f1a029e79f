"""The result of the outline stage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from tablemap.errors import ProcessWarning
from tablemap.geometry import Bools, Floats, Pose2
from tablemap.stages.calibration import FloorStep, TopBelief


class EdgeKind(IntEnum):
    """The reason why the seen top ends at an edge point."""

    TABLE = 0  # a lower surface begins: the top's own edge
    BORDER = 1  # the image ends
    OCCLUDED = 2  # something in front
    MISSING = 3  # no depth
    BENT = 4  # no edge: the depth bends away from the plane of the top, without a step


@dataclass(frozen=True, eq=False)
class ViewEdges:
    """One view's edge points on the top's plane, in the base of that snapshot.

    - ``points``: (n, 2) metres
    - ``normals``: (n, 2) outward unit vectors
    - ``sigma``: (n,) metres along the normal
    - ``kind``: (n,) uint8 of `EdgeKind`
    - ``is_near``: (n,) bool, whether the side face is towards the camera
    - ``widening``: (n,) metres outward by which a point moves if depth makes the top a pixel wider;
      0 where the side face separates it from the background
    - ``hole``: (n,) metres of missing depth from the end outward to a lower surface; NaN where that
      is not known
    - ``metres_per_px``: (n,) metres along the normal
    - ``pixels``: (n, 2) float, column and row
    - ``camera_xy``: (2,) metres, the camera's place in the base
    - ``drop``: metres, the camera's height above the top
    - ``axis``: (3,), the optical axis in the base
    - ``scale_sigma``: standard deviation of the view's own error of the drop, as a share of it
    - ``top``, ``free``: (m, 2) and (k, 2) metres, thinned points of the plane that this view saw as
      top, and saw through

    Neighbouring points share pixels and the view's systematic error. So ``n`` points count as about
    ``n / kappa`` independent ones; kappa is 4 to 12 at the default thinning.
    """

    index: int
    points: Floats
    normals: Floats
    sigma: Floats
    kind: NDArray[np.uint8]
    is_near: Bools
    widening: Floats
    hole: Floats
    metres_per_px: Floats
    pixels: Floats
    camera_xy: Floats
    drop: float
    axis: Floats
    top: Floats
    free: Floats
    scale_sigma: float = 0.0

    def only(self, kept: Bools) -> ViewEdges:
        """Return this view with only the ``kept`` (n,) edge points."""
        return replace(
            self,
            points=self.points[kept],
            normals=self.normals[kept],
            sigma=self.sigma[kept],
            kind=self.kind[kept],
            is_near=self.is_near[kept],
            widening=self.widening[kept],
            hole=self.hole[kept],
            metres_per_px=self.metres_per_px[kept],
            pixels=self.pixels[kept],
        )


@dataclass(frozen=True, eq=False)
class Outline:
    """The edges of all views, and the top's height and thickness.

    Near edges lie at the side face. Far edges lie where the flat top ends: at a bevelled or rounded
    rim this is inside of the face.

    - ``height``: metres above the floor
    - ``height_by_view``: metres above the floor, as each view has it: its camera may sit higher
      or lower than it is believed to
    - ``thickness``: metres, None if no side face shows it
    - ``rim``: metres from the line where near edges were first placed outward to the side face:
      nearly 0 at a sharp edge, millimetres at a bevelled or rounded one; None if no face was seen
    - ``camera``: the remaining uncertainty of the camera after the calibration, None without one
    - ``turns``: radians that the head was turned, by view
    - ``beside``: (n, 2) metres in the map, outline of another surface that touches the table at its
      height and was cut off, None without one
    - ``floor_step``: a rug or a platform under the table; the height is uncertain by its thickness
    - ``thickness_per_px``: metres that the thickness grows if depth widens what stands before a
      background by a pixel
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
    floor_step: FloorStep | None = None
    thickness_per_px: float = 0.0

    def top_in(self, poses: Mapping[int, Pose2]) -> Floats:
        """Return places (n, 2) of the top in the map, from the views whose poses are given."""
        seen = [poses[view.index].apply(view.top) for view in self.views if view.index in poses]
        return np.concatenate([np.empty((0, 2)), *seen])

    def on(self, step: FloorStep | None) -> Outline:
        """Return this outline with what is known of the floor about the table."""
        if step is None:
            return self
        return replace(self, floor_step=step, warnings=(*self.warnings, step.warning()))

    @property
    def is_dull(self) -> bool:
        """Whether the rim is clearly bevelled or rounded."""
        if self.rim is None or self.rim_sigma is None:
            return False
        return self.rim > 3 * self.rim_sigma
