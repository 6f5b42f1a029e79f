"""Settings: pairwise ICP, pose graph and joint polish."""

from typing import Annotated

from msgspec import Meta

from tablemap.config.section import Section


class RegistrationConfig(Section, frozen=True):
    """Pairwise ICP, pose graph and joint polish."""

    stop_scans: Annotated[
        int,
        Meta(
            ge=1,
            description="scans; the most that are combined at one stop. Higher: less noise, more "
            "memory",
        ),
    ] = 40
    gates: Annotated[
        tuple[float, ...],
        Meta(
            min_length=1,
            description="metres; points that lie further apart do not correspond; one gate after "
            "the other is used. Higher first gates: larger errors of the start are corrected, and "
            "things that moved pull more",
        ),
    ] = (0.2, 0.1, 0.05, 0.03)
    kernel: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; scale of the Geman-McClure loss: a point with a larger residual "
            "loses weight. Higher: noisy scans weigh more, and so do things that moved",
        ),
    ] = 0.01
    scan_partners: Annotated[
        int,
        Meta(
            ge=1,
            description="stops; the most with which one stop is paired by its scans. Higher: more "
            "certain poses, more time",
        ),
    ] = 7
    partners: Annotated[
        int,
        Meta(
            ge=1,
            description="views; of more than these, depth pairs each with few others, by half of "
            "its points. Higher: more certain poses, more time",
        ),
    ] = 10
    minimum_overlap: Annotated[
        float,
        Meta(
            ge=0,
            le=1,
            description="share of a view's points that another view must see, for the two to be "
            "paired; half of it between scans. Higher: fewer wrong pairs, and at some point too "
            "few pairs",
        ),
    ] = 0.3
    depth_range: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; larger depths are not used to align views. Higher: more of the "
            "room helps, with more noise",
        ),
    ] = 3.5
    depth_points: Annotated[
        int,
        Meta(
            ge=60,
            description="points of a depth view that are aligned. Higher: more certain pairs, "
            "more time",
        ),
    ] = 700
    search_radius: Annotated[
        float,
        Meta(
            gt=0,
            description="metres around a stop that fits badly, in which a better place is "
            "searched. Higher: larger errors of the localisation are corrected, in more time",
        ),
    ] = 0.6
    search_angle_deg: Annotated[
        float,
        Meta(
            gt=0,
            description="degrees around the heading of such a stop, in which a better one is "
            "searched. Higher: as for `search_radius`",
        ),
    ] = 25.0
