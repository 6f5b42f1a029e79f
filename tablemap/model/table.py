"""The model of a table: the contents of ``table.json``, and how it is read and written.

Equal runs give equal bytes: keys keep their order, and numbers are rounded, as their last bits
depend on threads (micrometres, microradians; covariances to nine significant digits).
"""

import json
from typing import TYPE_CHECKING, Annotated, Literal

from msgspec import Meta

from tablemap.errors import TablemapError
from tablemap.model.documents import (
    DocumentPart,
    document_schema,
    parse_document,
    read_document,
)
from tablemap.model.shape_names import SectionName, ShapeName
from tablemap.model.shapes import DIMENSIONS
from tablemap.paths import AnyPath, as_place
from tablemap.schemas import MOST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tablemap.geometry import Floats

SCHEMA = "tablemap/table/1"
NOUN = "table model"
MOST_POINTS, MOST_LEGS = 10_000, 1000
"""No table has more; files of others may claim more."""

Status = Literal["measured", "inferred", "unseen"]
Level = Literal["good", "doubtful", "failed"]


def _micro(value: float) -> float:
    return round(value, 6) + 0.0


def _significant(value: float) -> float:
    return float(f"{value:.9g}") + 0.0


Number = Annotated[float, Meta(ge=-MOST, le=MOST, extra={"write": _micro})]
"""Metres, radians or a share, finite; written to six decimals."""
Variance = Annotated[float, Meta(ge=-MOST, le=MOST, extra={"write": _significant})]
"""An element of a covariance, finite; written to nine significant digits."""
Point = tuple[Number, Number]
Points = Annotated[tuple[Point, ...], Meta(max_length=MOST_POINTS)]
Row = tuple[Variance, Variance, Variance]


class Figure(DocumentPart, frozen=True, kw_only=True):
    """A value and its standard deviation; null if no data supports one."""

    value: Annotated[Number, Meta(description="metres, or radians of an angle")]
    sigma: Annotated[
        Number | None,
        Meta(description="its standard deviation, in the same unit; null if no data supports one"),
    ]
    budget: Annotated[
        dict[str, Variance] | None,
        Meta(
            description="the parts of the variance by cause, in the unit squared; their sum is "
            "sigma squared. Causes: noise, poses, drive_scale, depth, tilt, focal, mount, rim, "
            "level, shape, share, other; null if they are unknown",
        ),
    ] = None


class Dimension(Figure, frozen=True, kw_only=True):
    """A figure of a shape; of an ``unseen`` one the value is a bound."""

    status: Annotated[
        Status,
        Meta(
            description="measured; inferred: seen at one end, or by symmetry; unseen: the value "
            "is a bound",
        ),
    ]


class SurfacePose(DocumentPart, frozen=True, kw_only=True):
    """The top's area centroid and heading in ``frame``; covariance of x, y, yaw in the map."""

    x: Annotated[Number, Meta(description="metres; the top's area centroid in `frame`")]
    y: Annotated[Number, Meta(description="metres; the top's area centroid in `frame`")]
    yaw: Annotated[
        Number,
        Meta(
            description="radians in `frame`, counter-clockwise, of the top's own x axis, along "
            "its first length; in [0, the least turn that brings the shape onto itself), and 0 "
            "for a circle",
        ),
    ]
    covariance: Annotated[
        tuple[Row, Row, Row],
        Meta(
            description="3 x 3, rows and columns in the order x, y, yaw, of the table in `frame`; "
            "metres squared, metres times radians, radians squared",
        ),
    ]


class Edge(DocumentPart, frozen=True, kw_only=True):
    """One side of the outline and how much of it was seen."""

    points: Annotated[
        Points,
        Meta(
            description="[x, y] each, metres in `frame`, counter-clockwise along the side, both "
            "ends included",
        ),
    ]
    status: Annotated[
        Status,
        Meta(
            description="measured; inferred: seen in part, or by symmetry; unseen: it may lie "
            "further out",
        ),
    ]
    sigma: Annotated[
        Number | None,
        Meta(
            description="metres across the side, standard deviation relative to the table; null "
            "where none is known",
        ),
    ]
    seen_fraction: Annotated[
        Number,
        Meta(description="share of the side's length that was seen, 0 to 1"),
    ]

    @property
    def is_straight(self) -> bool:
        """Whether it is a straight line, no arc."""
        return len(self.points) == 2


class Alternative(DocumentPart, frozen=True, kw_only=True):
    """Another shape that was weighed, with its posterior weight."""

    shape: Annotated[ShapeName, Meta(description="name of the shape")]
    score: Annotated[
        Number,
        Meta(description="posterior weight among all shapes that were weighed, 0 to 1"),
    ]


class TableSurface(DocumentPart, frozen=True, kw_only=True):
    """The top of the table; ``beside`` is the outline of another surface that touches it."""

    shape: Annotated[ShapeName, Meta(description="name of the shape")]
    pose: Annotated[SurfacePose, Meta(description="place and heading of the top in `frame`")]
    height: Annotated[
        Figure,
        Meta(description="metres above the floor (`floor_z`); the top's upper side"),
    ]
    thickness: Annotated[
        Figure | None,
        Meta(description="metres of the top's slab; null where no side face showed it"),
    ]
    dimensions: Annotated[dict[str, Dimension], Meta(description=DIMENSIONS)]
    corner_radius: Annotated[
        Dimension | None,
        Meta(description="metres of rounded corners; null where they are sharp"),
    ]
    outline: Annotated[
        Points,
        Meta(
            description="[x, y] each, metres in `frame`, counter-clockwise, the first point not "
            "repeated; a curve as a fine polygon",
        ),
    ]
    edges: Annotated[
        tuple[Edge, ...],
        Meta(max_length=MOST_POINTS, description="the sides of the outline, in its order"),
    ]
    score: Annotated[
        Number,
        Meta(description="posterior weight of the shape among all that were weighed, 0 to 1"),
    ]
    alternatives: Annotated[
        tuple[Alternative, ...],
        Meta(description="the other shapes that were weighed"),
    ]
    beside: Annotated[
        Points | None,
        Meta(
            description="outline of another surface that touches the top at its height: [x, y] "
            "each, metres in `frame`; null without one",
        ),
    ] = None

    def contains(
        self, x: "ArrayLike", y: "ArrayLike", *, frame: Literal["map", "table"] = "map"
    ) -> "Floats":
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


class TableLeg(DocumentPart, frozen=True, kw_only=True):
    """One leg: ``circle`` (diameter) or ``rectangle`` (length, width)."""

    shape: Annotated[SectionName, Meta(description="name of its cross-section")]
    x: Annotated[Number, Meta(description="metres in `frame`; the cross-section's middle")]
    y: Annotated[Number, Meta(description="metres in `frame`; the cross-section's middle")]
    yaw: Annotated[
        Number,
        Meta(description="radians in `frame`, counter-clockwise, of its length; 0 for a circle"),
    ]
    status: Annotated[
        Status,
        Meta(
            description="measured; inferred: placed by symmetry, where no view could see it; "
            "unseen: the value is a bound",
        ),
    ]
    position_sigma: Annotated[
        Number | None,
        Meta(
            description="metres along either axis, standard deviation relative to the table; null "
            "where none is known",
        ),
    ]
    dimensions: Annotated[
        dict[str, Dimension],
        Meta(
            description="metres across, by name: diameter of a circle, length and width of a "
            "rectangle",
        ),
    ]


class PlanarPose(DocumentPart, frozen=True, kw_only=True):
    """A pose in SE(2)."""

    x: Annotated[Number, Meta(description="metres in `frame`")]
    y: Annotated[Number, Meta(description="metres in `frame`")]
    yaw: Annotated[Number, Meta(description="radians in `frame`, counter-clockwise")]


class PoseSigma(DocumentPart, frozen=True, kw_only=True):
    """Standard deviations of a snapshot's place (metres) and heading (radians)."""

    xy: Annotated[Number, Meta(description="metres along either axis")]
    yaw: Annotated[Number, Meta(description="radians")]


class SnapshotPose(DocumentPart, frozen=True, kw_only=True):
    """The pose of a snapshot, and the reason if it was not used."""

    stamp_ns: Annotated[int, Meta(description="nanoseconds; the snapshot's time in the recording")]
    map_from_base: Annotated[PlanarPose, Meta(description="pose of the robot's base in `frame`")]
    sigma: Annotated[
        PoseSigma | None,
        Meta(
            description="its standard deviations, relative to the other snapshots; null where "
            "unknown",
        ),
    ]
    used: Annotated[bool, Meta(description="whether the model uses it")]
    reason: Annotated[str | None, Meta(description="why it was not used; null where it was")]


class Verdict(DocumentPart, frozen=True, kw_only=True):
    """Whether the model can be trusted."""

    level: Annotated[
        Level,
        Meta(description="good; doubtful: look at the reasons; failed: not to be used"),
    ]
    reasons: Annotated[tuple[str, ...], Meta(description="the doubts, a sentence each")]


class WarningEntry(DocumentPart, frozen=True, kw_only=True):
    """A warning; its code is one of `tablemap.errors.WARNING_CODES`."""

    code: Annotated[
        str,
        Meta(
            description="what it is about, from a documented list; those that begin with "
            "`accuracy.` doubt the figures",
        ),
    ]
    stage: Annotated[str, Meta(description="name of the stage that gave it")]
    message: Annotated[str, Meta(description="a sentence for people")]
    stamp_ns: Annotated[
        int | None,
        Meta(
            description="nanoseconds; the time in the recording that it is about; null: all of it",
        ),
    ]


class CalibrationEntry(DocumentPart, frozen=True, kw_only=True):
    """The camera's corrections by the floor, with their sigmas."""

    roll: Annotated[
        Number,
        Meta(
            description="radians about the base's x axis (the head's, where the error turns with "
            "the head), from the recorded camera to the corrected one",
        ),
    ]
    pitch: Annotated[
        Number,
        Meta(
            description="radians about the base's y axis (the head's, where the error turns with "
            "the head), from the recorded camera to the corrected one",
        ),
    ]
    depth_scale: Annotated[Number, Meta(description="factor on every recorded depth")]
    sigma: Annotated[
        tuple[Number, Number, Number],
        Meta(
            description="standard deviations in the order roll, pitch (radians), depth_scale "
            "(share)",
        ),
    ]


class TableModel(DocumentPart, frozen=True, kw_only=True):
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

    frame: Annotated[
        str,
        Meta(
            description="TF frame of every pose and point: the map, or what the recording has as "
            "its fixed frame",
        ),
    ]
    floor_z: Annotated[
        Number,
        Meta(
            description="metres; the floor's height in `frame`; all other heights are measured "
            "from it",
        ),
    ]
    surface: Annotated[TableSurface, Meta(description="the top")]
    legs: Annotated[
        tuple[TableLeg, ...],
        Meta(max_length=MOST_LEGS, description="every leg that was found, or placed by symmetry"),
    ]
    snapshots: Annotated[
        tuple[SnapshotPose, ...],
        Meta(description="where the base stood, in the order of time, and which views were used"),
    ]
    calibration: Annotated[
        CalibrationEntry | None,
        Meta(description="corrections of the camera from floor and top; null where there are none"),
    ] = None
    verdict: Annotated[Verdict, Meta(description="whether the model is to be trusted")]
    warnings: Annotated[
        tuple[WarningEntry, ...],
        Meta(description="warnings, in the order of the stages"),
    ]

    def to_json(self) -> str:
        """Return the text of ``table.json``.

        Raises `TablemapError` if a number is not finite.
        """
        document = {"schema": SCHEMA, **self.fields()}
        try:
            return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        except ValueError as error:
            raise TablemapError(
                "expected finite numbers in the table model, found one that is not; JSON has none."
            ) from error

    def as_written(self) -> "TableModel":
        """Return the model as its file holds it, so that all who tell its figures round alike."""
        return TableModel.from_json(self.to_json())

    @staticmethod
    def from_json(text: str) -> "TableModel":
        """Read ``table.json``; unknown fields are ignored.

        Raises `TablemapError` if the text is no table model, or one of a later schema.
        """
        return parse_document(text, TableModel, schema=SCHEMA, noun=NOUN)

    @staticmethod
    def load(path: AnyPath) -> "TableModel":
        """Read ``table.json``, or the one in a run folder.

        Raises `TablemapError` if there is none, or the file is no table model.
        """
        given = as_place(path)
        file = given / "table.json" if given.is_dir() else given
        return read_document(file, TableModel, schema=SCHEMA, noun=NOUN)


def json_schema() -> dict[str, object]:
    """Return the JSON Schema of ``table.json``; fields that it does not name are allowed."""
    return document_schema(TableModel, SCHEMA, mode="serialization")
