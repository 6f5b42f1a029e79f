"""The known truth of a recording, ``*.truth.json``; unknown values are null."""

from pathlib import Path
from typing import Annotated

from msgspec import Meta

from tablemap.model import PlanarPose, Point
from tablemap.model.documents import DocumentPart, read_document
from tablemap.model.shape_names import SectionName, ShapeName
from tablemap.model.shapes import DIMENSIONS
from tablemap.paths import AnyPath

SCHEMA = "tablemap/truth/1"


class Tolerance(DocumentPart, frozen=True, kw_only=True):
    """How well the truth itself is known, in metres."""

    dimensions: Annotated[float, Meta(description="metres by which the lengths may be off")] = 0.0
    height: Annotated[float, Meta(description="metres by which the height may be off")] = 0.0


class TrueSurface(DocumentPart, frozen=True, kw_only=True):
    """The top. ``dimensions`` are named as in table.json; ``angle`` in radians."""

    shape: Annotated[ShapeName, Meta(description="name of the shape")]
    pose: Annotated[
        PlanarPose | None,
        Meta(description="area centroid and heading in `frame`, as in table.json; null: not known"),
    ] = None
    height: Annotated[
        float | None,
        Meta(description="metres above the floor, the mean over the top's area; null: not known"),
    ] = None
    dimensions: Annotated[
        dict[str, float] | None,
        Meta(description=f"{DIMENSIONS}; null: not known"),
    ] = None
    corner_radius: Annotated[
        float | None,
        Meta(description="metres of rounded corners; null: sharp, or not known"),
    ] = None
    thickness: Annotated[
        float | None,
        Meta(description="metres of the top's slab; null: not known"),
    ] = None
    outline: Annotated[
        tuple[Point, ...] | None,
        Meta(description="[x, y] each, metres in `frame`, counter-clockwise; null: not known"),
    ] = None
    tolerance: Annotated[
        Tolerance,
        Meta(description="how well these figures themselves are known"),
    ] = Tolerance()


class TrueLeg(DocumentPart, frozen=True, kw_only=True):
    """A leg at the laser's height."""

    shape: Annotated[SectionName, Meta(description="name of its cross-section")]
    x: Annotated[float, Meta(description="metres in `frame`; the cross-section's middle")]
    y: Annotated[float, Meta(description="metres in `frame`; the cross-section's middle")]
    yaw: Annotated[
        float,
        Meta(description="radians in `frame`, counter-clockwise, of its length"),
    ] = 0.0
    dimensions: Annotated[
        dict[str, float],
        Meta(
            description="metres across, by name: diameter of a circle, length and width of a "
            "rectangle",
        ),
    ]


class TrueSnapshot(DocumentPart, frozen=True, kw_only=True):
    """Where the base was, and the share of the top's area that the image shows unhidden.

    ``rest`` numbers the times at which the head rested; images of one rest show the same.
    """

    stamp_ns: Annotated[int, Meta(description="nanoseconds; the image's time in the recording")]
    map_from_base: Annotated[PlanarPose, Meta(description="pose of the robot's base in `frame`")]
    rest: Annotated[
        int | None,
        Meta(
            description="number of the head's rest during which the image was taken; null: on the "
            "way, or not known",
        ),
    ] = None
    sees_top: Annotated[
        float | None,
        Meta(
            description="share of the top's area that the image shows unhidden, 0 to 1; null: not "
            "known",
        ),
    ] = None


class Sensor(DocumentPart, frozen=True, kw_only=True):
    """The sensors' injected errors: a factor on every depth, radians, a factor on every range."""

    depth_scale: Annotated[
        float | None,
        Meta(description="factor on every depth that the camera measures; null: not known"),
    ] = None
    pitch: Annotated[
        float | None,
        Meta(
            description="radians about the base's y axis, from the recorded camera to the true "
            "one; null: not known",
        ),
    ] = None
    laser_range_scale: Annotated[
        float | None,
        Meta(description="factor on every range that the laser measures; null: not known"),
    ] = None


class Truth(DocumentPart, frozen=True, kw_only=True):
    """Everything that is known of a recording, in its map frame."""

    frame: Annotated[str, Meta(description="TF frame of every pose and point")] = "map"
    surface: Annotated[TrueSurface, Meta(description="the top")]
    legs: Annotated[
        tuple[TrueLeg, ...] | None,
        Meta(description="every leg; null: not known"),
    ] = None
    snapshots: Annotated[
        tuple[TrueSnapshot, ...] | None,
        Meta(description="the base at each image; null: not known"),
    ] = None
    sensor: Annotated[
        Sensor | None,
        Meta(description="errors that were put into the sensors; null: not known"),
    ] = None

    @staticmethod
    def load(path: AnyPath) -> "Truth":
        """Read a truth file. Raises `TablemapError` if it is not one."""
        return read_document(path, Truth, schema=SCHEMA, noun="truth")

    @staticmethod
    def beside(recording: Path) -> Path:
        """Return the path of a recording's truth file: ``NAME.truth.json`` beside ``NAME.mcap``."""
        return recording.with_name(f"{recording.stem}.truth.json")
