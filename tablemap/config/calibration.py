"""Settings: the depth camera's tilt, scale and bend, from floor and top."""

from typing import Annotated

from msgspec import Meta

from tablemap.config.section import Section


class CalibrationConfig(Section, frozen=True):
    """The depth camera's tilt, scale and bend, from floor and top."""

    least_level: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; a floor further than this from z = 0 counts as the zero of "
            "heights, where the depth's scale would be implausible otherwise. Higher: the depth's "
            "scale is corrected instead of a raised floor found",
        ),
    ] = 0.02
    held_roll_deg: Annotated[
        float,
        Meta(
            gt=0,
            description="degrees; where the roll of the images scatters by more (standard "
            "deviation), a hand held the camera. Higher: such a camera passes for one on a robot, "
            "and its recorded height is trusted",
        ),
    ] = 2.0
    floor_band: Annotated[
        float,
        Meta(
            gt=0,
            description="metres above and below z = 0, under the robot, in which the floor is "
            "searched. Higher: larger errors of the frames are corrected, and low things pass for "
            "floor",
        ),
    ] = 0.05
    floor_slope: Annotated[
        float,
        Meta(
            ge=0,
            description="metres by which the band grows per metre of distance. Higher: as for "
            "`floor_band`",
        ),
    ] = 0.03
    least_floor_pixels: Annotated[
        int,
        Meta(
            ge=10,
            description="pixels of floor in all views together; with fewer there is no "
            "calibration. Higher: the camera is more often left as recorded",
        ),
    ] = 3000
    plausible_tilt_deg: Annotated[
        float,
        Meta(
            gt=0,
            description="degrees; a larger correction of roll or pitch is implausible. Higher: "
            "larger corrections pass without a warning",
        ),
    ] = 2.0
    plausible_scale: Annotated[
        float,
        Meta(
            gt=0,
            description="share of a depth; a larger correction of the depth's scale is "
            "implausible, and floors at other heights are tried. Higher: larger corrections pass "
            "without a warning",
        ),
    ] = 0.025
