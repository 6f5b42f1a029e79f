"""Settings: KISS-ICP over the laser scans."""

from typing import Annotated

from msgspec import Meta

from tablemap.config.section import Section


class OdometryConfig(Section, frozen=True):
    """KISS-ICP over the laser scans."""

    voxel_size: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; cell of KISS-ICP's map. Higher: faster and smoother, less exact "
            "in small rooms",
        ),
    ] = 0.075
    threshold: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; scale of KISS-ICP's robust kernel where wheel odometry predicts "
            "the motion. Higher: larger errors of the wheels are corrected, and moving things "
            "pull more",
        ),
    ] = 0.02
    threshold_without_wheels: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; scale of KISS-ICP's robust kernel where the localisation "
            "predicts the motion. Higher: larger errors of the localisation are corrected, and "
            "moving things pull more",
        ),
    ] = 0.05
    moved: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; a scan is used after so much motion, without wheel odometry "
            "after a quarter of it. Higher: fewer scans, less time",
        ),
    ] = 0.04
    turned_deg: Annotated[
        float,
        Meta(
            gt=0,
            description="degrees; a scan is used after so much turning, without wheel odometry "
            "after a quarter of it. Higher: fewer scans, less time",
        ),
    ] = 2.0
    maximum_correction: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; if KISS-ICP moves a scan further than this from its prediction, "
            "the prediction is kept. Higher: larger errors of the wheels are corrected, and wrong "
            "matches are accepted",
        ),
    ] = 0.15
