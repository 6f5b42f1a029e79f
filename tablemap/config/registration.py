"""Settings: pairwise ICP, pose graph and joint polish."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class RegistrationConfig(Section):
    """Pairwise ICP, pose graph and joint polish."""

    stop_scans: int = Field(
        default=40,
        ge=1,
        description="scans; the most that are combined at one stop. Higher: less noise, more "
        "memory",
    )
    gates: tuple[float, ...] = Field(
        default=(0.2, 0.1, 0.05, 0.03),
        min_length=1,
        description="metres; points that lie further apart do not correspond; one gate after the "
        "other is used. Higher first gates: larger errors of the start are corrected, and things "
        "that moved pull more",
    )
    kernel: float = Field(
        default=0.01,
        gt=0,
        description="metres; scale of the Geman-McClure loss: a point with a larger residual "
        "loses weight. Higher: noisy scans weigh more, and so do things that moved",
    )
    scan_partners: int = Field(
        default=7,
        ge=1,
        description="stops; the most with which one stop is paired by its scans. Higher: more "
        "certain poses, more time",
    )
    partners: int = Field(
        default=10,
        ge=1,
        description="views; of more than these, depth pairs each with few others, by half of its "
        "points. Higher: more certain poses, more time",
    )
    minimum_overlap: float = Field(
        default=0.3,
        ge=0,
        le=1,
        description="share of a view's points that another view must see, for the two to be "
        "paired; half of it between scans. Higher: fewer wrong pairs, and at some point too few "
        "pairs",
    )
    depth_range: float = Field(
        default=3.5,
        gt=0,
        description="metres; larger depths are not used to align views. Higher: more of the room "
        "helps, with more noise",
    )
    depth_points: int = Field(
        default=700,
        ge=60,
        description="points of a depth view that are aligned. Higher: more certain pairs, more "
        "time",
    )
    search_radius: float = Field(
        default=0.6,
        gt=0,
        description="metres around a stop that fits badly, in which a better place is searched. "
        "Higher: larger errors of the localisation are corrected, in more time",
    )
    search_angle_deg: float = Field(
        default=25.0,
        gt=0,
        description="degrees around the heading of such a stop, in which a better one is "
        "searched. Higher: as for `search_radius`",
    )
