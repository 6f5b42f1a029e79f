"""One typed, frozen tree of settings, and how it is read and written."""

from tablemap.config.loading import dump_config, load_config
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
    SegmentationConfig,
    SnapshotsConfig,
    SurfaceConfig,
    TopicsConfig,
)
from tablemap.config.tree import Config

__all__ = [
    "CalibrationConfig",
    "Config",
    "CrossCheckConfig",
    "ExportConfig",
    "LegsConfig",
    "OdometryConfig",
    "OutlineConfig",
    "RegistrationConfig",
    "ReportConfig",
    "ReviewConfig",
    "SegmentationConfig",
    "SnapshotsConfig",
    "SurfaceConfig",
    "TopicsConfig",
    "dump_config",
    "load_config",
]
