"""Settings: where the robot stood still, and which images are kept."""

from typing import Annotated

from msgspec import Meta

from tablemap.config.section import Section


class SnapshotsConfig(Section, frozen=True):
    """Where the robot stood still, and which images are kept."""

    maximum: Annotated[
        int,
        Meta(
            ge=1,
            description="snapshots; the most that are kept; those that show a new view come "
            "first. Higher: more views, more time and memory",
        ),
    ] = 40
    maximum_at_stops: Annotated[
        int,
        Meta(
            ge=1,
            description="snapshots; the most that are kept where the base stood for each. They "
            "err together, by the camera's errors and the poses: further ones say little. Higher: "
            "as for `maximum`, of which there are no more",
        ),
    ] = 30
    images_per_stop: Annotated[
        int,
        Meta(
            ge=1,
            description="images; the most that are combined at one stop. Higher: less noise, more "
            "time",
        ),
    ] = 5
    stop_seconds: Annotated[
        float,
        Meta(
            gt=0,
            description="seconds; a shorter rest is no stop. Higher: fewer stops",
        ),
    ] = 0.5
    still_speed: Annotated[
        float,
        Meta(
            gt=0,
            description="metres per second; below this speed the base stands still. Higher: a "
            "pose that jitters counts as standing, and so does slow motion, which blurs a stop",
        ),
    ] = 0.02
    still_turn_deg: Annotated[
        float,
        Meta(
            gt=0,
            description="degrees per second; below this rate the base stands still. Higher: as "
            "for `still_speed`",
        ),
    ] = 2.0
    keyframe_distance: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; a view is new if it is this far from every other view, where the "
            "robot made no stops or too many. Higher: fewer snapshots",
        ),
    ] = 0.15
    keyframe_angle_deg: Annotated[
        float,
        Meta(
            gt=0,
            description="degrees; a view is new if it is turned by this much from every other "
            "view. Higher: fewer snapshots",
        ),
    ] = 15.0
