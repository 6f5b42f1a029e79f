"""Settings: pairwise ICP, pose graph and joint polish."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class RegistrationConfig(Section):
    """Pairwise ICP, pose graph and joint polish."""

    stop_scans: int = Field(
        default=120,
        ge=1,
        description="scans; most that are combined at a stop. Higher: less noise, more memory",
    )
    gates: tuple[float, ...] = Field(
        default=(0.2, 0.1, 0.05, 0.03),
        min_length=1,
        description="metres; points further apart do not correspond, one gate after the other. "
        "Higher first gates: a worse start is mended, and things that moved pull more",
    )
    kernel: float = Field(
        default=0.01,
        gt=0,
        description="metres; residual from which on a point loses weight (scale of a Geman-McClure "
        "loss). Higher: noisier scans count in full, and so do things that moved",
    )
    partners: int = Field(
        default=10,
        ge=1,
        description="stops; most that one stop is paired with. Higher: surer poses, more time",
    )
    minimum_overlap: float = Field(
        default=0.3,
        ge=0,
        le=1,
        description="share of a view's points that another must see, for the two to be paired "
        "(half of it between scans). Higher: fewer wrong pairs, and sooner too few",
    )
    depth_range: float = Field(
        default=3.5,
        gt=0,
        description="metres; depth beyond is left out where views are aligned by depth. Higher: "
        "more of the room helps, with more noise",
    )
    depth_points: int = Field(
        default=700,
        ge=60,
        description="points of a depth view that are aligned. Higher: surer pairs, more time",
    )
    search_radius: float = Field(
        default=0.6,
        gt=0,
        description="metres round a stop that fits badly, in which a better place is searched. "
        "Higher: a worse localisation is mended, in more time",
    )
    search_angle_deg: float = Field(
        default=25.0,
        gt=0,
        description="degrees; the same of its heading. Higher: as for `search_radius`",
    )
