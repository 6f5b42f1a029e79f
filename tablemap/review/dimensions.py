"""Dimension lines with their numbers beside a table."""

from __future__ import annotations

import numpy as np
import rerun as rr
import shapely

from tablemap import palette
from tablemap.geometry import Floats, Pose2
from tablemap.model import Figure, TableModel
from tablemap.model.shapes import shape_named
from tablemap.review import colours
from tablemap.review.room import Room
from tablemap.review.stream import Stream

DIMENSION_OFFSET = 0.18
TICK = 0.04  # metres by which extension lines pass the dimension lines
MOST_LABELLED_EDGES = 12
LINE_PX = 5


def log_dimensions(
    stream: Stream, model: TableModel, outline: Floats, top: float, room: Room
) -> None:
    """Log the named lengths, or a polygon's sides, and the height ``top`` above the floor.

    Their names stand where ``room`` is clear, away from the table.
    """
    lines: list[Floats] = []
    labels: list[str] = []
    tints: list[palette.Colour] = []
    for name, ends in _spans(model).items():
        figure = model.surface.dimensions[name]
        lines.append(np.column_stack([ends, [top, top]]))
        labels.append(f"{name} {_written(figure)}")
        tints.append(colours.STATUS[figure.status])
    extensions = _extensions(lines, outline, top)
    straight = [edge for edge in model.surface.edges if edge.is_straight]
    if not lines and len(straight) <= MOST_LABELLED_EDGES:
        polygon = shapely.Polygon(outline)
        for edge in straight:
            side = np.array(edge.points, dtype=np.float64)
            reach = float(np.linalg.norm(np.diff(side, axis=0), axis=1).sum())
            beside = _beside(side, polygon)
            lines.append(np.column_stack([beside, np.full(len(side), top)]))
            labels.append(f"{reach:.3f} m")
            tints.append(colours.STATUS[edge.status])
    foot = _lowest_corner(model, outline)
    lines.append(np.array([[*foot, model.floor_z], [*foot, top]]))
    labels.append(f"height {_written(model.surface.height)}")
    tints.append(palette.TEXT.on_dark)
    stream.log(
        "model/dimensions",
        rr.LineStrips3D(
            lines, labels=labels, colors=tints, radii=rr.Radius.ui_points(2.0), show_labels=False
        ),
    )
    for line in lines:
        room.take_line(line, width=LINE_PX)
    for line in extensions:
        room.take_line(line)
    centre = np.array([model.surface.pose.x, model.surface.pose.y])
    middles = np.array([line.mean(axis=0) for line in lines])
    placed = room.names(labels, middles, away=middles[:, :2] - centre)
    stream.names("model/dimensions/names", placed.places, labels, leaders=placed.leaders)
    if extensions:
        stream.log(
            "model/dimensions/extensions",
            rr.LineStrips3D(
                extensions, colors=[palette.LEFT_OUT.on_dark], radii=rr.Radius.ui_points(0.8)
            ),
        )


def _extensions(lines: list[Floats], outline: Floats, top: float) -> list[Floats]:
    """Return the extension lines, from the outline's corners past the dimension lines' ends."""
    extensions = []
    for end in (end for line in lines for end in line[:, :2]):
        corner = outline[np.argmin(np.linalg.norm(outline - end, axis=1))]
        away = float(np.linalg.norm(end - corner))
        if away > TICK:
            past = end + TICK * (end - corner) / away
            extensions.append(np.column_stack([[corner, past], [top, top]]))
    return extensions


def _beside(side: Floats, polygon: shapely.Polygon) -> Floats:
    """Return a side (n, 2) moved a third of the dimension lines' distance out of the polygon."""
    along = side[-1] - side[0]
    out = np.array([along[1], -along[0]]) / max(float(np.linalg.norm(along)), 1e-9)
    if polygon.contains(shapely.Point(side.mean(axis=0) + 0.01 * out)):
        out = -out
    return np.asarray(side + out * DIMENSION_OFFSET / 3)


def _written(figure: Figure) -> str:
    if figure.sigma is None:
        return f"{figure.value:.3f} m"
    return f"{figure.value:.3f} m ± {1000 * figure.sigma:.1f} mm"


def _lowest_corner(model: TableModel, outline: Floats) -> Floats:
    """Return the place of the height: beside the corner at which the outline's length begins."""
    centre = np.array([model.surface.pose.x, model.surface.pose.y])
    towards = Pose2(0, 0, model.surface.pose.yaw).rotate(np.array([-1.0, -1.0]))
    corner = outline[np.argmax((outline - centre) @ towards)]
    away = corner - centre
    return np.asarray(corner + DIMENSION_OFFSET * away / max(float(np.linalg.norm(away)), 1e-9))


def _spans(model: TableModel) -> dict[str, Floats]:
    """Return for each length of the top its two ends (2, 2) in the map.

    The line lies beside a top with sides, and runs through the middle of a round top.
    """
    surface, record = model.surface, shape_named(model.surface.shape)
    sizes = {name: figure.value for name, figure in surface.dimensions.items()}
    extents = record.extents(sizes)
    if extents is None:
        return {}
    angle = sizes.get(record.angle, np.pi / 2) if record.angle else np.pi / 2
    along = np.array([extents[0] / 2, 0.0])
    across = np.array([np.cos(angle), np.sin(angle)]) * extents[1] / 2
    first, second = np.array([-along, along]), np.array([-across, across])
    if not record.is_round:
        first = first - across + [0.0, -DIMENSION_OFFSET]
        second = second + along + np.array([np.sin(angle), -np.cos(angle)]) * DIMENSION_OFFSET
    pose = Pose2(surface.pose.x, surface.pose.y, surface.pose.yaw)
    spans = zip(record.lengths, (first, second), strict=False)
    return {name: pose.apply(ends) for name, ends in spans}
