"""The known truth of a recording, ``*.truth.json``; unknown values are null."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from tablemap.model import PlanarPose, Point
from tablemap.model.documents import read_document
from tablemap.model.shapes import DIMENSIONS, SectionName, ShapeName
from tablemap.paths import AnyPath

SCHEMA = "tablemap/truth/1"


class TruthPart(BaseModel):
    """A part of the truth: frozen; unknown fields in the file are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class Tolerance(TruthPart):
    """How well the truth itself is known, in metres."""

    dimensions: float = Field(default=0.0, description="metres by which the lengths may be off")
    height: float = Field(default=0.0, description="metres by which the height may be off")


class TrueSurface(TruthPart):
    """The top. ``dimensions`` are named as in table.json; ``angle`` in radians."""

    shape: ShapeName = Field(description="name of the shape")
    pose: PlanarPose | None = Field(
        default=None,
        description="area centroid and heading in `frame`, as in table.json; null: not known",
    )
    height: float | None = Field(
        default=None,
        description="metres above the floor, the mean over the top's area; null: not known",
    )
    dimensions: dict[str, float] | None = Field(
        default=None, description=f"{DIMENSIONS}; null: not known"
    )
    corner_radius: float | None = Field(
        default=None,
        description="metres of rounded corners; null: sharp, or not known",
    )
    thickness: float | None = Field(
        default=None,
        description="metres of the top's slab; null: not known",
    )
    outline: tuple[Point, ...] | None = Field(
        default=None,
        description="[x, y] each, metres in `frame`, counter-clockwise; null: not known",
    )
    tolerance: Tolerance = Field(
        default=Tolerance(),
        description="how well these figures themselves are known",
    )


class TrueLeg(TruthPart):
    """A leg at the laser's height."""

    shape: SectionName = Field(description="name of its cross-section")
    x: float = Field(description="metres in `frame`; the cross-section's middle")
    y: float = Field(description="metres in `frame`; the cross-section's middle")
    yaw: float = Field(
        default=0.0,
        description="radians in `frame`, counter-clockwise, of its length",
    )
    dimensions: dict[str, float] = Field(
        description="metres across, by name: diameter of a circle, length and width of a rectangle",
    )


class TrueSnapshot(TruthPart):
    """Where the base was, and the share of the top's area that the image shows unhidden.

    ``rest`` numbers the times at which the head rested; images of one rest show the same.
    """

    stamp_ns: int = Field(description="nanoseconds; the image's time in the recording")
    map_from_base: PlanarPose = Field(description="pose of the robot's base in `frame`")
    rest: int | None = Field(
        default=None,
        description="number of the head's rest during which the image was taken; null: on the way, "
        "or not known",
    )
    sees_top: float | None = Field(
        default=None,
        description="share of the top's area that the image shows unhidden, 0 to 1; null: not "
        "known",
    )


class Sensor(TruthPart):
    """The sensors' injected errors: a factor on every depth, radians, a factor on every range."""

    depth_scale: float | None = Field(
        default=None,
        description="factor on every depth that the camera measures; null: not known",
    )
    pitch: float | None = Field(
        default=None,
        description="radians about the base's y axis, from the recorded camera to the true "
        "one; null: not known",
    )
    laser_range_scale: float | None = Field(
        default=None,
        description="factor on every range that the laser measures; null: not known",
    )


class Truth(TruthPart):
    """Everything that is known of a recording, in its map frame."""

    frame: str = Field(default="map", description="TF frame of every pose and point")
    surface: TrueSurface = Field(description="the top")
    legs: tuple[TrueLeg, ...] | None = Field(default=None, description="every leg; null: not known")
    snapshots: tuple[TrueSnapshot, ...] | None = Field(
        default=None,
        description="the base at each image; null: not known",
    )
    sensor: Sensor | None = Field(
        default=None,
        description="errors that were put into the sensors; null: not known",
    )

    @staticmethod
    def load(path: AnyPath) -> Truth:
        """Read a truth file. Raises `TablemapError` if it is not one."""
        return read_document(path, Truth, schema=SCHEMA, noun="truth")

    @staticmethod
    def beside(recording: Path) -> Path:
        """Return the path of a recording's truth file: ``NAME.truth.json`` beside ``NAME.mcap``."""
        return recording.with_name(f"{recording.stem}.truth.json")
