"""Settings: where the robot stood still, and which images are kept."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class SnapshotsConfig(Section):
    """Where the robot stood still, and which images are kept."""

    maximum: int = Field(default=40, ge=1, description="most snapshots kept, by new view")
    images_per_stop: int = Field(default=10, ge=1, description="most images combined at a stop")
    stop_seconds: float = Field(default=0.5, gt=0, description="least time that counts as a stop")
    still_speed: float = Field(default=0.02, gt=0, description="m/s below which the base stands")
    still_turn_deg: float = Field(default=2.0, gt=0, description="deg/s below which it stands")
    jump_distance: float = Field(default=0.5, gt=0, description="metres, the farthest such a jump")
    least_stops: int = Field(default=3, ge=1, description="fewer: keyframes are taken instead")
    keyframe_distance: float = Field(default=0.15, gt=0, description="metres to a new view")
    keyframe_angle_deg: float = Field(default=15.0, gt=0, description="degrees to a new view")
