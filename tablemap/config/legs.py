"""Settings: legs from laser and depth."""

from typing import Annotated

from msgspec import Meta

from tablemap.config.section import Section


class LegsConfig(Section, frozen=True):
    """Legs from laser and depth."""

    beyond: Annotated[
        float,
        Meta(
            ge=0,
            description="metres outside the top where a leg may stand. Higher: more things beside "
            "the table may be taken for legs",
        ),
    ] = 0.10
    smallest_leg: Annotated[
        float,
        Meta(
            gt=0,
            description="metres across; a thinner thing is no leg. Higher: thin legs are lost",
        ),
    ] = 0.006
    largest_leg: Annotated[
        float,
        Meta(
            gt=0,
            description="metres across; a wider thing is no leg, unless it is a pedestal or a "
            "panel. Higher: boxes and bins under the table are taken for legs",
        ),
    ] = 0.14
    largest_slender: Annotated[
        float,
        Meta(
            gt=0,
            description="metres across; a wider thing is treated as a panel or a box, and a "
            "thicker panel is none. Higher: things that stand close together become one",
        ),
    ] = 0.2
    largest_pedestal: Annotated[
        float,
        Meta(
            gt=0,
            description="metres across; the widest foot in the middle of a top. Higher: large "
            "things under the middle are taken for a foot",
        ),
    ] = 0.65
    largest_depth_leg: Annotated[
        float,
        Meta(
            gt=0,
            description="metres across; the widest leg that the depth camera may find alone. "
            "Higher: boxes under the table are taken for legs where there is no laser",
        ),
    ] = 0.2
    seat_height: Annotated[
        float,
        Meta(
            gt=0,
            description="metres above the floor; a leg must be seen above this height, as the "
            "seat of a chair is lower. Higher: fewer chairs are taken for legs, and depth "
            "confirms fewer legs",
        ),
    ] = 0.52
    persistence: Annotated[
        float,
        Meta(
            ge=0,
            le=1,
            description="share of the stops and drives that looked at a leg and must have hit it. "
            "Higher: things that moved during the drive are rejected more surely, and so are legs "
            "that few stops saw",
        ),
    ] = 0.7
    stop_scans: Annotated[
        int,
        Meta(
            ge=1,
            description="scans; the most that are combined at one stop. Higher: less noise, more "
            "memory",
        ),
    ] = 60
    moving_scans: Annotated[
        int,
        Meta(
            ge=0,
            description="scans; the most that are kept of all drives between the stops; 0: only "
            "scans at stops. Higher: legs are seen from more sides, and take more time",
        ),
    ] = 200
