"""Settings: the bachelor report's method, kept as a baseline: its parameters, as it states them."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tablemap.config.section import Section


class ReportConfig(Section):
    """The bachelor report's method, kept as a baseline: its parameters, as it states them."""

    voxel: float = Field(default=0.01, gt=0, description="cell of every cloud")
    floor: float = Field(default=0.1, ge=0, description="what lies lower is dropped at once")
    cluster_tolerance: float = Field(default=0.03, gt=0, description="gap between clusters")
    cluster_minimum: int = Field(default=300, ge=3, description="cells of the smallest cluster")
    plane_threshold: float = Field(default=0.03, gt=0, description="RANSAC of the top's plane")
    cut: Literal["below", "above_and_below", "nothing"] = Field(
        default="below", description="what goes, seen from the plane, before the clouds are joined"
    )
    cut_margin: float = Field(default=0.01, ge=0, description="below the plane, still kept")
    icp_distance: float = Field(
        default=1.0, ge=0, description="maximum correspondence distance; 0 leaves ICP out"
    )
    alpha: float = Field(default=0.1, gt=0, description="radius of the concave hull")
    threshold: float = Field(default=0.03, gt=0, description="RANSAC of circle and lines")
    minimum_score: float = Field(default=0.5, ge=0, le=1, description="below it the hull stands")
