"""Drawings of the legs: evidence, rejected clusters, and fits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from tablemap import palette
from tablemap.geometry import Floats, Pose2
from tablemap.model.shapes import shape_named
from tablemap.review import colours, text
from tablemap.review.clouds import raised
from tablemap.review.eyes import legs_eye
from tablemap.review.room import Room
from tablemap.review.stream import DrawnScene, Stream
from tablemap.stages.legs import Leg, Legs, RejectedCluster

MOST_LETTERS = 12
LEG_WITHOUT_SIZE = 0.04  # metres
MARK = 0.05  # metres that a leg's points are spread
SQUARE = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])


def log_legs(stream: Stream, legs: Legs) -> None:
    """Log the evidence near the table, each leg with its points, and the rejected with reasons."""
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
    if legs.legs:
        places = raised(np.array([(leg.x, leg.y) for leg in legs.legs]), height)
        names = [_named(k, leg) for k, leg in enumerate(legs.legs, start=1)]
        stream.names("legs/names", _beside(stream.scene, legs.legs, places, names), names)
    _log_rejected(stream, legs.rejected, height)


def _beside(
    scene: DrawnScene,
    legs: Sequence[Leg],
    places: NDArray[np.floating],
    names: Sequence[str],
) -> Floats:
    """Return where the names (n, 3) are clear of the legs and their points, away from the table."""
    room = Room(legs_eye(scene))
    for leg, place in zip(legs, places, strict=True):
        room.take_solid(leg_outline(leg), scene.floor_z, scene.height)
        room.take_solid(place[:2] + MARK * SQUARE, float(place[2]), float(place[2]))
    centre = np.array(scene.centre or places[:, :2].mean(axis=0))
    return np.array(
        [
            room.place(name, place.astype(np.float64), away=place[:2] - centre)
            for name, place in zip(names, places, strict=True)
        ]
    )


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
        [f"{text.letter(k)}: {one.reason}" for k, one in enumerate(rejected)],
        shown=False,
    )
    stream.names(
        "legs/rejected/names",
        [(one.x, one.y, height + 0.05) for one in rejected],
        [text.letter(k) for k in range(len(rejected))],
        shown=len(rejected) <= MOST_LETTERS,
    )
