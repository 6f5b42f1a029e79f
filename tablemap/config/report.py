"""Settings: the bachelor report's method, kept as a baseline, with the parameters it states."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tablemap.config.section import Section


class ReportConfig(Section):
    """The bachelor report's method, kept as a baseline, with the parameters it states."""

    cut: Literal["below", "above_and_below", "nothing"] = Field(
        default="below",
        description="what is removed from a cloud before the clouds are joined: what lies below "
        "the plane of the top, above and below it, or nothing",
    )
    icp_distance: float = Field(
        default=1.0,
        ge=0,
        description="metres; points that lie further apart do not correspond in ICP; 0: no ICP. "
        "Higher: clouds that lie further apart are joined, and slide more",
    )
