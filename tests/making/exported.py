"""A model of every shape, and where its parts are: from the figures, by shapely."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import shapely
import trimesh
from msgspec import structs
from shapely import affinity

from tablemap import model as m
from tests.making.models import rectangle_model

POSE = m.PlanarPose(x=1.31, y=-2.22, yaw=0.37)
HEIGHT = 0.743
ASSUMED_THICKNESS = 0.03
TOLERANCE = 1e-4


@dataclass(frozen=True)
class Solid:
    """A part: its outline and the heights of its faces, metres."""

    outline: shapely.Polygon
    bottom: float
    top: float


def solid_of(mesh: trimesh.Trimesh) -> Solid:
    """Return what a closed mesh of an upright part fills: the outline is its upper face."""
    assert mesh.is_watertight
    assert mesh.volume > 0
    upper = mesh.triangles[mesh.face_normals[:, 2] > 0.5]
    outline = shapely.coverage_union_all(shapely.polygons(upper[:, :, :2]))
    assert mesh.volume == pytest.approx(outline.area * np.ptp(mesh.bounds[:, 2]), rel=1e-6)
    return Solid(outline, mesh.bounds[0, 2], mesh.bounds[1, 2])


def assert_agree(found: Solid, expected: Solid) -> None:
    """Outlines and heights are the same to 0.1 mm."""
    apart = shapely.hausdorff_distance(found.outline.exterior, expected.outline.exterior)
    assert apart < TOLERANCE, f"outlines {apart * 1e3:.3f} mm apart"
    assert len(found.outline.interiors) == 0
    assert abs(found.bottom - expected.bottom) < TOLERANCE
    assert abs(found.top - expected.top) < TOLERANCE


def assert_all_agree(found: dict[str, Solid], model: m.TableModel) -> None:
    """Every part of the model is there, at its place, and no other."""
    expected = solids_of(model)
    assert sorted(found) == sorted(expected)
    for name, solid in expected.items():
        assert_agree(found[name], solid)


def in_map(shape: shapely.Geometry) -> shapely.Geometry:
    """Move from the table's frame into the map."""
    matrix = [np.cos(POSE.yaw), -np.sin(POSE.yaw), np.sin(POSE.yaw), np.cos(POSE.yaw)]
    return affinity.affine_transform(shape, [*matrix, POSE.x, POSE.y])


def in_table(shape: shapely.Geometry) -> shapely.Geometry:
    """Move from the map into the table's frame."""
    shifted = affinity.translate(shape, -POSE.x, -POSE.y)
    return affinity.rotate(shifted, -POSE.yaw, origin=(0, 0), use_radians=True)


def solids_of(model: m.TableModel) -> dict[str, Solid]:
    """Return a model's parts in the table's frame."""
    surface = model.surface
    thickness = surface.thickness.value if surface.thickness else ASSUMED_THICKNESS
    under = HEIGHT - thickness
    solids = {"top": Solid(_top(surface), under, HEIGHT)}
    for number, leg in enumerate(model.legs, start=1):
        sizes = {name: size.value for name, size in leg.dimensions.items()}
        if leg.shape == "circle":
            shape = shapely.Point(0, 0).buffer(sizes["diameter"] / 2, quad_segs=96)
        else:
            shape = _centred_box(sizes["length"], sizes["width"])
        turned = affinity.rotate(shape, leg.yaw, origin=(0, 0), use_radians=True)
        placed = in_table(affinity.translate(turned, leg.x, leg.y))
        solids[f"leg_{number}"] = Solid(placed, 0.0, under)
    return solids


def _centred_box(length: float, width: float) -> shapely.Polygon:
    return shapely.box(-length / 2, -width / 2, length / 2, width / 2)


def _top(surface: m.TableSurface) -> shapely.Polygon:
    sizes = {name: size.value for name, size in surface.dimensions.items()}
    if surface.shape == "circle":
        return shapely.Point(0, 0).buffer(sizes["diameter"] / 2, quad_segs=96)
    if surface.shape == "ellipse":
        return affinity.scale(
            shapely.Point(0, 0).buffer(1, quad_segs=96), sizes["major"] / 2, sizes["minor"] / 2
        )
    if surface.corner_radius:
        radius = surface.corner_radius.value
        return _centred_box(sizes["length"] - 2 * radius, sizes["width"] - 2 * radius).buffer(
            radius, quad_segs=96
        )
    return in_table(shapely.Polygon(surface.outline))


def _model(
    shape: str,
    local: list[tuple[float, float]],
    sizes: dict[str, float],
    *,
    legs: tuple[m.TableLeg, ...] | None = None,
    thickness: float | None = 0.022,
    corner_radius: float | None = None,
    floor_z: float = 0.0,
) -> m.TableModel:
    base = rectangle_model(x=POSE.x, y=POSE.y, yaw=POSE.yaw, height=HEIGHT)
    placed = in_map(shapely.Polygon(local))
    outline = tuple((float(x), float(y)) for x, y in placed.exterior.coords[:-1])
    count = len(outline)
    surface = structs.replace(
        base.surface,
        shape=shape,
        outline=outline,
        thickness=None if thickness is None else m.Figure(value=thickness, sigma=0.001),
        dimensions={name: _measured(value) for name, value in sizes.items()},
        corner_radius=None if corner_radius is None else _measured(corner_radius),
        edges=tuple(
            m.Edge(
                points=(outline[i], outline[(i + 1) % count]),
                status="measured",
                sigma=0.001,
                seen_fraction=0.9,
            )
            for i in range(count)
        ),
    )
    kept = base.legs if legs is None else legs
    return structs.replace(base, surface=surface, legs=kept, floor_z=floor_z)


def _measured(value: float) -> m.Dimension:
    return m.Dimension(value=value, sigma=0.001, status="measured")


def _leg(local: tuple[float, float], sizes: dict[str, float], **fields: object) -> m.TableLeg:
    place = in_map(shapely.Point(local))
    given = {"yaw": 0.0, "status": "measured", "position_sigma": 0.003, **fields}
    return m.TableLeg(
        shape="circle" if "diameter" in sizes else "rectangle",
        x=place.x,
        y=place.y,
        dimensions={name: _measured(value) for name, value in sizes.items()},
        **given,
    )


def _centred(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    middle = shapely.Polygon(points).centroid
    return [(x - middle.x, y - middle.y) for x, y in points]


def _round(major: float, minor: float) -> list[tuple[float, float]]:
    angles = np.arange(72) * (2 * np.pi / 72)
    return [(major / 2 * float(np.cos(a)), minor / 2 * float(np.sin(a))) for a in angles]


def _box(length: float, width: float) -> list[tuple[float, float]]:
    return [
        (length / 2, width / 2),
        (-length / 2, width / 2),
        (-length / 2, -width / 2),
        (length / 2, -width / 2),
    ]


L_SHAPE = _centred([(0, 0), (1.6, 0), (1.6, 0.7), (0.8, 0.7), (0.8, 1.4), (0, 1.4)])
U_SHAPE = _centred(
    [(0, 0), (1.6, 0), (1.6, 1.2), (1.1, 1.2), (1.1, 0.5), (0.5, 0.5), (0.5, 1.2), (0, 1.2)]
)
HULL = [(0.6, 0.05), (0.31, 0.42), (-0.22, 0.44), (-0.58, 0.07), (-0.41, -0.35), (0.3, -0.4)]
PEDESTAL = (_leg((0, 0), {"diameter": 0.31}),)
SQUARE_LEGS = (
    _leg((0.3, 0.2), {"length": 0.06, "width": 0.04}, yaw=1.1),
    _leg((-0.3, -0.2), {"length": 0.06, "width": 0.04}, yaw=1.1, status="inferred"),
)
L_LEGS = (_leg((-0.5, -0.4), {"diameter": 0.05}), _leg((0.75, -0.4), {"diameter": 0.05}))

MODELS: dict[str, m.TableModel] = {
    "circle": _model("circle", _round(0.9, 0.9), {"diameter": 0.9}, legs=PEDESTAL),
    "ellipse": _model("ellipse", _round(1.4, 0.8), {"major": 1.4, "minor": 0.8}, legs=PEDESTAL),
    "rectangle": _model("rectangle", _box(1.2, 0.8), {"length": 1.2, "width": 0.8}),
    "rounded": _model(
        "rectangle", _box(1.2, 0.8), {"length": 1.2, "width": 0.8}, corner_radius=0.12
    ),
    "square": _model("square", _box(0.7, 0.7), {"side": 0.7}, legs=SQUARE_LEGS),
    "parallelogram": _model(
        "parallelogram",
        [(0.7, 0.4), (-0.5, 0.4), (-0.7, -0.4), (0.5, -0.4)],
        {"length": 1.2, "width": float(np.hypot(0.2, 0.8)), "angle": float(np.arctan2(0.8, 0.2))},
        legs=SQUARE_LEGS,
    ),
    "L": _model("polygon", L_SHAPE, {}, legs=L_LEGS),
    "U": _model("polygon", U_SHAPE, {}, floor_z=0.05),
    "mesh": _model("mesh", HULL, {}, legs=SQUARE_LEGS, thickness=None),
    "no legs": _model("rectangle", _box(1.2, 0.8), {"length": 1.2, "width": 0.8}, legs=()),
}
