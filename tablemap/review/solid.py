"""The final model as solid shapes in the room, with its dimensions and its uncertainty."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import rerun as rr
import shapely
from numpy.typing import NDArray

from tablemap import palette
from tablemap.geometry import Floats, Pose2
from tablemap.model import TableLeg, TableModel
from tablemap.model.shapes import shape_named
from tablemap.review import colours, story
from tablemap.review.clouds import raised
from tablemap.review.dimensions import log_dimensions
from tablemap.review.eyes import overview_eye
from tablemap.review.room import Eye, Room
from tablemap.review.scene import DrawnScene
from tablemap.review.stream import Stream
from tablemap.review.supports import LEG_WITHOUT_SIZE, section

DRAWN_THICKNESS = 0.03
MAGNIFICATIONS = (50.0, 20.0, 10.0, 5.0, 2.0, 1.0)
MOST_DRAWN = 0.2  # of the table's reach: largest drawn size of a magnified interval
TWO_SIDED_95 = 1.96
ELLIPSE_95 = 2.448


def log_model(
    stream: Stream,
    model: TableModel,
    *,
    tint: palette.Colour = palette.MODEL.on_dark,
    eye_of: Callable[[DrawnScene], Eye] = overview_eye,
    lines: Sequence[NDArray[np.floating]] = (),
    points: NDArray[np.floating] | None = None,
) -> Room:
    """Log top and legs as solids, dimension lines with numbers, and magnified 95 % bands.

    ``eye_of`` gives the eye of the view that shows them; ``lines`` (n, 3) and ``points`` (n, 3) are
    what else is drawn there.
    Return the room that its picture has left.
    """
    stream.hold()
    place, sides = _magnifications(model)
    stream.text("summary", story.model(model, magnified=(place, sides)))
    stream.scene.is_modelled = True
    outline = np.array(model.surface.outline, dtype=np.float64).reshape(-1, 2)
    if len(outline) < 3:
        return Room(eye_of(stream.scene))
    thickness = model.surface.thickness.value if model.surface.thickness else DRAWN_THICKNESS
    top = model.floor_z + model.surface.height.value
    centre = np.array([model.surface.pose.x, model.surface.pose.y])
    stream.scene.centre = (float(centre[0]), float(centre[1]))
    stream.scene.yaw = model.surface.pose.yaw
    stream.scene.extent = float(np.linalg.norm(outline - centre, axis=1).max())
    _log_solids(stream, model, outline, thickness=thickness, tint=tint)
    room = Room(eye_of(stream.scene))
    take_model(room, model)
    for line in lines:
        room.take_line(line)
    if points is not None:
        room.take_points(points)
    log_dimensions(stream, model, outline, top, room)
    _log_place(stream, model, top, magnified=place)
    _log_bands(stream, model)
    return room


def take_model(room: Room, model: TableModel) -> None:
    """Take the room of a model's top and legs."""
    thickness = model.surface.thickness.value if model.surface.thickness else DRAWN_THICKNESS
    top = model.floor_z + model.surface.height.value
    room.take_solid(np.array(model.surface.outline).reshape(-1, 2), top - thickness, top)
    for leg in model.legs:
        sizes = {name: figure.value for name, figure in leg.dimensions.items()}
        ring = section(leg.shape, Pose2(leg.x, leg.y, leg.yaw), sizes)
        room.take_solid(ring, model.floor_z, top - thickness)


def _magnifications(model: TableModel) -> tuple[float, float]:
    """Return the magnifications that make the place's ellipse and the sides' bands visible."""
    outline = np.array(model.surface.outline, dtype=np.float64).reshape(-1, 2)
    reach = float(np.ptp(outline, axis=0).max()) / 2 if len(outline) else 1.0
    covariance = np.array(model.surface.pose.covariance, dtype=np.float64)[:2, :2]
    place = ELLIPSE_95 * float(np.sqrt(max(np.linalg.eigvalsh(covariance).max(), 0.0)))
    sides = TWO_SIDED_95 * max((edge.sigma or 0.0 for edge in model.surface.edges), default=0.0)
    first, second = (
        next((m for m in MAGNIFICATIONS if m * size <= MOST_DRAWN * reach), 1.0)
        for size in (place, sides)
    )
    return first, second


def _log_solids(
    stream: Stream,
    model: TableModel,
    outline: Floats,
    *,
    thickness: float,
    tint: palette.Colour,
) -> None:
    bottom = model.floor_z + model.surface.height.value - thickness
    _log_top(stream, "model/top", outline, bottom=bottom, thickness=thickness, tint=tint)
    for index, leg in enumerate(model.legs, start=1):
        _log_leg(stream, f"model/legs/{index:02d}", leg, model.floor_z, bottom)


def _log_top(
    stream: Stream,
    path: str,
    outline: Floats,
    *,
    bottom: float,
    thickness: float,
    tint: palette.Colour,
) -> None:
    polygon = shapely.make_valid(shapely.Polygon(outline))
    if polygon.geom_type != "Polygon":
        polygon = polygon.convex_hull
    corners, normals = extruded(polygon, bottom, bottom + thickness)
    stream.log(
        path,
        rr.Mesh3D(
            vertex_positions=corners.astype(np.float32),
            vertex_normals=normals.astype(np.float32),
            albedo_factor=tint,
        ),
    )


def extruded(polygon: shapely.Polygon, bottom: float, top: float) -> tuple[Floats, Floats]:
    """Return the corners (n, 3) of a prism's triangles, three a triangle, and their normals."""
    polygon = shapely.orient_polygons(polygon)
    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    # A ring repeats its first corner at its end.
    rings = shapely.get_coordinates(shapely.orient_polygons(parts)).reshape(-1, 4, 2)
    flat = rings[:, :3].reshape(-1, 2)
    corners = [_level(flat, top), _level(flat[::-1], bottom)]
    normals = [np.tile([0.0, 0.0, up], (len(flat), 1)) for up in (1.0, -1.0)]
    for ring in (polygon.exterior, *polygon.interiors):
        here = shapely.get_coordinates(ring)
        first, second = here[:-1], here[1:]
        lower = _level(first, bottom), _level(second, bottom)
        upper = _level(first, top), _level(second, top)
        wall = (lower[0], lower[1], upper[1], lower[0], upper[1], upper[0])
        corners.append(np.stack(wall, axis=1).reshape(-1, 3))
        along = second - first
        outward = _level(np.column_stack([along[:, 1], -along[:, 0]]), 0.0)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        normals.append(np.repeat(outward, 6, axis=0))
    return np.concatenate(corners), np.concatenate(normals)


def _level(places: Floats, z: float) -> Floats:
    return np.column_stack([places, np.full(len(places), z)])


def _log_leg(stream: Stream, path: str, leg: TableLeg, floor: float, bottom: float) -> None:
    length, middle = bottom - floor, (bottom + floor) / 2
    tint = colours.STATUS[leg.status] if leg.status != "measured" else palette.MODEL.on_paper
    record = shape_named(leg.shape)
    sizes = record.extents({name: figure.value for name, figure in leg.dimensions.items()})
    along, across = (size / 2 for size in sizes or (LEG_WITHOUT_SIZE, LEG_WITHOUT_SIZE))
    what: rr.Cylinders3D | rr.Boxes3D
    if record.is_elliptic:
        what = rr.Cylinders3D(
            lengths=[length],
            radii=[along],
            centers=[(leg.x, leg.y, middle)],
            colors=[tint],
            fill_mode="solid",
        )
    else:
        what = rr.Boxes3D(
            half_sizes=[(along, across, length / 2)],
            centers=[(leg.x, leg.y, middle)],
            rotation_axis_angles=[
                rr.RotationAxisAngle(axis=(0, 0, 1), angle=rr.Angle(rad=leg.yaw))
            ],
            colors=[tint],
            fill_mode="solid",
        )
    stream.log(path, what)


def _log_place(stream: Stream, model: TableModel, top: float, *, magnified: float) -> None:
    """Draw the 95 % ellipse of the place."""
    pose = model.surface.pose
    covariance = np.array(pose.covariance, dtype=np.float64)[:2, :2]
    values, vectors = np.linalg.eigh(covariance)
    angles = np.linspace(0, 2 * np.pi, 73)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    reach = magnified * ELLIPSE_95 * np.sqrt(np.maximum(values, 0.0))
    ellipse = np.array([pose.x, pose.y]) + (circle * reach) @ vectors.T
    stream.log(
        "model/uncertainty/place",
        rr.LineStrips3D(
            [raised(ellipse, top + 0.004)],
            colors=[palette.LOCALISED.on_dark],
            radii=rr.Radius.ui_points(1.5),
            labels=[f"place, 95 % ({magnified:.0f} times as large)"],
            show_labels=False,
        ),
    )


def bands(model: TableModel) -> list[tuple[str, NDArray[np.float32]]]:
    """Return the sides' magnified 95 % bands as they are drawn: status, and a line (n, 3)."""
    top = model.floor_z + model.surface.height.value
    _, magnified = _magnifications(model)
    found: list[tuple[str, NDArray[np.float32]]] = []
    for edge in model.surface.edges:
        side = np.array(edge.points, dtype=np.float64).reshape(-1, 2)
        if edge.sigma is None or len(side) < 2:
            continue
        width = magnified * TWO_SIDED_95 * edge.sigma
        line = shapely.LineString(side)
        for sign in (1.0, -1.0):
            band = shapely.offset_curve(line, sign * width)
            if band.geom_type == "LineString" and not band.is_empty:
                found.append((edge.status, raised(np.asarray(band.coords), top + 0.004)))
    return found


def _log_bands(stream: Stream, model: TableModel) -> None:
    """Draw the 95 % bands of the sides."""
    drawn = bands(model)
    if drawn:
        stream.log(
            "model/uncertainty/edges",
            rr.LineStrips3D(
                [line for _, line in drawn],
                colors=[colours.STATUS[status] for status, _ in drawn],
                radii=rr.Radius.ui_points(0.8),
            ),
        )
