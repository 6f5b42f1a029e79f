"""What the comparison of camera and laser returns."""

from __future__ import annotations

from dataclasses import dataclass

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.stages.surface import Mounting


@dataclass(frozen=True, eq=False)
class Estimate:
    """The offset from one kind of evidence alone.

    - ``at_table``: (2,) metres, forward and leftward of the base
    - ``sigma``: (2,) metres, its standard deviations
    """

    at_table: Floats
    sigma: Floats


@dataclass(frozen=True, eq=False)
class CrossCheck:
    """The offset of the camera from its place by the laser and the recorded frames.

    - ``offset``: (3,) x, y (metres) and yaw of the camera in the base, if the laser is right; an
      error of the laser itself shows with the opposite sign
    - ``covariance``: (3, 3) of the offset
    - ``at_table``: (2,) metres, forward and leftward of the base, the effect at the table
    - ``at_table_sigma``: (2,) metres, its standard deviations
    - ``pose_sigma``: metres per axis, uncertainty of the base's place from the offset, since
      nobody knows which of the two sensors is off
    - ``points``, ``views``: how many edge points of how many views were compared
    - ``range_scale``, ``range_scale_sigma``: how much too long the laser's ranges are against the
      camera's, a share (0.001: a millimetre a metre)
    - ``by_edges``, ``by_legs``: the offset from each kind of evidence alone, None without enough
    - ``excess``: at least 1, the ratio of the errors found to the assumed sigmas of mounting and
      scale
    - ``sightings``: how many sightings of legs were compared
    - ``scale_excess``: by what share the laser's ranges are off beyond that estimate's own sigma
    - ``mounting``: what these say of the camera, for the fit of the top

    A value that the views cannot determine is None.
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
    mounting: Mounting | None = None
    scale_excess: float = 0.0

    @property
    def is_found(self) -> bool:
        """Whether camera and laser disagree clearly, by more than the limit."""
        return self.pose_sigma > 0
