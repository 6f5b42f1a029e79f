"""Settings: kISS-ICP over the laser scans."""

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
        description="metres; scale of KISS-ICP's kernel where wheel odometry predicts the motion. "
        "Higher: worse wheels are mended, and things that move pull more",
    )
    threshold_without_wheels: float = Field(
        default=0.05,
        gt=0,
        description="metres; the same where the localisation predicts it. Higher: a worse "
        "localisation is mended, and things that move pull more",
    )
    moved: float = Field(
        default=0.02,
        gt=0,
        description="metres of motion after which a scan is used. Higher: fewer scans, less time",
    )
    turned_deg: float = Field(
        default=1.0,
        gt=0,
        description="degrees of turning after which a scan is used. Higher: fewer scans, less time",
    )
    maximum_correction: float = Field(
        default=0.15,
        gt=0,
        description="metres; a scan that KISS-ICP moves further from its prediction keeps the "
        "prediction. Higher: worse wheels are mended, and wrong matches get through",
    )
