"""Settings: camera against laser, by the edges of the top and by the legs."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class CrossCheckConfig(Section):
    """Camera against laser, by the edges of the top and by the legs."""

    threshold: float = Field(
        default=0.005, gt=0, description="an offset at the table from here on is a warning, metres"
    )
    sigmas: float = Field(default=3.0, gt=0, description="standard deviations that it must exceed")
    largest_sigma: float = Field(
        default=0.004, gt=0, description="less certain than this, nothing is said, metres"
    )
    minimum_views: int = Field(default=4, ge=3, description="views that must show edges")
    minimum_points: int = Field(default=20, ge=5, description="edge points of a view")
    points: int = Field(default=150, ge=20, description="most edge points of a view")
    correlation: float = Field(
        default=8.0, ge=1, description="neighbouring edge points that err together, as one"
    )
    reach: float = Field(default=0.06, gt=0, description="edges farther off are no side's, metres")
    offset_sigma: float = Field(default=0.02, gt=0, description="prior of the offset, metres")
    yaw_sigma: float = Field(default=0.01, gt=0, description="prior of the turn, radians")
    minimum_rows: int = Field(
        default=8, ge=3, description="image rows that must show both borders of a leg"
    )
    minimum_sightings: int = Field(default=4, ge=2, description="legs seen in a view, of all views")
