"""Settings: where the robot stood still, and which images are kept."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class SnapshotsConfig(Section):
    """Where the robot stood still, and which images are kept."""

    maximum: int = Field(
        default=40,
        ge=1,
        description="snapshots; the most that are kept; those that show a new view come first. "
        "Higher: more views, more time and memory",
    )
    maximum_at_stops: int = Field(
        default=30,
        ge=1,
        description="snapshots; the most that are kept where the base stood for each. They err "
        "together, by the camera's errors and the poses: further ones say little. Higher: as for "
        "`maximum`, of which there are no more",
    )
    images_per_stop: int = Field(
        default=5,
        ge=1,
        description="images; the most that are combined at one stop. Higher: less noise, more time",
    )
    stop_seconds: float = Field(
        default=0.5,
        gt=0,
        description="seconds; a shorter rest is no stop. Higher: fewer stops",
    )
    still_speed: float = Field(
        default=0.02,
        gt=0,
        description="metres per second; below this speed the base stands still. Higher: a pose "
        "that jitters counts as standing, and so does slow motion, which blurs a stop",
    )
    still_turn_deg: float = Field(
        default=2.0,
        gt=0,
        description="degrees per second; below this rate the base stands still. Higher: as for "
        "`still_speed`",
    )
    keyframe_distance: float = Field(
        default=0.15,
        gt=0,
        description="metres; a view is new if it is this far from every other view, where the "
        "robot made no stops or too many. Higher: fewer snapshots",
    )
    keyframe_angle_deg: float = Field(
        default=15.0,
        gt=0,
        description="degrees; a view is new if it is turned by this much from every other view. "
        "Higher: fewer snapshots",
    )
