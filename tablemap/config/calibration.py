"""Settings: camera tilt and scale from the floor; the sigmas are what is believed beforehand."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class CalibrationConfig(Section):
    """Camera tilt and scale from the floor; the sigmas are what is believed before it is seen."""

    least_level: float = Field(
        default=0.02,
        gt=0,
        description="metres that the floor lies off z = 0, where else the scale is implausible",
    )
    held_roll_deg: float = Field(
        default=2.0, gt=0, description="image roll that varies by more tells a camera held by hand"
    )
    view_scatter: float = Field(
        default=0.012, gt=0, description="metres between views' floors that call for a fit per view"
    )
    floor_band: float = Field(
        default=0.05, gt=0, description="metres round z = 0 to search, at the base"
    )
    floor_slope: float = Field(default=0.03, ge=0, description="more of it per metre of distance")
    least_floor_pixels: int = Field(default=3000, ge=10, description="in all views together")
    focal_tilts: int = Field(
        default=10, ge=2, description="fewest different tilts that show a focal length"
    )
    focal_significance: float = Field(
        default=4.0, gt=0, description="sigmas from which on a focal length is corrected"
    )
    plausible_focal: float = Field(default=0.1, gt=0, description="largest focal correction")
    plausible_tilt_deg: float = Field(default=2.0, gt=0)
    plausible_scale: float = Field(default=0.025, gt=0)
