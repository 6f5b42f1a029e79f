"""Settings: the bachelor report's method, kept as a baseline: its parameters, as it states them."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tablemap.config.section import Section


class ReportConfig(Section):
    """The bachelor report's method, kept as a baseline: its parameters, as it states them."""

    cut: Literal["below", "above_and_below", "nothing"] = Field(
        default="below",
        description="what is cut off a cloud, seen from its plane, before the clouds are joined",
    )
    icp_distance: float = Field(
        default=1.0,
        ge=0,
        description="metres; points further apart do not correspond in ICP. Higher: clouds that "
        "lie further apart are joined, and slide more; 0 leaves ICP out",
    )
