"""Settings: floor, table top, what stands on it, the rest."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class SegmentationConfig(Section):
    """Floor, table top, what stands on it, the rest."""

    lowest: float = Field(default=0.3, gt=0, description="metres, the lowest table top")
    highest: float = Field(default=1.2, gt=0, description="metres, the highest table top")
    surface_tilt_deg: float = Field(default=30.0, gt=0, lt=90, description="still horizontal")
    least_area: float = Field(default=0.03, gt=0, description="m2 of a surface in one view")
    full_area: float = Field(
        default=0.15, gt=0, description="m2 in one view that count as seen well"
    )
    small_area: float = Field(default=0.15, gt=0, description="m2 below which it is hardly a table")
    high: float = Field(default=1.0, gt=0, description="metres above which it is hardly a table")
    gaze: float = Field(default=0.8, gt=0, description="metres beside the optical axis, as a scale")
    patch_tolerance: float = Field(
        default=0.015, gt=0, description="metres round a surface's height"
    )
    merge_height: float = Field(default=0.04, gt=0, description="metres between views of a surface")
    merge_overlap: float = Field(default=0.15, gt=0, lt=1, description="share of the smaller view")
    merge_gap: float = Field(default=0.1, gt=0, description="metres between ends seen apart")
    most_candidates: int = Field(default=12, ge=1)
    near_distance: float = Field(default=1.0, gt=0, description="metres from --near to a table")
    tie: float = Field(
        default=0.7, gt=0, le=1, description="share of the best weight that is a tie"
    )
    tolerance_least: float = Field(default=0.006, gt=0, description="metres round the top's plane")
    tolerance_most: float = Field(default=0.035, gt=0, description="metres round the top's plane")
    tolerance_sigmas: float = Field(default=3.0, gt=0, description="of a pixel's own noise")
    view_height_gate: float = Field(default=0.025, gt=0, description="metres from the joint height")
    reach: float = Field(default=0.35, gt=0, description="metres by which a view's pose may be off")
    least_top_share: float = Field(
        default=0.003, gt=0, description="of the image, to see the table"
    )
