"""Settings: which channel and frame plays which role; empty means: found by itself."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class TopicsConfig(Section):
    """Which channel and frame plays which role; empty means: found by itself."""

    depth: str = Field(default="", description="topic of the depth images")
    calibration: str = Field(default="", description="topic of the depth camera's calibration")
    colour: str = Field(default="", description="topic of the colour images")
    laser: str = Field(default="", description="topic of the base's laser scans")
    fixed_frame: str = Field(default="", description="TF frame that the model is to be in")
    odom_frame: str = Field(default="", description="TF frame of the wheel odometry")
    base_frame: str = Field(default="", description="TF frame of the robot's base")
