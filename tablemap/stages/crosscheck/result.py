"""What the comparison of camera and laser returns."""

from __future__ import annotations

from dataclasses import dataclass

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats


@dataclass(frozen=True, eq=False)
class Estimate:
    """What one kind of evidence says by itself.

    - ``at_table``: (2,) metres, forward and leftward of the base
    - ``sigma``: (2,) metres, its standard deviations
    """

    at_table: Floats
    sigma: Floats


@dataclass(frozen=True, eq=False)
class CrossCheck:
    """How far the camera sits beside where the laser and the recorded frames have it.

    - ``offset``: (3,) x, y (metres) and yaw of the camera in the base, where the laser is taken as
      right; an error of the laser itself shows with the opposite sign
    - ``covariance``: (3, 3) of the offset
    - ``at_table``: (2,) metres, forward and leftward of the base: what all this does at the table
    - ``at_table_sigma``: (2,) metres, its standard deviations
    - ``pose_sigma``: metres per axis, what the offset leaves unknown of where the base was, since
      nobody knows which of the two sensors is off
    - ``points``, ``views``: how many edge points of how many views were compared
    - ``range_scale``, ``range_scale_sigma``: by how much the laser's ranges are too long against
      the camera's (0.001: a millimetre a metre)
    - ``by_edges``, ``by_legs``: what each kind of evidence says by itself, None without enough
    - ``excess``: at least 1, how many times what was found exceeds the assumed spread of mounting
      and scale: that assumption is too good by as much
    - ``sightings``: how many sightings of legs were compared

    What the views cannot tell is None.
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
