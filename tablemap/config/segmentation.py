"""Settings: floor, table top, what stands on it, the rest."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class SegmentationConfig(Section):
    """Floor, table top, what stands on it, the rest."""

    lowest: float = Field(
        default=0.3,
        gt=0,
        description="metres above the floor; the lowest table top. Higher: low tables are lost, "
        "and seats and boxes with them",
    )
    highest: float = Field(
        default=1.2,
        gt=0,
        description="metres above the floor; the highest table top. Higher: shelves and cupboards "
        "are weighed as tables",
    )
    small_area: float = Field(
        default=0.15,
        gt=0,
        description="square metres; a smaller surface is hardly a table, unless `--near` names it. "
        "Higher: larger stools and boxes are passed over",
    )
    high: float = Field(
        default=1.0,
        gt=0,
        description="metres above the floor; a higher surface is hardly a table, unless `--near` "
        "names it. Higher: bar tables count in full, and so do cupboards",
    )
    near_distance: float = Field(
        default=1.0,
        gt=0,
        description="metres from the place of `--near` to the table's. Higher: a place that is "
        "given roughly finds a table, perhaps another one",
    )
    reach: float = Field(
        default=0.35,
        gt=0,
        description="metres by which the localisation of a view may be off. Higher: the table is "
        "found in badly localised views, and what stands beside it is confused with it sooner",
    )
    least_top_share: float = Field(
        default=0.003,
        gt=0,
        description="share of the image that the top must fill, for a view to see the table. "
        "Higher: views from afar are set aside",
    )
