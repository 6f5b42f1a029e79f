"""The groups of settings, one a stage. Lengths are metres, angles radians unless named ``_deg``."""

from tablemap.config.sections.base import Section
from tablemap.config.sections.placing import OdometryConfig, RegistrationConfig
from tablemap.config.sections.results import ExportConfig, ReportConfig, ReviewConfig
from tablemap.config.sections.sensing import (
    CalibrationConfig,
    SegmentationConfig,
    SnapshotsConfig,
    TopicsConfig,
)
from tablemap.config.sections.supports import CrossCheckConfig, LegsConfig
from tablemap.config.sections.top import OutlineConfig, SurfaceConfig

__all__ = [
    "CalibrationConfig",
    "CrossCheckConfig",
    "ExportConfig",
    "LegsConfig",
    "OdometryConfig",
    "OutlineConfig",
    "RegistrationConfig",
    "ReportConfig",
    "ReviewConfig",
    "Section",
    "SegmentationConfig",
    "SnapshotsConfig",
    "SurfaceConfig",
    "TopicsConfig",
]
