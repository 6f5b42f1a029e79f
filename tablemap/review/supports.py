"""Drawings of the legs: evidence, rejected clusters, and fits."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import rerun as rr

from tablemap import palette
from tablemap.geometry import Floats, Pose2
from tablemap.model.shapes import shape_named
from tablemap.review import colours, text
from tablemap.review.clouds import closed, raised
from tablemap.review.eyes import legs_eye
from tablemap.review.numbering import letter
from tablemap.review.room import Eye, Room
from tablemap.review.scene import DrawnScene
from tablemap.review.stream import Stream
from tablemap.stages.legs import Leg, Legs, RejectedCluster

MOST_LETTERS = 12
"""Of the clusters with the most points; the others have theirs on hovering."""
LEG_WITHOUT_SIZE = 0.04  # metres
DOT = 3  # pixels, radius of a drawn point


def log_legs(stream: Stream, legs: Legs, *, eye_of: Callable[[DrawnScene], Eye] = legs_eye) -> Room:
    """Log the evidence near the table, each leg with its points, and the rejected with reasons.

    ``eye_of`` gives the eye of the view that shows them. Return the room that its picture has left.
    """
    stream.hold()
    stream.text("legs/summary", text.legs(legs))
    height = stream.scene.laser_height
    if len(legs.evidence):
        stream.log(
            "legs/evidence",
            rr.Points3D(
                raised(legs.evidence, height),
                colors=[palette.LASER.on_dark],
                radii=rr.Radius.ui_points(1.5),
            ),
        )
    for index, leg in enumerate(legs.legs, start=1):
        _log_leg(stream, index, leg, height)
    _log_rejected(stream, legs.rejected, height)
    return _log_names(stream, legs, height, eye_of(stream.scene))


def _log_names(stream: Stream, legs: Legs, height: float, eye: Eye) -> Room:
    """Name the legs, and what is none by letters, clear of all points and away from the table."""
    scene, rejected = stream.scene, legs.rejected
    room = Room(eye)
    for leg in legs.legs:
        room.take_solid(leg_outline(leg), scene.floor_z, scene.height)
    if scene.outline is not None and len(scene.outline):
        room.take_line(closed(scene.outline, scene.height))
    drawn = [legs.evidence, *[leg.points for leg in legs.legs], *[one.points for one in rejected]]
    room.take_points(np.concatenate([raised(points, height) for points in drawn]), reach=DOT)
    feet = np.array([(leg.x, leg.y) for leg in legs.legs]).reshape(-1, 2)
    places = np.array([(one.x, one.y) for one in rejected]).reshape(-1, 2)
    largest = sorted(range(len(rejected)), key=lambda k: -len(rejected[k].points))
    lettered = sorted(largest[:MOST_LETTERS])
    centre = np.array(scene.centre or np.concatenate([feet, places, np.zeros((1, 2))]).mean(axis=0))
    for path, texts, ends in (
        ("names", [_named(k, leg) for k, leg in enumerate(legs.legs, start=1)], feet),
        ("rejected/names", [letter(k) for k in lettered], places[lettered]),
    ):
        if texts:
            placed = room.names(texts, raised(ends, height), away=ends - centre)
            stream.names(f"legs/{path}", placed.places, texts, leaders=placed.leaders)
    return room


def _log_leg(stream: Stream, index: int, leg: Leg, height: float) -> None:
    if len(leg.points):
        stream.log(
            f"legs/{index:02d}/points",
            rr.Points3D(
                raised(leg.points, height),
                colors=[colours.of_stop(index)],
                radii=rr.Radius.ui_points(2.5),
            ),
        )
    stream.log(
        f"legs/{index:02d}/fit",
        rr.LineStrips3D(
            [raised(leg_outline(leg), height)],
            colors=[colours.STATUS[leg.status]],
            radii=rr.Radius.ui_points(2.0),
            labels=[_named(index, leg)],
            show_labels=False,
        ),
    )


def _named(index: int, leg: Leg) -> str:
    return f"leg {index}: {leg.shape}, {leg.status}"


def leg_outline(leg: Leg) -> Floats:
    """Return a leg's closed outline (n, 2) in the map."""
    sizes = {name: figure.value for name, figure in leg.dimensions.items()}
    return section(leg.shape, Pose2(leg.x, leg.y, leg.yaw), sizes)


def section(shape: str, pose: Pose2, sizes: Mapping[str, float]) -> Floats:
    """Return a cross-section's closed outline (n, 2) in the map."""
    record = shape_named(shape)
    half = np.array(record.extents(sizes) or (LEG_WITHOUT_SIZE, LEG_WITHOUT_SIZE)) / 2
    if record.is_elliptic:
        angles = np.linspace(0, 2 * np.pi, 37)
        return pose.apply(half * np.column_stack([np.cos(angles), np.sin(angles)]))
    return pose.apply(half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]]))


def _log_rejected(stream: Stream, rejected: tuple[RejectedCluster, ...], height: float) -> None:
    if not rejected:
        return
    points = [raised(one.points, height) for one in rejected if len(one.points)]
    if points:
        stream.log(
            "legs/rejected/points",
            rr.Points3D(
                np.concatenate(points),
                colors=[palette.LEFT_OUT.on_dark],
                radii=rr.Radius.ui_points(2.0),
            ),
        )
    stream.names(
        "legs/rejected/reasons",
        [(one.x, one.y, height + 0.05) for one in rejected],
        [f"{letter(k)}: {one.reason}" for k, one in enumerate(rejected)],
        shown=False,
    )
