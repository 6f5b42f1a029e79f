"""The model of a table: what ``table.json`` holds, and how it is read and written.

Bytes repeat: keys keep their order, and numbers are rounded to the decimals that figures agree to
across machines' threads (micrometres, microradians; covariances to nine significant digits).
"""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    ModelWrapValidatorHandler,
    ValidationError,
    model_validator,
)
from pydantic.functional_serializers import PlainSerializer

from tablemap.errors import TablemapError
from tablemap.model.documents import damage, parse_document, read_document
from tablemap.model.shapes import SectionName, ShapeName
from tablemap.paths import AnyPath, as_path

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

SCHEMA = "tablemap/table/1"
NOUN = "table model"

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


class Part(BaseModel):
    """A part of the model: frozen; fields that a reader does not know are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class Figure(Part):
    """A value and its standard deviation; null where no covariance stands behind one."""

    value: Number
    sigma: Number | None


class Dimension(Figure):
    """A figure of a shape; of an ``unseen`` one the value is a bound."""

    status: Status


class SurfacePose(Part):
    """The top's area centroid and heading in ``frame``; covariance of x, y, yaw in the map."""

    x: Number
    y: Number
    yaw: Number
    covariance: tuple[
        tuple[Variance, Variance, Variance],
        tuple[Variance, Variance, Variance],
        tuple[Variance, Variance, Variance],
    ]


class Edge(Part):
    """One side of the outline and how much of it was seen."""

    points: tuple[Point, ...]
    status: Status
    sigma: Number | None
    seen_fraction: Number


class Alternative(Part):
    """Another shape that was weighed, with its posterior weight."""

    shape: ShapeName
    score: Number


class TableSurface(Part):
    """The top of the table; ``beside`` is the outline of what touches it and is no part of it."""

    shape: ShapeName
    pose: SurfacePose
    height: Figure
    thickness: Figure | None
    dimensions: dict[str, Dimension]
    corner_radius: Dimension | None
    outline: tuple[Point, ...]
    edges: tuple[Edge, ...]
    score: Number
    alternatives: tuple[Alternative, ...]
    beside: tuple[Point, ...] | None = None

    def contains(
        self, x: ArrayLike, y: ArrayLike, *, frame: Literal["map", "table"] = "map"
    ) -> NDArray[np.float64]:
        """Return the probability that points lie on the top, seen from above.

        ``x`` and ``y`` are metres, numbers or arrays that broadcast; what is returned has their
        common shape. In ``map`` (the model's own frame, whatever its name) the pose's covariance
        and the sides' sigmas count. In ``table`` (origin at the pose, x along the length) the
        sides' alone count: how sure a robot can be that has just seen the table. NaN where it is
        not known: where a side decides that was not seen or that has no sigma, and for points that
        are not finite. Raises `TablemapError` where ``x`` and ``y`` are no numbers, their shapes do
        not fit, or there is no such frame.
        """
        from tablemap.model.footprint import probability_on_top

        return probability_on_top(self, x, y, frame=frame)


class TableLeg(Part):
    """One leg: ``circle`` (diameter) or ``rectangle`` (length, width)."""

    shape: SectionName
    x: Number
    y: Number
    yaw: Number
    status: Status
    position_sigma: Number | None
    dimensions: dict[str, Dimension]


class PlanarPose(Part):
    """A pose in SE(2)."""

    x: Number
    y: Number
    yaw: Number


class PoseSigma(Part):
    """Standard deviations of a snapshot's place (metres) and heading (radians)."""

    xy: Number
    yaw: Number


class SnapshotPose(Part):
    """Where a snapshot was, and why it was not used."""

    stamp_ns: int
    map_from_base: PlanarPose
    sigma: PoseSigma | None
    used: bool
    reason: str | None


class Verdict(Part):
    """Whether the model is to be trusted."""

    level: Level
    reasons: tuple[str, ...]


class WarningEntry(Part):
    """A warning; its code is one of `tablemap.errors.WARNING_CODES`."""

    code: str
    stage: str
    message: str
    stamp_ns: int | None


class CalibrationEntry(Part):
    """What the floor said about the camera (radians, a factor, metres), and its sigmas."""

    roll: Number
    pitch: Number
    depth_scale: Number
    sigma: tuple[Number, Number, Number]


class TableModel(Part):
    """A table as a robot can use it. Metres and radians, in the recording's ``frame``.

    ``frame``: the map, or what the recording has as its fixed frame.
    ``floor_z``: height of the floor in ``frame``; all other heights count from it.
    ``surface``: the top: shape, pose, dimensions, outline, edges.
    ``legs``: every leg that was found, or put by symmetry.
    ``snapshots``: where the base stood, and which views were used.
    ``calibration``: what the floor said about the camera; None without one.
    ``verdict``: whether the model is to be trusted.
    ``warnings``: what its reader must know.

    Raises `TablemapError` where a part is missing or not as it should be.
    """

    frame: str
    floor_z: Number
    surface: TableSurface
    legs: tuple[TableLeg, ...]
    snapshots: tuple[SnapshotPose, ...]
    calibration: CalibrationEntry | None = None
    verdict: Verdict
    warnings: tuple[WarningEntry, ...]

    @model_validator(mode="wrap")
    @classmethod
    def _say_what_is_wrong(cls, parts: Any, validated: ModelWrapValidatorHandler[Self]) -> Self:
        try:
            return validated(parts)
        except ValidationError as error:
            raise damage(error, NOUN) from error

    def to_json(self) -> str:
        """Return the text of ``table.json``.

        Raises `TablemapError` where a number is not finite.
        """
        document = {"schema": SCHEMA, **self.model_dump(mode="json")}
        try:
            return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        except ValueError as error:
            raise TablemapError(
                "expected finite numbers in the table model, found one that is not; JSON has none."
            ) from error

    @staticmethod
    def from_json(text: str) -> TableModel:
        """Read ``table.json``; fields that are not known are ignored.

        Raises `TablemapError` where the text is no table model, or one of a later schema.
        """
        return parse_document(text, TableModel, schema=SCHEMA, noun=NOUN)

    @staticmethod
    def load(path: AnyPath) -> TableModel:
        """Read ``table.json``, or the one in a run folder.

        Raises `TablemapError` where there is none, or the file is no table model.
        """
        given = as_path(path)
        file = given / "table.json" if given.is_dir() else given
        return read_document(file, TableModel, schema=SCHEMA, noun=NOUN)


def json_schema() -> dict[str, object]:
    """Return the JSON Schema of ``table.json``; fields that it does not name are allowed."""
    schema = TableModel.model_json_schema(mode="serialization")
    schema["properties"] = {"schema": {"const": SCHEMA}, **schema["properties"]}
    schema["required"] = ["schema", *schema["required"]]
    return schema
