"""Settings of what becomes of a model: review, exports, and the baseline it is held against."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tablemap.config.sections.base import Section


class ReviewConfig(Section):
    """What the .rrd carries."""

    level: Literal["standard", "full", "off"] = Field(
        default="standard",
        description="standard: the snapshots' images and thinned clouds; full: every image and "
        "scan; off: the summary and the model alone",
    )
    voxel: float = Field(default=0.015, gt=0, description="cell of thinned clouds, metres")
    scan_seconds: float = Field(
        default=0.5,
        ge=0,
        description="sensor time between two odometry scans that are shown, seconds",
    )
    poses: int = Field(default=500, ge=2, description="most recorded poses in the frame tree")
    plotted_pairs: int = Field(
        default=100,
        ge=0,
        description="most pairs whose ICP iterations are plotted, the dropped and the worst first",
    )
    aligned_pairs: int = Field(
        default=48, ge=0, description="most pairs whose clouds are shown moving, of the same"
    )
    aligned_points: int = Field(
        default=360, ge=1, description="most points of each of a pair's two clouds"
    )


class ExportConfig(Section):
    """What exports need that the model does not say."""

    thickness: float = Field(default=0.03, gt=0, description="of a top whose own is not known")
    padding: float = Field(default=0.0, ge=0, description="added round a keep-out area, metres")
    resolution: float = Field(default=0.02, gt=0, description="cell of a keep-out mask, metres")
    margin: float = Field(default=0.5, ge=0, description="free cells round it, metres")
    on_top_of_gap: float = Field(
        default=0.02, ge=0, description="from the top up to ED's volume on top of it, metres"
    )
    on_top_of_height: float = Field(default=0.3, gt=0, description="height of that volume, metres")
    mesh_prefix: str = Field(
        default="", description="before mesh names in URDF, as package://my_tables/"
    )


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
