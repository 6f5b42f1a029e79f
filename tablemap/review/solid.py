"""The final model as solid shapes in the room, with its dimensions and its uncertainty."""

from __future__ import annotations

import numpy as np
import rerun as rr
import shapely
import trimesh

from tablemap.geometry import Floats, Pose2
from tablemap.model import Figure, TableLeg, TableModel
from tablemap.record import OtherTable
from tablemap.review import colours, text
from tablemap.review.clouds import raised
from tablemap.review.stream import Stream

DRAWN_THICKNESS = 0.03
DIMENSION_OFFSET = 0.18
TICK = 0.04  # extension lines pass the dimension lines by so much
MAGNIFICATIONS = (50.0, 20.0, 10.0, 5.0, 2.0, 1.0)
MOST_DRAWN = 0.2  # of the table's reach: an interval is magnified up to here
TWO_SIDED_95 = 1.96
ELLIPSE_95 = 2.448
MOST_LABELLED_EDGES = 12
LEG_WITHOUT_SIZE = 0.04


def log_model(stream: Stream, model: TableModel) -> None:
    """Log top and legs as solids, dimension lines with numbers, and magnified 95 % bands."""
    stream.hold()
    place, sides = _magnifications(model)
    stream.text("summary", text.model(model, magnified=(place, sides)))
    outline = np.array(model.surface.outline, dtype=np.float64).reshape(-1, 2)
    if len(outline) < 3:
        return
    thickness = model.surface.thickness.value if model.surface.thickness else DRAWN_THICKNESS
    top = model.floor_z + model.surface.height.value
    centre = np.array([model.surface.pose.x, model.surface.pose.y])
    stream.scene.centre = (float(centre[0]), float(centre[1]))
    stream.scene.yaw = model.surface.pose.yaw
    stream.scene.extent = float(np.linalg.norm(outline - centre, axis=1).max())
    _log_solids(stream, "model", model, outline, thickness=thickness, tint=colours.WOOD)
    _log_dimensions(stream, model, outline, top)
    _log_place(stream, model, top, magnified=place)
    _log_bands(stream, model, top, magnified=sides)


def log_other_table(stream: Stream, other: OtherTable) -> None:
    """Log a table beside the chosen one, muted, or why there is no model of it."""
    stream.hold()
    path = f"other_tables/{other.number:02d}"
    if isinstance(other.outcome, str):
        message = f"other table {other.number} has no model: {other.outcome}"
        stream.log_flat("log", rr.TextLog(message, level="INFO"))
        return
    model = other.outcome
    magnified = _magnifications(model)
    stream.text(f"{path}/summary", text.model(model, magnified=magnified))
    outline = np.array(model.surface.outline, dtype=np.float64).reshape(-1, 2)
    if len(outline) > 2:
        thickness = model.surface.thickness.value if model.surface.thickness else DRAWN_THICKNESS
        _log_solids(stream, path, model, outline, thickness=thickness, tint=colours.MUTED)


def _magnifications(model: TableModel) -> tuple[float, float]:
    """Return how often as large the place's ellipse and the sides' bands are drawn, to be seen."""
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
    path: str,
    model: TableModel,
    outline: Floats,
    *,
    thickness: float,
    tint: colours.Colour,
) -> None:
    bottom = model.floor_z + model.surface.height.value - thickness
    _log_top(stream, f"{path}/top", outline, bottom=bottom, thickness=thickness, tint=tint)
    for index, leg in enumerate(model.legs):
        _log_leg(stream, f"{path}/legs/{index:02d}", leg, model.floor_z, bottom)


def _log_top(
    stream: Stream,
    path: str,
    outline: Floats,
    *,
    bottom: float,
    thickness: float,
    tint: colours.Colour,
) -> None:
    polygon = shapely.make_valid(shapely.Polygon(outline))
    if polygon.geom_type != "Polygon":
        polygon = polygon.convex_hull
    solid = trimesh.creation.extrude_polygon(polygon, thickness)
    corners = np.asarray(solid.triangles).reshape(-1, 3) + np.array([0.0, 0.0, bottom])
    stream.log(
        path,
        rr.Mesh3D(
            vertex_positions=corners.astype(np.float32),
            vertex_normals=np.repeat(solid.face_normals, 3, axis=0).astype(np.float32),
            albedo_factor=tint,
        ),
    )


def _log_leg(stream: Stream, path: str, leg: TableLeg, floor: float, bottom: float) -> None:
    length, middle = bottom - floor, (bottom + floor) / 2
    tint = colours.STATUS[leg.status] if leg.status != "measured" else (150, 116, 78)
    sizes = {name: figure.value for name, figure in leg.dimensions.items()}
    what: rr.Cylinders3D | rr.Boxes3D
    if leg.shape == "circle":
        what = rr.Cylinders3D(
            lengths=[length],
            radii=[sizes.get("diameter", LEG_WITHOUT_SIZE) / 2],
            centers=[(leg.x, leg.y, middle)],
            colors=[tint],
            fill_mode="solid",
        )
    else:
        along = sizes.get("length", LEG_WITHOUT_SIZE)
        what = rr.Boxes3D(
            half_sizes=[(along / 2, sizes.get("width", along) / 2, length / 2)],
            centers=[(leg.x, leg.y, middle)],
            rotation_axis_angles=[
                rr.RotationAxisAngle(axis=(0, 0, 1), angle=rr.Angle(rad=leg.yaw))
            ],
            colors=[tint],
            fill_mode="solid",
        )
    stream.log(path, what)


def _log_dimensions(stream: Stream, model: TableModel, outline: Floats, top: float) -> None:
    lines: list[Floats] = []
    labels: list[str] = []
    tints: list[colours.Colour] = []
    for name, ends in _spans(model).items():
        figure = model.surface.dimensions[name]
        lines.append(np.column_stack([ends, [top, top]]))
        labels.append(f"{name} {_written(figure)}")
        tints.append(colours.STATUS[figure.status])
    extensions = _extensions(lines, outline, top)
    if not lines and len(model.surface.edges) <= MOST_LABELLED_EDGES:
        polygon = shapely.Polygon(outline)
        for edge in model.surface.edges:
            side = np.array(edge.points, dtype=np.float64)
            reach = float(np.linalg.norm(np.diff(side, axis=0), axis=1).sum())
            beside = _beside(side, polygon)
            lines.append(np.column_stack([beside, np.full(len(side), top)]))
            labels.append(f"{reach:.3f} m")
            tints.append(colours.STATUS[edge.status])
    foot = _lowest_corner(model, outline)
    lines.append(np.array([[*foot, model.floor_z], [*foot, top]]))
    labels.append(f"height {_written(model.surface.height)}")
    tints.append(colours.INK)
    stream.log(
        "model/dimensions",
        rr.LineStrips3D(
            lines, labels=labels, colors=tints, radii=rr.Radius.ui_points(2.0), show_labels=True
        ),
    )
    if extensions:
        stream.log(
            "model/dimensions/extensions",
            rr.LineStrips3D(extensions, colors=[colours.MUTED], radii=rr.Radius.ui_points(0.8)),
        )


def _extensions(lines: list[Floats], outline: Floats, top: float) -> list[Floats]:
    """Return the thin lines from the outline's nearest corners past the dimension lines' ends."""
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
    """Return where the height is drawn: beside the outline's corner where its length begins."""
    centre = np.array([model.surface.pose.x, model.surface.pose.y])
    towards = Pose2(0, 0, model.surface.pose.yaw).rotate(np.array([-1.0, -1.0]))
    corner = outline[np.argmax((outline - centre) @ towards)]
    away = corner - centre
    return np.asarray(corner + DIMENSION_OFFSET * away / max(float(np.linalg.norm(away)), 1e-9))


def _spans(model: TableModel) -> dict[str, Floats]:
    """Return for each named length of the top its two ends (2, 2) in the map, beside the top."""
    surface = model.surface
    sizes = {name: figure.value for name, figure in surface.dimensions.items()}
    pose = Pose2(surface.pose.x, surface.pose.y, surface.pose.yaw)
    local: dict[str, list[list[float]]] = {}
    if surface.shape in ("rectangle", "square", "parallelogram"):
        side = sizes.get("side")
        length, width = sizes.get("length", side), sizes.get("width", side)
        if length is None or width is None:
            return {}
        angle = sizes.get("angle", np.pi / 2)
        across = np.array([np.cos(angle), np.sin(angle)]) * width / 2
        along = np.array([length / 2, 0.0])
        low = np.array([0.0, -DIMENSION_OFFSET])
        right = np.array([np.sin(angle), -np.cos(angle)]) * DIMENSION_OFFSET
        first = np.array([-along - across + low, along - across + low])
        second = np.array([along - across + right, along + across + right])
        if side is not None:
            return {"side": pose.apply(first)}
        return {"length": pose.apply(first), "width": pose.apply(second)}
    if surface.shape == "circle" and "diameter" in sizes:
        local["diameter"] = [[-sizes["diameter"] / 2, 0], [sizes["diameter"] / 2, 0]]
    if surface.shape == "ellipse" and {"major", "minor"} <= sizes.keys():
        local["major"] = [[-sizes["major"] / 2, 0], [sizes["major"] / 2, 0]]
        local["minor"] = [[0, -sizes["minor"] / 2], [0, sizes["minor"] / 2]]
    return {name: pose.apply(np.array(ends)) for name, ends in local.items()}


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
            colors=[colours.ODOMETRY],
            radii=rr.Radius.ui_points(1.5),
            labels=[f"place, 95 % ({magnified:.0f} times as large)"],
            show_labels=False,
        ),
    )


def _log_bands(stream: Stream, model: TableModel, top: float, *, magnified: float) -> None:
    """Draw the 95 % bands of the sides."""
    bands, tints = [], []
    for edge in model.surface.edges:
        side = np.array(edge.points, dtype=np.float64).reshape(-1, 2)
        if edge.sigma is None or len(side) < 2:
            continue
        width = magnified * TWO_SIDED_95 * edge.sigma
        line = shapely.LineString(side)
        for sign in (1.0, -1.0):
            band = shapely.offset_curve(line, sign * width)
            if band.geom_type == "LineString" and not band.is_empty:
                bands.append(raised(np.asarray(band.coords), top + 0.004))
                tints.append(colours.STATUS[edge.status])
    if bands:
        stream.log(
            "model/uncertainty/edges",
            rr.LineStrips3D(bands, colors=tints, radii=rr.Radius.ui_points(0.8)),
        )
