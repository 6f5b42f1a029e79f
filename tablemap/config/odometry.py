"""Settings: kISS-ICP over the laser scans."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class OdometryConfig(Section):
    """KISS-ICP over the laser scans."""

    voxel_size: float = Field(default=0.075, gt=0, description="KISS-ICP's map voxel, metres")
    threshold: float = Field(
        default=0.02, gt=0, description="KISS-ICP's kernel scale with wheel odometry, metres"
    )
    threshold_without_wheels: float = Field(
        default=0.05, gt=0, description="the same where the prior is the localisation, metres"
    )
    moved: float = Field(
        default=0.02, gt=0, description="motion that makes a scan worth it, metres"
    )
    turned_deg: float = Field(default=1.0, gt=0, description="turn that makes a scan worth it")
    gap_moves: float = Field(
        default=4.0, ge=1, description="ways of so many times that without a scan are bridged"
    )
    standing_every: int = Field(default=8, ge=1, description="one scan in so many while standing")
    maximum_correction: float = Field(
        default=0.15,
        gt=0,
        description="a scan moved further from its prior keeps the prior, metres",
    )
    event_points: int = Field(default=360, ge=1, description="most points of a recorded scan")
    event_maps: int = Field(
        default=30, ge=1, description="recorded states of KISS-ICP's map, spread over the drive"
    )
