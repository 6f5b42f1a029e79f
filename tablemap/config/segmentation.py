"""Settings: what is floor, table top, thing on the table, and anything else."""

from typing import Annotated

from msgspec import Meta

from tablemap.config.section import Section


class SegmentationConfig(Section, frozen=True):
    """What is floor, table top, thing on the table, and anything else."""

    lowest: Annotated[
        float,
        Meta(
            gt=0,
            description="metres above the floor; the lowest table top. Higher: low tables are "
            "lost, and so are seats and boxes",
        ),
    ] = 0.3
    highest: Annotated[
        float,
        Meta(
            gt=0,
            description="metres above the floor; the highest table top. Higher: shelves and "
            "cupboards may be taken for tables",
        ),
    ] = 1.2
    small_area: Annotated[
        float,
        Meta(
            gt=0,
            description="square metres; a smaller surface is probably no table, unless `--near` "
            "names it. Higher: larger stools and boxes are passed over",
        ),
    ] = 0.15
    high: Annotated[
        float,
        Meta(
            gt=0,
            description="metres above the floor; a higher surface is probably no table, unless "
            "`--near` names it. Higher: bar tables count in full, and so do cupboards",
        ),
    ] = 1.0
    near_distance: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; how far the table may be from the place of `--near`. Higher: a "
            "rough place is enough, and may find another table",
        ),
    ] = 1.0
    reach: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; how far the localisation of a view may be off. Higher: the table "
            "is found in badly localised views, and things beside it are more often taken for it",
        ),
    ] = 0.35
    least_top_share: Annotated[
        float,
        Meta(
            gt=0,
            description="share of the image that the top must fill in a view that is used. "
            "Higher: views from far away are not used",
        ),
    ] = 0.003
