"""Settings: legs from laser and depth."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class LegsConfig(Section):
    """Legs from laser and depth."""

    beyond: float = Field(
        default=0.10,
        ge=0,
        description="metres beyond the top that a leg may stand. Higher: more of what stands "
        "beside the table is weighed as a leg",
    )
    smallest_leg: float = Field(
        default=0.006,
        gt=0,
        description="metres across; anything thinner is no leg. Higher: thin legs are lost",
    )
    largest_leg: float = Field(
        default=0.14,
        gt=0,
        description="metres across; anything wider is no leg, unless it is a pedestal or a panel. "
        "Higher: boxes and bins under the table pass for legs",
    )
    largest_slender: float = Field(
        default=0.2,
        gt=0,
        description="metres across; what is wider shows no whole silhouette and is taken for a "
        "panel or a box, and a panel is no thicker. Higher: things that stand close together "
        "become one",
    )
    largest_pedestal: float = Field(
        default=0.65,
        gt=0,
        description="metres across; widest foot in the middle of a top. Higher: large things "
        "under the middle pass for a foot",
    )
    largest_depth_leg: float = Field(
        default=0.2,
        gt=0,
        description="metres across; the widest leg that the depth camera may tell alone. Higher: "
        "boxes under the table pass for legs where there is no laser",
    )
    seat_height: float = Field(
        default=0.52,
        gt=0,
        description="metres above the floor; a leg must be seen above it, as a chair's seat is "
        "lower. Higher: fewer chairs pass, and fewer legs are confirmed by depth",
    )
    persistence: float = Field(
        default=0.7,
        ge=0,
        le=1,
        description="share of the stops and drives that looked at a leg and must have hit it. "
        "Higher: what moved during the drive is refused sooner, and so is a leg that few saw",
    )
    stop_scans: int = Field(
        default=60,
        ge=1,
        description="scans; most that are combined at a stop. Higher: less noise, more memory",
    )
    moving_scans: int = Field(
        default=200,
        ge=0,
        description="scans; most that are kept of all drives between the stops. Higher: legs are "
        "seen from more sides, and take longer; 0: the stops alone",
    )
