"""Settings: camera and laser compared by the edges of the top and by the legs."""

from typing import Annotated

from msgspec import Meta

from tablemap.config.section import Section


class CrossCheckConfig(Section, frozen=True):
    """Camera and laser compared by the edges of the top and by the legs."""

    threshold: Annotated[
        float,
        Meta(
            gt=0,
            description="metres at the table; a larger offset between camera and laser is "
            "reported and corrected. Higher: larger disagreements pass",
        ),
    ] = 0.005
    sigmas: Annotated[
        float,
        Meta(
            gt=0,
            description="standard deviations that this offset must exceed as well. Higher: only "
            "clearer disagreements are reported",
        ),
    ] = 3.0
    minimum_views: Annotated[
        int,
        Meta(
            ge=3,
            description="views that must show edges of the top; with fewer, edges are not "
            "compared. Higher: a short drive is compared by its legs alone, or not at all",
        ),
    ] = 4
