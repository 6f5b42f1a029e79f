"""The tables beside the chosen one: each has its entities below ``/tables/NN`` instead of ``/``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from tablemap import palette
from tablemap.events import OfTable, OtherTable
from tablemap.geometry import Pose2
from tablemap.review import story
from tablemap.review.crosscheck import log_cross_check
from tablemap.review.doubted import Doubted, log_doubts
from tablemap.review.eyes import table_eye
from tablemap.review.scene import DrawnScene
from tablemap.review.solid import log_model
from tablemap.review.stream import Stream
from tablemap.review.supports import log_legs
from tablemap.review.top import TopDrawing
from tablemap.stages.crosscheck import CrossCheck
from tablemap.stages.legs import Legs
from tablemap.stages.outline import Outline
from tablemap.stages.surface import Surface


class Tables:
    """Draws the results about the other tables, and their models in muted colours."""

    def __init__(self) -> None:
        self._poses: tuple[Pose2, ...] = ()
        self._scenes: dict[int, DrawnScene] = {}
        self._places: dict[int, dict[type, Callable[[Stream, Any], Any]]] = {}
        self._doubted: dict[int, Doubted] = {}

    def take_poses(self, poses: tuple[Pose2, ...]) -> None:
        """Take the registered poses, by snapshot index."""
        self._poses = poses

    def log_result(self, stream: Stream, one: OfTable) -> None:
        """Log one result about such a table.

        Raises `TypeError` for an unknown type.
        """
        scene = self._scene(stream, one.number)
        place = self._places[one.number].get(type(one.result))
        if place is None:
            raise TypeError(f"{type(one.result).__name__} of another table has no place")
        self._doubted[one.number].take(one.result)
        with stream.within(entity(one.number), scene):
            place(stream, one.result)

    def log_outcome(self, stream: Stream, other: OtherTable) -> None:
        """Log its model as a solid with dimensions and summary, or why there is none."""
        if not isinstance(other.outcome, str):
            with stream.within(entity(other.number), self._scene(stream, other.number)):
                model = other.outcome
                room = log_model(stream, model, tint=palette.LEFT_OUT.on_dark, eye_of=table_eye)
                doubts = self._doubted[other.number].of(model)
                log_doubts(stream, doubts, {"overview": room}, views=("overview",))
            return
        stream.hold()
        page = story.no_other_model(other.number, other.outcome)
        stream.text(f"{entity(other.number)}/summary", page)
        if stream.config.level != "off":
            message = f"table {other.number:02d} has no model: {other.outcome}"
            stream.say(message)

    def _scene(self, stream: Stream, number: int) -> DrawnScene:
        """Return the scene of a table: its own place and shape, everything else as before."""
        if number not in self._scenes:
            self._scenes[number] = replace(stream.scene, chosen="", tables={}, best=None)
            self._doubted[number] = Doubted()
            top = TopDrawing()
            top.take_poses(self._poses)
            self._places[number] = {
                Outline: top.log_outline,
                Surface: top.log_surface,
                CrossCheck: log_cross_check,
                Legs: partial(log_legs, eye_of=table_eye),
            }
            stream.scene.tables[number] = self._scenes[number]
        return self._scenes[number]


def entity(number: int) -> str:
    """Return the entity below which a table's results are logged."""
    return f"tables/{number:02d}"
