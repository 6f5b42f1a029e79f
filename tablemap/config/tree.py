"""All settings as one tree."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.sections import (
    CalibrationConfig,
    CrossCheckConfig,
    ExportConfig,
    LegsConfig,
    OdometryConfig,
    OutlineConfig,
    RegistrationConfig,
    ReportConfig,
    ReviewConfig,
    Section,
    SegmentationConfig,
    SnapshotsConfig,
    SurfaceConfig,
    TopicsConfig,
)


class Config(Section):
    """Everything that decides a run's result, apart from the recording."""

    seed: int = Field(default=0, ge=0)
    topics: TopicsConfig = TopicsConfig()
    snapshots: SnapshotsConfig = SnapshotsConfig()
    calibration: CalibrationConfig = CalibrationConfig()
    segmentation: SegmentationConfig = SegmentationConfig()
    odometry: OdometryConfig = OdometryConfig()
    registration: RegistrationConfig = RegistrationConfig()
    outline: OutlineConfig = OutlineConfig()
    surface: SurfaceConfig = SurfaceConfig()
    crosscheck: CrossCheckConfig = CrossCheckConfig()
    legs: LegsConfig = LegsConfig()
    review: ReviewConfig = ReviewConfig()
    export: ExportConfig = ExportConfig()
    report: ReportConfig = ReportConfig()
