"""Settings: what the .rrd carries."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tablemap.config.section import Section


class ReviewConfig(Section):
    """What the .rrd carries."""

    level: Literal["standard", "full", "off"] = Field(
        default="standard",
        description="standard: the images and thinned clouds of the snapshots; full: every image "
        "and scan; off: only the summary and the model",
    )
    voxel: float = Field(
        default=0.015,
        gt=0,
        description="metres; cell size of thinned clouds. Higher: fewer points, a smaller file",
    )
    scan_seconds: float = Field(
        default=0.5,
        ge=0,
        description="seconds of sensor time between two odometry scans that are shown. Higher: "
        "fewer scans, a smaller file",
    )
    plotted_pairs: int = Field(
        default=100,
        ge=0,
        description="pairs; the most whose ICP iterations are plotted: rejected pairs first, then "
        "the worst. Higher: a larger file",
    )
    aligned_pairs: int = Field(
        default=48,
        ge=0,
        description="pairs; the most whose clouds are shown as they move: rejected pairs first, "
        "then the worst. Higher: a larger file, with smaller cells",
    )
