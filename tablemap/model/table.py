"""The model of a table: the contents of ``table.json``, and how it is read and written.

Equal runs give equal bytes: keys keep their order, and numbers are rounded, as their last bits
depend on threads (micrometres, microradians; covariances to nine significant digits).
"""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    ValidationError,
    model_validator,
)
from pydantic.functional_serializers import PlainSerializer

from tablemap.errors import TablemapError
from tablemap.model.documents import damage, document_schema, parse_document, read_document
from tablemap.model.shapes import DIMENSIONS, SectionName, ShapeName
from tablemap.paths import AnyPath, as_place

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tablemap.geometry import Floats

SCHEMA = "tablemap/table/1"
NOUN = "table model"
MOST_POINTS, MOST_LEGS = 10_000, 1000
"""No table has more; files of others may claim more."""

Status = Literal["measured", "inferred", "unseen"]
Level = Literal["good", "doubtful", "failed"]


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ValueError("not finite")
    return value


def _micro(value: float) -> float:
    return round(value, 6) + 0.0


def _significant(value: float) -> float:
    return float(f"{value:.9g}") + 0.0


Number = Annotated[float, AfterValidator(_finite), PlainSerializer(_micro, return_type=float)]
"""Metres, radians or a share, written to six decimals."""
Variance = Annotated[
    float, AfterValidator(_finite), PlainSerializer(_significant, return_type=float)
]
"""An element of a covariance, written to nine significant digits."""
Point = tuple[Number, Number]
Row = tuple[Variance, Variance, Variance]


class Part(BaseModel):
    """A part of the model: frozen; unknown fields in the file are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class Figure(Part):
    """A value and its standard deviation; null if no data supports one."""

    value: Number = Field(description="metres, or radians of an angle")
    sigma: Number | None = Field(
        description="its standard deviation, in the same unit; null if no data supports one",
    )
    budget: dict[str, Variance] | None = Field(
        default=None,
        description="the parts of the variance by cause, in the unit squared; their sum is sigma "
        "squared. Causes: noise, poses, drive_scale, depth, tilt, focal, mount, rim, level, shape, "
        "share, other; null if they are unknown",
    )


class Dimension(Figure):
    """A figure of a shape; of an ``unseen`` one the value is a bound."""

    status: Status = Field(
        description="measured; inferred: seen at one end, or by symmetry; unseen: the value is "
        "a bound",
    )


class SurfacePose(Part):
    """The top's area centroid and heading in ``frame``; covariance of x, y, yaw in the map."""

    x: Number = Field(description="metres; the top's area centroid in `frame`")
    y: Number = Field(description="metres; the top's area centroid in `frame`")
    yaw: Number = Field(
        description="radians in `frame`, counter-clockwise, of the top's own x axis, along its "
        "first length; in [0, the least turn that brings the shape onto itself), "
        "and 0 for a circle",
    )
    covariance: tuple[Row, Row, Row] = Field(
        description="3 x 3, rows and columns in the order x, y, yaw, of the table in `frame`; "
        "metres squared, metres times radians, radians squared"
    )


class Edge(Part):
    """One side of the outline and how much of it was seen."""

    points: tuple[Point, ...] = Field(
        max_length=MOST_POINTS,
        description="[x, y] each, metres in `frame`, counter-clockwise along the side, both "
        "ends included",
    )
    status: Status = Field(
        description="measured; inferred: seen in part, or by symmetry; unseen: it may lie "
        "further out",
    )
    sigma: Number | None = Field(
        description="metres across the side, standard deviation relative to the table; null "
        "where none is known",
    )
    seen_fraction: Number = Field(description="share of the side's length that was seen, 0 to 1")

    @property
    def is_straight(self) -> bool:
        """Whether it is a straight line, no arc."""
        return len(self.points) == 2


class Alternative(Part):
    """Another shape that was weighed, with its posterior weight."""

    shape: ShapeName = Field(description="name of the shape")
    score: Number = Field(description="posterior weight among all shapes that were weighed, 0 to 1")


class TableSurface(Part):
    """The top of the table; ``beside`` is the outline of another surface that touches it."""

    shape: ShapeName = Field(description="name of the shape")
    pose: SurfacePose = Field(description="place and heading of the top in `frame`")
    height: Figure = Field(description="metres above the floor (`floor_z`); the top's upper side")
    thickness: Figure | None = Field(
        description="metres of the top's slab; null where no side face showed it",
    )
    dimensions: dict[str, Dimension] = Field(description=DIMENSIONS)
    corner_radius: Dimension | None = Field(
        description="metres of rounded corners; null where they are sharp",
    )
    outline: tuple[Point, ...] = Field(
        max_length=MOST_POINTS,
        description="[x, y] each, metres in `frame`, counter-clockwise, the first point not "
        "repeated; a curve as a fine polygon",
    )
    edges: tuple[Edge, ...] = Field(
        max_length=MOST_POINTS, description="the sides of the outline, in its order"
    )
    score: Number = Field(
        description="posterior weight of the shape among all that were weighed, 0 to 1",
    )
    alternatives: tuple[Alternative, ...] = Field(
        description="the other shapes that were weighed",
    )
    beside: tuple[Point, ...] | None = Field(
        default=None,
        max_length=MOST_POINTS,
        description="outline of another surface that touches the top at its height: [x, y] each, "
        "metres in `frame`; null without one",
    )

    def contains(
        self, x: ArrayLike, y: ArrayLike, *, frame: Literal["map", "table"] = "map"
    ) -> Floats:
        """Return the probability that points lie on the top, seen from above.

        ``x`` and ``y`` are metres, numbers or arrays that broadcast; the result has their common
        shape. In ``map`` (the model's own frame, whatever its name) the pose's covariance and the
        sides' sigmas count. In ``table`` (origin at the pose, x along the length) only the sides'
        sigmas count, as for a robot that has just seen the table. The result is NaN for points that
        are not finite, and where it depends on a side that was not seen or has no sigma. Raises
        `TablemapError` if ``x`` and ``y`` are not numbers, their shapes do not fit, or the frame is
        unknown.
        """
        # Imported here: NumPy and SciPy take longer to import than a model takes to read.
        from tablemap.model.footprint import probability_on_top

        return probability_on_top(self, x, y, frame=frame)


class TableLeg(Part):
    """One leg: ``circle`` (diameter) or ``rectangle`` (length, width)."""

    shape: SectionName = Field(description="name of its cross-section")
    x: Number = Field(description="metres in `frame`; the cross-section's middle")
    y: Number = Field(description="metres in `frame`; the cross-section's middle")
    yaw: Number = Field(
        description="radians in `frame`, counter-clockwise, of its length; 0 for a circle",
    )
    status: Status = Field(
        description="measured; inferred: placed by symmetry, where no view could see it; "
        "unseen: the value is a bound",
    )
    position_sigma: Number | None = Field(
        description="metres along either axis, standard deviation relative to the table; null "
        "where none is known",
    )
    dimensions: dict[str, Dimension] = Field(
        description="metres across, by name: diameter of a circle, length and width of a rectangle",
    )


class PlanarPose(Part):
    """A pose in SE(2)."""

    x: Number = Field(description="metres in `frame`")
    y: Number = Field(description="metres in `frame`")
    yaw: Number = Field(description="radians in `frame`, counter-clockwise")


class PoseSigma(Part):
    """Standard deviations of a snapshot's place (metres) and heading (radians)."""

    xy: Number = Field(description="metres along either axis")
    yaw: Number = Field(description="radians")


class SnapshotPose(Part):
    """The pose of a snapshot, and the reason if it was not used."""

    stamp_ns: int = Field(description="nanoseconds; the snapshot's time in the recording")
    map_from_base: PlanarPose = Field(description="pose of the robot's base in `frame`")
    sigma: PoseSigma | None = Field(
        description="its standard deviations, relative to the other snapshots; null where unknown",
    )
    used: bool = Field(description="whether the model uses it")
    reason: str | None = Field(description="why it was not used; null where it was")


class Verdict(Part):
    """Whether the model can be trusted."""

    level: Level = Field(description="good; doubtful: look at the reasons; failed: not to be used")
    reasons: tuple[str, ...] = Field(description="the doubts, a sentence each")


class WarningEntry(Part):
    """A warning; its code is one of `tablemap.errors.WARNING_CODES`."""

    code: str = Field(
        description="what it is about, from a documented list; those that begin with "
        "`accuracy.` doubt the figures",
    )
    stage: str = Field(description="name of the stage that gave it")
    message: str = Field(description="a sentence for people")
    stamp_ns: int | None = Field(
        description="nanoseconds; the time in the recording that it is about; null: all of it",
    )


class CalibrationEntry(Part):
    """The camera's corrections by the floor, with their sigmas."""

    roll: Number = Field(
        description="radians about the base's x axis (the head's, where the error turns with the "
        "head), from the recorded camera to the corrected one",
    )
    pitch: Number = Field(
        description="radians about the base's y axis (the head's, where the error turns with the "
        "head), from the recorded camera to the corrected one",
    )
    depth_scale: Number = Field(description="factor on every recorded depth")
    sigma: tuple[Number, Number, Number] = Field(
        description="standard deviations in the order roll, pitch (radians), depth_scale (share)",
    )


class TableModel(Part):
    """A table as a robot can use it. Metres and radians, in the recording's ``frame``.

    - ``frame``: the map, or the recording's fixed frame
    - ``floor_z``: height of the floor in ``frame``; all other heights count from it
    - ``surface``: the top: shape, pose, dimensions, outline, edges
    - ``legs``: every leg that was found, or added by symmetry
    - ``snapshots``: poses of the base, and which views were used
    - ``calibration``: the camera's corrections by the floor, None without any
    - ``verdict``: whether the model can be trusted
    - ``warnings``: facts that the model's reader must know

    Raises `TablemapError` if a part is missing or not valid.
    """

    frame: str = Field(
        description="TF frame of every pose and point: the map, or what the recording has as "
        "its fixed frame",
    )
    floor_z: Number = Field(
        description="metres; the floor's height in `frame`; all other heights are measured from it",
    )
    surface: TableSurface = Field(description="the top")
    legs: tuple[TableLeg, ...] = Field(
        max_length=MOST_LEGS, description="every leg that was found, or placed by symmetry"
    )
    snapshots: tuple[SnapshotPose, ...] = Field(
        description="where the base stood, in the order of time, and which views were used",
    )
    calibration: CalibrationEntry | None = Field(
        default=None,
        description="corrections of the camera from floor and top; null where there are none",
    )
    verdict: Verdict = Field(description="whether the model is to be trusted")
    warnings: tuple[WarningEntry, ...] = Field(
        description="warnings, in the order of the stages",
    )

    @model_validator(mode="wrap")
    @classmethod
    def _say_what_is_wrong(cls, parts: Any, validated: ModelWrapValidatorHandler[Self]) -> Self:
        try:
            return validated(parts)
        except ValidationError as error:
            raise damage(error, NOUN) from error

    def to_json(self) -> str:
        """Return the text of ``table.json``.

        Raises `TablemapError` if a number is not finite.
        """
        document = {"schema": SCHEMA, **self.model_dump(mode="json")}
        try:
            return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        except ValueError as error:
            raise TablemapError(
                "expected finite numbers in the table model, found one that is not; JSON has none."
            ) from error

    def as_written(self) -> TableModel:
        """Return the model as its file holds it, so that all who tell its figures round alike."""
        return TableModel.from_json(self.to_json())

    @staticmethod
    def from_json(text: str) -> TableModel:
        """Read ``table.json``; unknown fields are ignored.

        Raises `TablemapError` if the text is no table model, or one of a later schema.
        """
        return parse_document(text, TableModel, schema=SCHEMA, noun=NOUN)

    @staticmethod
    def load(path: AnyPath) -> TableModel:
        """Read ``table.json``, or the one in a run folder.

        Raises `TablemapError` if there is none, or the file is no table model.
        """
        given = as_place(path)
        file = given / "table.json" if given.is_dir() else given
        return read_document(file, TableModel, schema=SCHEMA, noun=NOUN)


def json_schema() -> dict[str, object]:
    """Return the JSON Schema of ``table.json``; fields that it does not name are allowed."""
    return document_schema(TableModel, SCHEMA, mode="serialization")
