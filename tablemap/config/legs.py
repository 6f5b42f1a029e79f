"""Settings: legs from laser and depth."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class LegsConfig(Section):
    """Legs from laser and depth."""

    beyond: float = Field(
        default=0.10,
        ge=0,
        description="metres outside the top where a leg may stand. Higher: more things beside the "
        "table may be taken for legs",
    )
    smallest_leg: float = Field(
        default=0.006,
        gt=0,
        description="metres across; a thinner thing is no leg. Higher: thin legs are lost",
    )
    largest_leg: float = Field(
        default=0.14,
        gt=0,
        description="metres across; a wider thing is no leg, unless it is a pedestal or a panel. "
        "Higher: boxes and bins under the table are taken for legs",
    )
    largest_slender: float = Field(
        default=0.2,
        gt=0,
        description="metres across; a wider thing is treated as a panel or a box, and a thicker "
        "panel is none. Higher: things that stand close together become one",
    )
    largest_pedestal: float = Field(
        default=0.65,
        gt=0,
        description="metres across; the widest foot in the middle of a top. Higher: large things "
        "under the middle are taken for a foot",
    )
    largest_depth_leg: float = Field(
        default=0.2,
        gt=0,
        description="metres across; the widest leg that the depth camera may find alone. Higher: "
        "boxes under the table are taken for legs where there is no laser",
    )
    seat_height: float = Field(
        default=0.52,
        gt=0,
        description="metres above the floor; a leg must be seen above this height, as the seat of "
        "a chair is lower. Higher: fewer chairs are taken for legs, and depth confirms fewer legs",
    )
    persistence: float = Field(
        default=0.7,
        ge=0,
        le=1,
        description="share of the stops and drives that looked at a leg and must have hit it. "
        "Higher: things that moved during the drive are rejected more surely, and so are legs "
        "that few stops saw",
    )
    stop_scans: int = Field(
        default=60,
        ge=1,
        description="scans; the most that are combined at one stop. Higher: less noise, more "
        "memory",
    )
    moving_scans: int = Field(
        default=200,
        ge=0,
        description="scans; the most that are kept of all drives between the stops; 0: only scans "
        "at stops. Higher: legs are seen from more sides, and take more time",
    )
