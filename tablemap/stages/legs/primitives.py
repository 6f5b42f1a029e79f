"""Circle, square and rectangle: where tangents touch them, and where rays meet them.

The parameters are x and y, then the lengths of the shape's record, then its yaw if it has one.
A tangent with outward unit normal n touches a convex shape of centre c where n.p = n.c + h(n). For
a circle h is the radius; for a rectangle with axes u and v it is (l |n.u| + w |n.v|) / 2.
"""

from __future__ import annotations

import numpy as np

from tablemap.geometry import Floats
from tablemap.model.shapes import CIRCLE, RECTANGLE, SQUARE, ShapeRecord

_GRAZING = 0.4  # cosine of incidence: below it a depth says little


def sizes_of(kind: ShapeRecord) -> slice:
    """Return which parameters are the lengths: they follow x and y, and precede a yaw."""
    return slice(2, 2 + len(kind.lengths))


def has_yaw(kind: ShapeRecord) -> bool:
    """Tell whether the last parameter is a yaw."""
    return kind.yaw_period > 0


def described(kind: ShapeRecord, values: Floats) -> tuple[str, float, dict[str, int]]:
    """Return the section's name in the model, its yaw, and the parameter of each of its lengths.

    ``values`` (p,) are the parameters. A square is a rectangle in the model.
    """
    if not has_yaw(kind):
        return kind.name, 0.0, dict.fromkeys(kind.lengths, 2)
    length, width = 2, 1 + len(kind.lengths)
    yaw = float(values[-1])
    if values[width] > values[length]:
        length, width, yaw = width, length, yaw + np.pi / 2
    sides = dict(zip(RECTANGLE.lengths, (length, width), strict=True))
    return RECTANGLE.name, float(yaw % kind.yaw_period), sides


def support(kind: ShapeRecord, values: Floats, normal: Floats) -> tuple[Floats, Floats]:
    """Return h (n,) and d(n.c + h)/d(values) (n, p)."""
    if kind is CIRCLE:
        h = np.full(len(normal), 0.5 * values[2])
        return h, np.column_stack([normal, np.full(len(normal), 0.5)])
    length, width, yaw = values[2], values[-2], values[-1]
    c, s = np.cos(yaw), np.sin(yaw)
    along, across = normal @ [c, s], normal @ [-s, c]
    h = 0.5 * (length * np.abs(along) + width * np.abs(across))
    turn = 0.5 * (length * np.sign(along) * across - width * np.sign(across) * along)
    if kind is SQUARE:
        return h, np.column_stack([normal, 0.5 * (np.abs(along) + np.abs(across)), turn])
    return h, np.column_stack([normal, 0.5 * np.abs(along), 0.5 * np.abs(across), turn])


def surface_distance(
    kind: ShapeRecord, values: Floats, points: Floats, rays: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return each point's distance to the part of the surface that its ray meets.

    The results are distances (n,) along the surface's normals, these normals (n, 2),
    d(distance)/d(values) (n, p) and validity (n,). The ray selects the part of the surface, not the
    nearest place to the point, as a noisy point would select a wrong part.
    """
    offset = points - values[:2]
    along_ray = np.einsum("ij,ij->i", offset, rays)
    if kind is CIRCLE:
        radius = 0.5 * values[2]
        closest = offset - along_ray[:, None] * rays
        square = radius**2 - np.einsum("ij,ij->i", closest, closest)
        depth = np.sqrt(np.maximum(square, 0.0))
        normals = (closest - depth[:, None] * rays) / radius
        cosine = -depth / radius
        ok = cosine < -_GRAZING
        slope = np.column_stack([-normals, np.full(len(points), -0.5)])
        return (along_ray + depth) * cosine, normals, slope, ok.astype(np.float64)
    length, width, yaw = values[2], values[-2], values[-1]
    u = np.array([np.cos(yaw), np.sin(yaw)])
    v = np.array([-u[1], u[0]])
    along, across = offset @ u, offset @ v
    ray_u, ray_v = rays @ u, rays @ v
    ray_u = np.where(np.abs(ray_u) < 1e-9, 1e-9, ray_u)
    ray_v = np.where(np.abs(ray_v) < 1e-9, 1e-9, ray_v)
    enter_u = (-np.sign(ray_u) * 0.5 * length - along) / ray_u
    enter_v = (-np.sign(ray_v) * 0.5 * width - across) / ray_v
    leave_u = (np.sign(ray_u) * 0.5 * length - along) / ray_u
    leave_v = (np.sign(ray_v) * 0.5 * width - across) / ray_v
    end = enter_u > enter_v
    enter = np.maximum(enter_u, enter_v)
    side = np.where(end, -np.sign(ray_u), -np.sign(ray_v))
    normals = np.where(end[:, None], u, v) * side[:, None]
    cosine = np.einsum("ij,ij->i", normals, rays)
    ok = (enter < np.minimum(leave_u, leave_v)) & (cosine < -_GRAZING)
    met_along, met_across = along + enter * ray_u, across + enter * ray_v
    turn = np.where(end, met_across, -met_along) * side
    half = np.full(len(points), -0.5)
    if kind is SQUARE:
        slope = np.column_stack([-normals, half, turn])
    else:
        slope = np.column_stack(
            [-normals, np.where(end, half, 0.0), np.where(end, 0.0, half), turn]
        )
    return -enter * cosine, normals, slope, ok.astype(np.float64)


def chords(
    kind: ShapeRecord, values: Floats, origins: Floats, rays: Floats
) -> tuple[Floats, Floats]:
    """Return the distances (n,) along rays at which they enter and leave the shape, NaN beside it.

    ``origins`` and ``rays`` are (n, 2); the rays are unit vectors.
    """
    offset = origins - values[:2]
    if kind is CIRCLE:
        along = -np.einsum("ij,ij->i", offset, rays)
        square = (0.5 * values[2]) ** 2 - np.einsum("ij,ij->i", offset, offset) + along**2
        half = np.sqrt(np.where(square > 0.0, square, np.nan))
        return along - half, along + half
    length, width, yaw = values[2], values[-2], values[-1]
    axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    at, towards = offset @ axes.T, rays @ axes.T
    towards = np.where(np.abs(towards) < 1e-9, 1e-9, towards)
    reach = 0.5 * np.array([length, width])
    first = ((-np.sign(towards) * reach - at) / towards).max(axis=1)
    last = ((np.sign(towards) * reach - at) / towards).min(axis=1)
    met = first < last
    return np.where(met, first, np.nan), np.where(met, last, np.nan)
