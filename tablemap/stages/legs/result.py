"""What the search for legs returns."""

from __future__ import annotations

from dataclasses import dataclass

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.stages.surface import Figure


@dataclass(frozen=True, eq=False)
class Leg:
    """One leg: ``shape`` is ``circle`` (diameter) or ``rectangle`` (length, width), in the map.

    ``yaw`` is 0 for a circle, in [0, pi/2) where length and width are one, else in [0, pi).
    ``position_sigma`` is a standard deviation per axis in metres. ``points`` (n, 2) is the
    evidence in the map; ``views`` counts the stops and drives that saw it. ``seen_by`` is
    ``laser``, ``depth``, or ``nothing`` where it is inferred. ``scale_sigma`` (metres) is the part
    of ``position_sigma`` that rests on what is assumed of the laser's scale.
    """

    shape: str
    x: float
    y: float
    yaw: float
    status: str
    position_sigma: float | None
    dimensions: dict[str, Figure]
    points: Floats
    views: int
    seen_by: str = "laser"
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
