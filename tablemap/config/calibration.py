"""Settings: the depth camera's tilt, scale and bend, from floor and top."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class CalibrationConfig(Section):
    """The depth camera's tilt, scale and bend, from floor and top."""

    least_level: float = Field(
        default=0.02,
        gt=0,
        description="metres; a floor further than this from z = 0 counts as the zero of heights, "
        "where the depth's scale would be implausible otherwise. Higher: the depth's scale is "
        "corrected instead of a raised floor found",
    )
    held_roll_deg: float = Field(
        default=2.0,
        gt=0,
        description="degrees; where the roll of the images scatters by more (standard deviation), "
        "a hand held the camera. Higher: such a camera passes for one on a robot, and its "
        "recorded height is trusted",
    )
    floor_band: float = Field(
        default=0.05,
        gt=0,
        description="metres above and below z = 0, under the robot, in which the floor is "
        "searched. Higher: larger errors of the frames are corrected, and low things pass for "
        "floor",
    )
    floor_slope: float = Field(
        default=0.03,
        ge=0,
        description="metres by which the band grows per metre of distance. Higher: as for "
        "`floor_band`",
    )
    least_floor_pixels: int = Field(
        default=3000,
        ge=10,
        description="pixels of floor in all views together; with fewer there is no calibration. "
        "Higher: the camera is more often left as recorded",
    )
    plausible_tilt_deg: float = Field(
        default=2.0,
        gt=0,
        description="degrees; a larger correction of roll or pitch is implausible. Higher: larger "
        "corrections pass without a warning",
    )
    plausible_scale: float = Field(
        default=0.025,
        gt=0,
        description="share of a depth; a larger correction of the depth's scale is implausible, "
        "and floors at other heights are tried. Higher: larger corrections pass without a warning",
    )
