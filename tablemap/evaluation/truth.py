"""What is known of a recording: ``*.truth.json``. What is not known is null."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict

from tablemap.model import PlanarPose, Point
from tablemap.model.documents import read_document
from tablemap.model.shapes import SectionName, ShapeName
from tablemap.paths import AnyPath

SCHEMA = "tablemap/truth/1"


class Part(BaseModel):
    """A part of the truth: frozen; fields that a reader does not know are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class Tolerance(Part):
    """How well the truth itself is known, in metres."""

    dimensions: float = 0.0
    height: float = 0.0


class TrueSurface(Part):
    """The top. ``dimensions`` are named as in table.json; ``angle`` in radians."""

    shape: ShapeName
    pose: PlanarPose | None = None
    height: float | None = None
    dimensions: dict[str, float] | None = None
    corner_radius: float | None = None
    thickness: float | None = None
    outline: tuple[Point, ...] | None = None
    tolerance: Tolerance = Tolerance()


class TrueLeg(Part):
    """A leg at the laser's height."""

    shape: SectionName
    x: float
    y: float
    yaw: float = 0.0
    dimensions: dict[str, float]


class TrueSnapshot(Part):
    """Where the base was, and the share of the top's area that the image shows unhidden."""

    stamp_ns: int
    map_from_base: PlanarPose
    sees_top: float | None = None


class Sensor(Part):
    """The sensors' injected errors: a factor on every depth, radians, a factor on every range."""

    depth_scale: float | None = None
    pitch: float | None = None
    laser_range_scale: float | None = None


class Truth(Part):
    """Everything that is known of a recording, in its map frame."""

    frame: str = "map"
    surface: TrueSurface
    legs: tuple[TrueLeg, ...] | None = None
    snapshots: tuple[TrueSnapshot, ...] | None = None
    sensor: Sensor | None = None

    @staticmethod
    def load(path: AnyPath) -> Truth:
        """Read a truth file. Raises `TablemapError` where it is none."""
        return read_document(path, Truth, schema=SCHEMA, noun="truth")

    @staticmethod
    def beside(recording: Path) -> Path:
        """Return where a recording's truth file is: ``NAME.truth.json`` beside ``NAME.mcap``."""
        return recording.with_name(f"{recording.stem}.truth.json")
