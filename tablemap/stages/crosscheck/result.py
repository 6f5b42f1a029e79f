"""What the comparison of camera and laser returns."""

from __future__ import annotations

from dataclasses import dataclass

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats


@dataclass(frozen=True, eq=False)
class Estimate:
    """What one kind of evidence says by itself: ``at_table`` (2,) metres and its sigmas (2,)."""

    at_table: Floats
    sigma: Floats


@dataclass(frozen=True, eq=False)
class CrossCheck:
    """How far the camera sits beside where the laser and the recorded frames have it.

    ``offset`` (3,) is x, y (metres) and yaw of the camera in the base, laser taken as right; what
    is the laser's own error has the opposite sign. ``covariance`` (3, 3) is its. ``range_scale``
    is by how much the laser's ranges are too long against the camera's (0.001: a millimetre a
    metre), with ``range_scale_sigma``. ``at_table`` (2,) is what all this does to the table,
    forward and leftward of the base in metres, with standard deviations ``at_table_sigma`` (2,).
    All are None where the views cannot tell. ``by_edges`` and ``by_legs`` are the two kinds of
    evidence by themselves, None without enough of it.

    ``pose_sigma`` (metres per axis) is what the offset leaves unknown of where the base was: which
    sensor is off is not known. ``excess`` (at least 1) is by how many times what was found exceeds
    the assumed spread of mounting and scale: that assumption is then too good by as much.
    ``points`` edge points of ``views`` views and ``sightings`` of legs were compared.
    """

    offset: Floats | None
    covariance: Floats | None
    at_table: Floats | None
    at_table_sigma: Floats | None
    pose_sigma: float
    points: int
    views: int
    warnings: tuple[ProcessWarning, ...]
    range_scale: float | None = None
    range_scale_sigma: float | None = None
    by_edges: Estimate | None = None
    by_legs: Estimate | None = None
    excess: float = 1.0
    sightings: int = 0

    @property
    def is_found(self) -> bool:
        """Whether camera and laser disagree, beyond doubt and by more than may pass."""
        return bool(self.warnings)
