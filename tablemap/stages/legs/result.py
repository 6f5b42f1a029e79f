"""What the search for legs returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.model import Status
from tablemap.stages.surface import Figure

SeenBy = Literal["laser", "depth", "nothing"]
"""What a leg's place rests on."""


@dataclass(frozen=True, eq=False)
class Leg:
    """One leg.

    - ``shape``: ``circle`` (diameter) or ``rectangle`` (length, width)
    - ``x``, ``y``, ``yaw``: metres and radians in the map; the yaw is 0 for a circle, in [0, pi/2)
      where length and width are one, else in [0, pi)
    - ``position_sigma``: metres, a standard deviation per axis
    - ``points``: (n, 2) metres in the map, the evidence
    - ``views``: how many stops and drives saw it
    - ``seen_by``: ``nothing`` where it is inferred
    - ``scale_sigma``: metres, the part of ``position_sigma`` that rests on what is assumed of the
      laser's scale
    """

    shape: str
    x: float
    y: float
    yaw: float
    status: Status
    position_sigma: float | None
    dimensions: dict[str, Figure]
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
    """The legs, what was set aside, and the thinned evidence (n, 2) in the map.

    ``beam_half_width`` (radians) and ``range_bias`` (metres) are what the fit found of the laser;
    None where no laser was used.
    """

    legs: tuple[Leg, ...]
    rejected: tuple[RejectedCluster, ...]
    evidence: Floats
    warnings: tuple[ProcessWarning, ...]
    beam_half_width: float | None = None
    range_bias: float | None = None
