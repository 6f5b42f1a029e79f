"""What the search for legs returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.model import Status
from tablemap.stages.surface import FittedFigure

SeenBy = Literal["laser", "depth", "nothing"]
"""The sensor that a leg's place comes from."""


@dataclass(frozen=True, eq=False)
class Leg:
    """One leg.

    - ``shape``: ``circle`` (diameter) or ``rectangle`` (length, width)
    - ``x``, ``y``, ``yaw``: metres and radians in the map; the yaw is 0 for a circle, in [0, pi/2)
      if length and width are equal, else in [0, pi)
    - ``position_sigma``: metres, a standard deviation per axis
    - ``points``: (n, 2) metres in the map, the evidence
    - ``views``: how many stops and drives saw it
    - ``seen_by``: the sensor, or ``nothing`` if the leg is inferred
    - ``scale_sigma``: metres, the part of ``position_sigma`` from the assumed error of the laser's
      scale
    """

    shape: str
    x: float
    y: float
    yaw: float
    status: Status
    position_sigma: float | None
    dimensions: dict[str, FittedFigure]
    points: Floats
    views: int
    seen_by: SeenBy = "laser"
    scale_sigma: float = 0.0


@dataclass(frozen=True, eq=False)
class RejectedCluster:
    """A cluster under or near the top that is no leg, and why."""

    x: float
    y: float
    points: Floats
    reason: str


@dataclass(frozen=True, eq=False)
class Legs:
    """The legs and the rejected clusters.

    - ``evidence``: (n, 2) metres in the map, thinned
    - ``beam_half_width``, ``range_bias``: radians and metres, the laser's fitted nuisances; None if
      no laser was used
    """

    legs: tuple[Leg, ...]
    rejected: tuple[RejectedCluster, ...]
    evidence: Floats
    warnings: tuple[ProcessWarning, ...]
    beam_half_width: float | None = None
    range_bias: float | None = None
