"""One typed, frozen tree of settings, and how it is read and written."""

from tablemap.config.calibration import CalibrationConfig
from tablemap.config.cameras import CAMERAS, DepthCamera
from tablemap.config.crosscheck import CrossCheckConfig
from tablemap.config.export import ExportConfig
from tablemap.config.legs import LegsConfig
from tablemap.config.limits import LimitsConfig
from tablemap.config.loading import load_config
from tablemap.config.odometry import OdometryConfig
from tablemap.config.outline import OutlineConfig
from tablemap.config.printing import dump_config, explain_config
from tablemap.config.registration import RegistrationConfig
from tablemap.config.report import ReportConfig
from tablemap.config.review import ReviewConfig
from tablemap.config.segmentation import SegmentationConfig
from tablemap.config.sensors import SensorsConfig
from tablemap.config.snapshots import SnapshotsConfig
from tablemap.config.surface import SurfaceConfig
from tablemap.config.topics import TopicsConfig
from tablemap.config.tree import Config, Method, Tables, check_tables, setting_names

__all__ = [
    "CAMERAS",
    "CalibrationConfig",
    "Config",
    "CrossCheckConfig",
    "DepthCamera",
    "ExportConfig",
    "LegsConfig",
    "LimitsConfig",
    "Method",
    "OdometryConfig",
    "OutlineConfig",
    "RegistrationConfig",
    "ReportConfig",
    "ReviewConfig",
    "SegmentationConfig",
    "SensorsConfig",
    "SnapshotsConfig",
    "SurfaceConfig",
    "Tables",
    "TopicsConfig",
    "check_tables",
    "dump_config",
    "explain_config",
    "load_config",
    "setting_names",
]
