"""Settings: what is floor, table top, thing on the table, and anything else."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class SegmentationConfig(Section):
    """What is floor, table top, thing on the table, and anything else."""

    lowest: float = Field(
        default=0.3,
        gt=0,
        description="metres above the floor; the lowest table top. Higher: low tables are lost, "
        "and so are seats and boxes",
    )
    highest: float = Field(
        default=1.2,
        gt=0,
        description="metres above the floor; the highest table top. Higher: shelves and cupboards "
        "may be taken for tables",
    )
    small_area: float = Field(
        default=0.15,
        gt=0,
        description="square metres; a smaller surface is probably no table, unless `--near` names "
        "it. Higher: larger stools and boxes are passed over",
    )
    high: float = Field(
        default=1.0,
        gt=0,
        description="metres above the floor; a higher surface is probably no table, unless "
        "`--near` names it. Higher: bar tables count in full, and so do cupboards",
    )
    near_distance: float = Field(
        default=1.0,
        gt=0,
        description="metres; how far the table may be from the place of `--near`. Higher: a rough "
        "place is enough, and may find another table",
    )
    reach: float = Field(
        default=0.35,
        gt=0,
        description="metres; how far the localisation of a view may be off. Higher: the table is "
        "found in badly localised views, and things beside it are more often taken for it",
    )
    least_top_share: float = Field(
        default=0.003,
        gt=0,
        description="share of the image that the top must fill in a view that is used. Higher: "
        "views from far away are not used",
    )
