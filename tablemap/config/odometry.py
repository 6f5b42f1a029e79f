"""Settings: KISS-ICP over the laser scans."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class OdometryConfig(Section):
    """KISS-ICP over the laser scans."""

    voxel_size: float = Field(
        default=0.075,
        gt=0,
        description="metres; cell of KISS-ICP's map. Higher: faster and smoother, less exact in "
        "small rooms",
    )
    threshold: float = Field(
        default=0.02,
        gt=0,
        description="metres; scale of KISS-ICP's robust kernel where wheel odometry predicts the "
        "motion. Higher: larger errors of the wheels are corrected, and moving things pull more",
    )
    threshold_without_wheels: float = Field(
        default=0.05,
        gt=0,
        description="metres; scale of KISS-ICP's robust kernel where the localisation predicts "
        "the motion. Higher: larger errors of the localisation are corrected, and moving things "
        "pull more",
    )
    moved: float = Field(
        default=0.04,
        gt=0,
        description="metres; a scan is used after so much motion, without wheel odometry after "
        "a quarter of it. Higher: fewer scans, less time",
    )
    turned_deg: float = Field(
        default=2.0,
        gt=0,
        description="degrees; a scan is used after so much turning, without wheel odometry after "
        "a quarter of it. Higher: fewer scans, less time",
    )
    maximum_correction: float = Field(
        default=0.15,
        gt=0,
        description="metres; if KISS-ICP moves a scan further than this from its prediction, the "
        "prediction is kept. Higher: larger errors of the wheels are corrected, and wrong matches "
        "are accepted",
    )
