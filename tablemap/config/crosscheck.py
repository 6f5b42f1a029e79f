"""Settings: camera against laser, by the edges of the top and by the legs."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class CrossCheckConfig(Section):
    """Camera against laser, by the edges of the top and by the legs."""

    threshold: float = Field(
        default=0.005,
        gt=0,
        description="metres at the table; offset of the camera against the laser from which on it "
        "is reported and corrected. Higher: larger disagreements pass",
    )
    sigmas: float = Field(
        default=3.0,
        gt=0,
        description="standard deviations that such an offset must exceed. Higher: only clearer "
        "disagreements are reported",
    )
    minimum_views: int = Field(
        default=4,
        ge=3,
        description="views that must show edges, for edges to be compared. Higher: a short drive "
        "is compared by its legs alone, or not at all",
    )
