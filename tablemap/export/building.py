"""Solid parts from a model's figures, with warnings about them.

Only the model is used. Values that it lacks come from the config, with a warning.
"""

from __future__ import annotations

import numpy as np
import shapely

from tablemap.config import ExportConfig
from tablemap.errors import ProcessWarning, TablemapError
from tablemap.export.rings import ellipse_ring, rectangle_ring
from tablemap.export.solid import Box, Cylinder, Prism, Solid, SolidPart
from tablemap.geometry import Floats, Pose2
from tablemap.model import TableLeg, TableModel, TableSurface
from tablemap.model.shapes import shape_named
from tablemap.model.summary import doubts
from tablemap.words import counted


def build(
    model: TableModel, config: ExportConfig, *, name: str
) -> tuple[Solid, tuple[ProcessWarning, ...]]:
    """Make the parts of a model, with warnings for the reader of an export.

    Raises `TablemapError` if the model has no height or its outline encloses nothing.
    """
    surface = model.surface
    height = surface.height.value
    if height <= 0:
        raise TablemapError(
            f"expected a top above the floor, found its height {height:.3f} m; nothing is exported."
        )
    warnings = []
    if surface.thickness is None:
        thickness = min(config.thickness, height / 2)
        warnings.append(
            _warning(
                "export.assumed_thickness",
                f"the top's thickness is not known; {thickness * 1e3:.0f} mm is assumed "
                "(export.thickness).",
            )
        )
    else:
        thickness = min(surface.thickness.value, height)
        if thickness <= 0:
            raise TablemapError(
                f"expected a top of some thickness, found {thickness:.4f} m; nothing is exported."
            )
    pose = Pose2(surface.pose.x, surface.pose.y, surface.pose.yaw)
    shape, repaired = _top_shape(surface, pose, thickness)
    if repaired:
        warnings.append(
            _warning(
                "export.outline_repaired", "the outline crosses itself; its largest part is used."
            )
        )
    warnings += _doubts(model)
    solid = Solid(
        name=name,
        model=model,
        map_from_table=pose,
        height=height,
        thickness=thickness,
        top=SolidPart("top", shape, Pose2(), height - thickness / 2),
        legs=_legs(model.legs, pose, height - thickness),
    )
    return solid, tuple(warnings)


def _top_shape(
    surface: TableSurface, pose: Pose2, thickness: float
) -> tuple[Box | Cylinder | Prism, bool]:
    """Return the top's primitive, or its outline as a prism, and whether that was repaired."""
    record = shape_named(surface.shape)
    sizes = record.extents({name: size.value for name, size in surface.dimensions.items()})
    radius = surface.corner_radius.value if surface.corner_radius else 0.0
    if sizes and record.is_elliptic:
        length, width = sizes
        if length == width:
            return Cylinder(length / 2, thickness), False
        return Prism(ellipse_ring(length, width), thickness), False
    if sizes and record.is_box:
        if radius <= 0:
            return Box(*sizes, thickness), False
        return Prism(rectangle_ring(*sizes, radius), thickness), False
    ring, repaired = _simple_ring(np.array(surface.outline, dtype=np.float64).reshape(-1, 2))
    return Prism(pose.inverse().apply(ring), thickness), repaired


def _simple_ring(points: Floats) -> tuple[Floats, bool]:
    """Return an outline (N, 2), counter-clockwise, without repeated points; tell if it changed."""
    polygon = shapely.Polygon(points) if len(points) > 2 else shapely.Polygon()
    valid = bool(polygon.is_valid)
    if not valid:
        pieces = shapely.get_parts(shapely.make_valid(polygon)).tolist()
        polygon = max(pieces, key=shapely.area)
    if polygon.area < 1e-6:
        raise TablemapError(
            f"expected an outline that encloses the top, found {counted(len(points), 'point')} and "
            "no area; nothing is exported."
        )
    polygon = shapely.orient_polygons(shapely.remove_repeated_points(polygon, 1e-6))
    return np.array(polygon.exterior.coords, dtype=np.float64)[:-1], not valid


def _legs(legs: tuple[TableLeg, ...], pose: Pose2, height: float) -> tuple[SolidPart, ...]:
    """Return the legs, from the floor to the top's underside at ``height``."""
    if height < 1e-4:
        return ()
    parts = []
    for number, leg in enumerate(legs, start=1):
        shape: Box | Cylinder
        record = shape_named(leg.shape)
        sizes = record.extents({name: size.value for name, size in leg.dimensions.items()})
        if sizes is None:
            raise TablemapError(
                f"expected {' and '.join(record.lengths)} of leg {number}, found "
                f"{' and '.join(leg.dimensions) or 'no size'}; nothing is exported."
            )
        shape = Cylinder(sizes[0] / 2, height) if record.is_elliptic else Box(*sizes, height)
        place = pose.inverse() @ Pose2(leg.x, leg.y, leg.yaw)
        if isinstance(shape, Cylinder):
            place = Pose2(place.x, place.y)
        parts.append(SolidPart(f"leg_{number}", shape, place, height / 2))
    return tuple(parts)


def _doubts(model: TableModel) -> list[ProcessWarning]:
    """Return warnings about figures that were not fully measured."""
    warnings = []
    unseen = [name for name, size in model.surface.dimensions.items() if size.status == "unseen"]
    if unseen:
        warnings.append(
            _warning("export.bound", f"not seen, so exported at its bound: {', '.join(unseen)}.")
        )
    if not model.legs:
        said = (
            "no legs were found, so the object is its top alone; what stands below it is unknown."
        )
        warnings.append(_warning("export.no_legs", said))
    if model.verdict.level != "good":
        reasons = "; ".join(doubts(model)) or "no reason was recorded"
        warnings.append(
            _warning("export.verdict", f"the model's verdict is {model.verdict.level}: {reasons}")
        )
    return warnings


def _warning(code: str, message: str) -> ProcessWarning:
    return ProcessWarning(code, "export", message)
