"""Where the doubts are: the places of a model's warnings, outlined where its stage is shown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from tablemap import palette
from tablemap.errors import DOUBT, ProcessWarning, WarnedPlace, is_doubt
from tablemap.geometry import Floats
from tablemap.model import TableModel
from tablemap.review.eyes import edges_eye, legs_eye, overview_eye, stops_eye, views_eye
from tablemap.review.room import Eye, Room
from tablemap.review.scene import DrawnScene
from tablemap.review.stream import Stream

MOST_CORNERS = 12
"""A body with more has not an upright edge at each, but four."""
LIFT = 0.008  # metres above the top, so that sides and edge points do not hide the lines
STAGES = {
    "overview": None,
    "views": ("snapshots", "calibration", "segmentation"),
    "registration": ("odometry", "registration"),
    "surface": ("outline", "surface", "crosscheck", "legs"),
    "legs": ("legs",),
}
"""The stages whose doubts a view shows; None: all."""
EYES: dict[str, Callable[[DrawnScene], Eye]] = {
    "overview": overview_eye,
    "views": views_eye,
    "registration": stops_eye,
    "surface": edges_eye,
    "legs": legs_eye,
}


@dataclass(frozen=True, eq=False)
class DoubtLines:
    """A doubt's name, the stage that gives it, and its lines (n, 3) in the map."""

    name: str
    stage: str
    lines: tuple[NDArray[np.float64], ...]


class Doubted:
    """Takes the results of a run, and tells which places the doubts of its model are about."""

    def __init__(self) -> None:
        self._said: dict[type, tuple[ProcessWarning, ...]] = {}

    def take(self, result: object) -> None:
        """Take a result; one of a stage that ran again takes the place of the first."""
        if not isinstance(result, TableModel):
            self._said[type(result)] = tuple(getattr(result, "warnings", ()))

    def of(self, model: TableModel) -> list[DoubtLines]:
        """Return the places of those doubts that are in the model: others were withdrawn."""
        kept = {(one.code, one.message) for one in model.warnings if is_doubt(one.code)}
        return [
            DoubtLines(
                one.code.removeprefix(DOUBT).replace("_", " "),
                one.stage,
                tuple(line for place in one.places for line in _lines(place, model)),
            )
            for said in self._said.values()
            for one in said
            if one.places and (one.code, one.message) in kept
        ]


def _lines(place: WarnedPlace, model: TableModel) -> Iterator[NDArray[np.float64]]:
    flat = np.array(place.points, dtype=np.float64).reshape(-1, 2)
    upper = model.surface.height.value + LIFT if place.height is None else place.height
    top = _level(flat, model.floor_z + upper)
    yield top
    if place.bottom is not None:
        bottom = _level(flat, model.floor_z + place.bottom)
        yield bottom
        step = 1 if len(flat) <= MOST_CORNERS else len(flat) // 4
        yield from np.stack([top, bottom], axis=1)[:-1:step]


def _level(flat: Floats, z: float) -> Floats:
    return np.column_stack([flat, np.full(len(flat), z)])


def log_doubts(
    stream: Stream,
    doubts: list[DoubtLines],
    rooms: Mapping[str, Room],
    *,
    views: Iterable[str] = tuple(STAGES),
) -> None:
    """Outline the doubts in each view of their stages, with their names.

    ``rooms`` are what pictures of the views have left; names in others stand clear of the table.
    """
    stream.hold()
    for view in views:
        stages = STAGES[view]
        shown = [one for one in doubts if stages is None or one.stage in stages]
        if shown:
            _log(stream, view, shown, rooms.get(view) or _room(stream.scene, EYES[view]))


def _room(scene: DrawnScene, eye_of: Callable[[DrawnScene], Eye]) -> Room:
    room = Room(eye_of(scene))
    if scene.outline is not None and len(scene.outline):
        room.take_solid(scene.outline, scene.height, scene.height)
    return room


def _log(stream: Stream, view: str, doubts: Iterable[DoubtLines], room: Room) -> None:
    lines = [(one.name, line) for one in doubts for line in one.lines]
    for _, line in lines:
        room.take_line(line)
    stream.log(
        f"doubts/{view}",
        rr.LineStrips3D(
            [line for _, line in lines],
            colors=[palette.DOUBT.on_dark],
            radii=rr.Radius.ui_points(2.5),
            labels=[name for name, _ in lines],
            show_labels=False,
        ),
    )
    centre = np.array(stream.scene.centre or (0.0, 0.0))
    names = [one.name for one in doubts]
    anchors = np.array([farthest(one.lines[0], centre) for one in doubts])
    placed = room.names(names, anchors, away=anchors[:, :2] - centre)
    stream.names(f"doubts/{view}/names", placed.places, names, leaders=placed.leaders)


def farthest(line: NDArray[np.float64], centre: Floats) -> NDArray[np.float64]:
    """Return the point of a line (n, 2 or 3) that is farthest from a place (2,), for its name."""
    away = np.linalg.norm(line[:, :2] - centre, axis=1)
    return np.asarray(line[np.argmax(away)])
