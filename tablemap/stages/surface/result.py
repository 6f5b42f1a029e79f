"""The result of the surface stage: the chosen top, its sides, and all candidates."""

from __future__ import annotations

from dataclasses import dataclass

import shapely

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats, Pose2
from tablemap.stages.surface.residuals import State

_NEARLY = 0.002  # metres: legs found anew under a top that moved by so much move by micrometres


@dataclass(frozen=True)
class FittedFigure:
    """A value with its standard deviation (None: no data supports one).

    - ``value``, ``sigma``: metres, or radians of an angle
    - ``status``: ``measured``; ``inferred``: seen at one end, or by symmetry; ``unseen``: the value
      is a bound
    - ``budget``: the parts of the variance by cause (`stages.surface.budget`); their sum is
      sigma squared
    """

    value: float
    sigma: float | None
    status: str = "measured"
    budget: dict[str, float] | None = None


@dataclass(frozen=True, eq=False)
class SurfaceEdge:
    """One side of the outline: ``points`` (n, 2) in the map, two for a straight side."""

    points: Floats
    status: str
    sigma: float | None
    seen_fraction: float


@dataclass(frozen=True, eq=False)
class Primitive:
    """A fitted candidate shape, chosen or not.

    outline: (n, 2), metres in the map, counter-clockwise
    cost: the criterion of the choice, lower is better
    score: posterior weight among all candidates
    residuals: metres along the normal, at the edge points of the fit
    """

    shape: str
    pose: Pose2
    dimensions: dict[str, FittedFigure]
    outline: Floats
    cost: float
    score: float
    inlier_fraction: float
    residuals: Floats
    corner_radius: FittedFigure | None = None


@dataclass(frozen=True, eq=False)
class Surface:
    """The chosen top; shape, pose, dimensions and outline follow the conventions of table.json.

    covariance: (3, 3), of the pose x, y, yaw in the map
    relative_covariance: (3, 3), of the same against the poses of the snapshots
    map_from_base: poses of the snapshots with the fit's nuisances applied, by snapshot index
    points: (n, 2), metres in the map, the edge points that the fit used
    residuals: (n,), metres, of these points
    beside: (n, 2), metres in the map, outline of another surface that touches the table at its
        height
    states: of the fitted shapes, for a fit with other priors to start from
    """

    shape: str
    pose: Pose2
    covariance: Floats
    relative_covariance: Floats
    height: FittedFigure
    thickness: FittedFigure | None
    dimensions: dict[str, FittedFigure]
    corner_radius: FittedFigure | None
    outline: Floats
    edges: tuple[SurfaceEdge, ...]
    score: float
    candidates: tuple[Primitive, ...]
    map_from_base: dict[int, Pose2]
    points: Floats
    residuals: Floats
    hull: Floats
    warnings: tuple[ProcessWarning, ...]
    beside: Floats | None = None
    states: tuple[State, ...] = ()

    def is_nearly(self, other: Surface) -> bool:
        """Tell whether another fit gave the same top: its shape, and its place to two millimetres.

        What stands under the one stands under the other then.
        """
        rings = shapely.LinearRing(self.outline), shapely.LinearRing(other.outline)
        raised = abs(self.height.value - other.height.value)
        moved = max(shapely.hausdorff_distance(*rings), raised)
        return self.shape == other.shape and moved < _NEARLY
