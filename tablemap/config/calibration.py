"""Settings: camera tilt and scale from the floor."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class CalibrationConfig(Section):
    """Camera tilt and scale from the floor."""

    least_level: float = Field(
        default=0.02,
        gt=0,
        description="metres that the floor must lie off z = 0, for heights to count from it "
        "where the depth's scale would else be implausible. Higher: a raised "
        "floor is put down to the scale sooner",
    )
    held_roll_deg: float = Field(
        default=2.0,
        gt=0,
        description="degrees; images whose roll scatters by more come from a camera held by "
        "hand. Higher: such a camera is believed its height",
    )
    floor_band: float = Field(
        default=0.05,
        gt=0,
        description="metres round z = 0, below the robot, in which the floor is searched. "
        "Higher: worse frames are mended, and low things pass for floor",
    )
    floor_slope: float = Field(
        default=0.03,
        ge=0,
        description="metres that the band grows by, per metre of distance. Higher: as for "
        "`floor_band`",
    )
    least_floor_pixels: int = Field(
        default=3000,
        ge=10,
        description="pixels of floor in all views together; fewer say nothing. Higher: the "
        "camera is left as recorded sooner",
    )
    plausible_tilt_deg: float = Field(
        default=2.0,
        gt=0,
        description="degrees; a larger roll or pitch is a doubt. Higher: larger tilts pass "
        "without a warning",
    )
    plausible_scale: float = Field(
        default=0.025,
        gt=0,
        description="share of a depth; a larger scale error is a doubt, and other heights of "
        "the floor are tried. Higher: larger errors pass without a warning",
    )
