"""All settings as one tree."""

import math
from contextlib import suppress
from typing import Annotated, Literal

from msgspec import Meta

from tablemap.config.calibration import CalibrationConfig
from tablemap.config.crosscheck import CrossCheckConfig
from tablemap.config.export import ExportConfig
from tablemap.config.legs import LegsConfig
from tablemap.config.limits import LimitsConfig
from tablemap.config.odometry import OdometryConfig
from tablemap.config.outline import OutlineConfig
from tablemap.config.registration import RegistrationConfig
from tablemap.config.report import ReportConfig
from tablemap.config.review import ReviewConfig
from tablemap.config.section import Section, is_section
from tablemap.config.segmentation import SegmentationConfig
from tablemap.config.sensors import SensorsConfig
from tablemap.config.snapshots import SnapshotsConfig
from tablemap.config.surface import SurfaceConfig
from tablemap.config.topics import TopicsConfig
from tablemap.errors import ConfigError
from tablemap.structs import fields_of

Method = Literal["tablemap", "report"]
"""The method: tablemap's own, or that of the bachelor report, as the baseline."""

Tables = Literal["best", "all"] | tuple[float, float]
"""The choice of tables: the one seen best, all, or the one nearest to a place in the map."""


def check_tables(tables: object) -> Tables:
    """Return the choice of tables. Raises `ConfigError` for anything that is none."""
    if tables == "best":
        return "best"
    if tables == "all":
        return "all"
    if not isinstance(tables, str):
        with suppress(TypeError, ValueError):
            x, y = map(float, tables)  # type: ignore[call-overload]
            if math.isfinite(x) and math.isfinite(y):
                return x, y
    raise ConfigError(f"expected best, all or a place (x, y) in metres; found {tables!r}.")


class Config(Section, frozen=True):
    """Everything that decides the result of a run, except the recording.

    Raises `ConfigError` for a setting that is unknown or out of its range.
    """

    seed: Annotated[
        int,
        Meta(
            ge=0,
            description="start of the random numbers; the same seed gives the same bytes",
        ),
    ] = 0
    method: Annotated[
        Method,
        Meta(
            description="tablemap; or report: the method of the bachelor report, as the baseline",
        ),
    ] = "tablemap"
    tables: Annotated[
        Tables,
        Meta(
            description="which table: best (the one seen best), all, or [x, y] (the one nearest "
            "to this place, metres in the map)",
            extra={"read": check_tables},
        ),
    ] = "best"
    topics: TopicsConfig = TopicsConfig()
    sensors: SensorsConfig = SensorsConfig()
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
    limits: LimitsConfig = LimitsConfig()


def setting_names() -> list[str]:
    """Return the dotted name of every setting, in the order of the tree."""
    names = []
    for name, field in fields_of(Config).items():
        if is_section(field.type):
            names += [f"{name}.{key}" for key in fields_of(field.type)]
        else:
            names.append(name)
    return names
