"""What the surface stage returns: the chosen top, its sides, and what it was chosen from."""

from __future__ import annotations

from dataclasses import dataclass

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats, Pose2


@dataclass(frozen=True)
class Figure:
    """A value with its standard deviation (None: nothing stands behind one).

    ``status`` is ``measured``, ``inferred`` (seen at one end, or by symmetry) or ``unseen`` (then
    the value is a bound). ``budget`` are the parts of the variance by cause (see
    `tablemap.stages.surface.budget`); their sum is sigma squared.
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
    """A fitted candidate shape, chosen or not. ``outline`` (n, 2) in the map, counter-clockwise.

    ``cost`` is the choice's criterion (lower is better), ``score`` its posterior weight among all;
    ``residuals`` are metres along the normal at the edge points that it was fitted to.
    """

    shape: str
    pose: Pose2
    dimensions: dict[str, Figure]
    outline: Floats
    cost: float
    score: float
    inlier_fraction: float
    residuals: Floats
    corner_radius: Figure | None = None


@dataclass(frozen=True, eq=False)
class Surface:
    """The chosen top. Conventions of shape, pose, dimensions and outline are table.json's.

    ``covariance`` (3, 3) of the pose is in the map. ``map_from_base`` are the snapshots' poses with
    the fit's nuisances applied, by snapshot index. ``points`` (n, 2) are the edge points in the map
    that the fit used, ``residuals`` (n,) theirs. ``beside`` (n, 2), in the map, is what touches the
    table at its height and is no part of it.
    """

    shape: str
    pose: Pose2
    covariance: Floats
    height: Figure
    thickness: Figure | None
    dimensions: dict[str, Figure]
    corner_radius: Figure | None
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
