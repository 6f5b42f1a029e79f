"""Settings: what the .rrd carries."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tablemap.config.section import Section


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
