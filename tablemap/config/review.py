"""Settings: what the .rrd carries."""

from typing import Annotated, Literal

from msgspec import Meta

from tablemap.config.section import Section


class ReviewConfig(Section, frozen=True):
    """What the .rrd carries."""

    level: Annotated[
        Literal["standard", "full", "off"],
        Meta(
            description="standard: the images and thinned clouds of the snapshots; full: every "
            "image and scan; off: only the summary and the model",
        ),
    ] = "standard"
    voxel: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; cell size of thinned clouds. Higher: fewer points, a smaller file",
        ),
    ] = 0.015
    scan_seconds: Annotated[
        float,
        Meta(
            ge=0,
            description="seconds of sensor time between two odometry scans that are shown. "
            "Higher: fewer scans, a smaller file",
        ),
    ] = 0.5
    plotted_pairs: Annotated[
        int,
        Meta(
            ge=0,
            description="pairs; the most whose ICP iterations are plotted: rejected pairs first, "
            "then the worst. Higher: a larger file",
        ),
    ] = 100
    aligned_pairs: Annotated[
        int,
        Meta(
            ge=0,
            description="pairs; the most whose clouds are shown as they move: rejected pairs "
            "first, then the worst. Higher: a larger file, with smaller cells",
        ),
    ] = 48
