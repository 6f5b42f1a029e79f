"""Settings: camera and laser compared by the edges of the top and by the legs."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class CrossCheckConfig(Section):
    """Camera and laser compared by the edges of the top and by the legs."""

    threshold: float = Field(
        default=0.005,
        gt=0,
        description="metres at the table; a larger offset between camera and laser is reported "
        "and corrected. Higher: larger disagreements pass",
    )
    sigmas: float = Field(
        default=3.0,
        gt=0,
        description="standard deviations that this offset must exceed as well. Higher: only "
        "clearer disagreements are reported",
    )
    minimum_views: int = Field(
        default=4,
        ge=3,
        description="views that must show edges of the top; with fewer, edges are not compared. "
        "Higher: a short drive is compared by its legs alone, or not at all",
    )
