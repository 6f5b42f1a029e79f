"""Settings: which topic and which frame has which role; empty: found by itself."""

import math
from datetime import datetime
from typing import Annotated, Literal

from msgspec import Meta

from tablemap.config.section import Section


def _moment(given: object) -> str:
    """Return a moment as text; TOML may have it as a number or a date, too."""
    text = given.isoformat() if isinstance(given, datetime) else str(given)
    if not text or _is_number(text):
        return text
    try:
        datetime.fromisoformat(text)
    except ValueError:
        expected = "expected seconds, or a date and time such as 2026-11-22T08:59:56"
        raise ValueError(expected) from None
    return text


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


class TopicsConfig(Section, frozen=True):
    """Which topic and which frame has which role; empty: found by itself."""

    depth: Annotated[
        str,
        Meta(
            description="topic of the depth images; empty: found by itself",
        ),
    ] = ""
    calibration: Annotated[
        str,
        Meta(
            description="topic of the depth camera's calibration; empty: found by itself",
        ),
    ] = ""
    colour: Annotated[
        str,
        Meta(
            description="topic of the colour images; empty: found by itself",
        ),
    ] = ""
    laser: Annotated[
        str,
        Meta(
            description="topic of the base's laser scans; empty: found by itself",
        ),
    ] = ""
    depth_unit: Annotated[
        float,
        Meta(
            ge=0,
            description="metres that a depth value of one stands for; 0: from the encoding and "
            "the floor. Higher: all depths are longer",
        ),
    ] = 0.0
    depth_along: Annotated[
        Literal["", "axis", "ray"],
        Meta(
            description="what depth is measured along: the optical axis (axis), or each pixel's "
            "ray (ray); empty: from the floor",
        ),
    ] = ""
    camera_axes: Annotated[
        Literal["", "optical", "body"],
        Meta(
            description="axes of the images' frame: z forward (optical), or x forward (body); "
            "empty: from the floor",
        ),
    ] = ""
    clock_offset: Annotated[
        float,
        Meta(
            description="seconds to add to the stamps of depth and colour; 0: as the log and the "
            "motion show. Higher: images count as taken later",
        ),
    ] = 0.0
    laser_clock_offset: Annotated[
        float,
        Meta(
            description="seconds to add to the laser's stamps; 0: as the log and the motion show. "
            "Higher: scans count as taken later",
        ),
    ] = 0.0
    robot: Annotated[
        str,
        Meta(
            description="namespace or frame prefix of the robot, where there are several; empty: "
            "the camera's robot",
        ),
    ] = ""
    fixed_frame: Annotated[
        str,
        Meta(
            description="TF frame of the model, such as map; empty: found by itself",
        ),
    ] = ""
    odom_frame: Annotated[
        str,
        Meta(
            description="TF frame of the wheel odometry; empty: found by itself",
        ),
    ] = ""
    base_frame: Annotated[
        str,
        Meta(
            description="TF frame of the robot's base; empty: found by itself",
        ),
    ] = ""
    pose: Annotated[
        str,
        Meta(
            description="topic of the localised poses, where TF lacks them; empty: found by itself",
        ),
    ] = ""
    pose_frame: Annotated[
        str,
        Meta(
            description="TF frame whose poses these are; empty: the one that the messages name, "
            "or the base",
        ),
    ] = ""
    extrinsics: Annotated[
        str,
        Meta(
            description="TOML or URDF file with mountings that TF lacks; empty: none",
        ),
    ] = ""
    start: Annotated[
        str,
        Meta(
            description="seconds from the beginning (negative: from the end), or a date; reading "
            "starts there; empty: at the beginning",
            extra={"read": _moment},
        ),
    ] = ""
    end: Annotated[
        str,
        Meta(
            description="seconds from the beginning (negative: from the end), or a date; reading "
            "ends there; empty: at the end",
            extra={"read": _moment},
        ),
    ] = ""
