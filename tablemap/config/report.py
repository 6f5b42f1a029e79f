"""Settings: the bachelor report's method, kept as a baseline, with the parameters it states."""

from typing import Annotated, Literal

from msgspec import Meta

from tablemap.config.section import Section


class ReportConfig(Section, frozen=True):
    """The bachelor report's method, kept as a baseline, with the parameters it states."""

    cut: Annotated[
        Literal["below", "above_and_below", "nothing"],
        Meta(
            description="what is removed from a cloud before the clouds are joined: what lies "
            "below the plane of the top, above and below it, or nothing",
        ),
    ] = "below"
    icp_distance: Annotated[
        float,
        Meta(
            ge=0,
            description="metres; points that lie further apart do not correspond in ICP; 0: no "
            "ICP. Higher: clouds that lie further apart are joined, and slide more",
        ),
    ] = 1.0
