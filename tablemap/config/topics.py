"""Settings: which topic and which frame has which role; empty: found by itself."""

from __future__ import annotations

import math
from datetime import datetime
from typing import Literal

from pydantic import Field, field_validator

from tablemap.config.section import Section


class TopicsConfig(Section):
    """Which topic and which frame has which role; empty: found by itself."""

    depth: str = Field(
        default="",
        description="topic of the depth images; empty: found by itself",
    )
    calibration: str = Field(
        default="",
        description="topic of the depth camera's calibration; empty: found by itself",
    )
    colour: str = Field(
        default="",
        description="topic of the colour images; empty: found by itself",
    )
    laser: str = Field(
        default="",
        description="topic of the base's laser scans; empty: found by itself",
    )
    depth_unit: float = Field(
        default=0.0,
        ge=0,
        description="metres that a depth value of one stands for; 0: from the encoding and the "
        "floor. Higher: all depths are longer",
    )
    depth_along: Literal["", "axis", "ray"] = Field(
        default="",
        description="what depth is measured along: the optical axis (axis), or each pixel's ray "
        "(ray); empty: from the floor",
    )
    camera_axes: Literal["", "optical", "body"] = Field(
        default="",
        description="axes of the images' frame: z forward (optical), or x forward (body); empty: "
        "from the floor",
    )
    clock_offset: float = Field(
        default=0.0,
        description="seconds to add to the stamps of depth and colour; 0: as the log and the "
        "motion show. Higher: images count as taken later",
    )
    laser_clock_offset: float = Field(
        default=0.0,
        description="seconds to add to the laser's stamps; 0: as the log and the motion show. "
        "Higher: scans count as taken later",
    )
    robot: str = Field(
        default="",
        description="namespace or frame prefix of the robot, where there are several; empty: the "
        "camera's robot",
    )
    fixed_frame: str = Field(
        default="",
        description="TF frame of the model, such as map; empty: found by itself",
    )
    odom_frame: str = Field(
        default="",
        description="TF frame of the wheel odometry; empty: found by itself",
    )
    base_frame: str = Field(
        default="",
        description="TF frame of the robot's base; empty: found by itself",
    )
    pose: str = Field(
        default="",
        description="topic of the localised poses, where TF lacks them; empty: found by itself",
    )
    pose_frame: str = Field(
        default="",
        description="TF frame whose poses these are; empty: the one that the messages name, or "
        "the base",
    )
    extrinsics: str = Field(
        default="",
        description="TOML or URDF file with mountings that TF lacks; empty: none",
    )
    start: str = Field(
        default="",
        description="seconds from the beginning (negative: from the end), or a date; reading "
        "starts there; empty: at the beginning",
    )
    end: str = Field(
        default="",
        description="seconds from the beginning (negative: from the end), or a date; reading ends "
        "there; empty: at the end",
    )

    @field_validator("start", "end", mode="before")
    @classmethod
    def _as_moment(cls, given: object) -> str:
        """Take what TOML has as a number or a date, too."""
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
