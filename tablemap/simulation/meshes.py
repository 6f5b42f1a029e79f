"""Solids as triangles: prisms, bevelled plates, bodies of revolution, boxes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import mapbox_earcut
import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats, Ints, Pose2


@dataclass(frozen=True, eq=False)
class Mesh:
    """``vertices`` (n, 3) metres, ``triangles`` (m, 3) indices."""

    vertices: Floats
    triangles: NDArray[np.uint32]

    def placed(self, pose: Pose2, z: float = 0.0) -> Mesh:
        """Return the mesh moved in the plane and lifted by ``z``."""
        return Mesh(pose.apply(self.vertices) + np.array([0.0, 0.0, z]), self.triangles)


@dataclass(frozen=True, eq=False)
class MeshPart:
    """A mesh and its material.

    - ``reflectance``, ``gloss``: 0 to 1, they decide whether depth is measured at all
    - ``texture``: 0 to 1, decides whether stereo can match it
    - ``glass``: lets the laser pass, and gives the depth camera little
    - ``colour``: for the picture
    """

    mesh: Mesh
    colour: tuple[float, float, float]
    reflectance: float = 0.6
    gloss: float = 0.0
    glass: bool = False
    texture: float = 0.9

    def of(self, mesh: Mesh) -> MeshPart:
        """Return another mesh of the same material."""
        return replace(self, mesh=mesh)


def at(place: Floats, yaw: float) -> Pose2:
    """Return the pose at a place (2,)."""
    return Pose2.from_array([*place, yaw])


def prism(outline: Floats, bottom: float, top: float) -> Mesh:
    """Extrude an outline (n, 2), counter-clockwise, between two heights."""
    return loft([outline, outline], [bottom, top])


def loft(rings: list[Floats], heights: list[float]) -> Mesh:
    """Join rings (n, 2) of equal length, from below to above, and close both ends."""
    n = len(rings[0])
    vertices = np.concatenate(
        [np.column_stack([ring, np.full(n, z)]) for ring, z in zip(rings, heights, strict=True)]
    )
    i = np.arange(n)
    j = (i + 1) % n
    faces = []
    for k in range(len(rings) - 1):
        low, high = k * n, (k + 1) * n
        faces.append(np.column_stack([low + i, low + j, high + j]))
        faces.append(np.column_stack([low + i, high + j, high + i]))
    ends = np.array([n], dtype=np.uint32)
    lid = mapbox_earcut.triangulate_float64(np.ascontiguousarray(rings[-1]), ends).reshape(-1, 3)
    base = mapbox_earcut.triangulate_float64(np.ascontiguousarray(rings[0]), ends).reshape(-1, 3)
    faces += [lid.astype(np.int64) + (len(rings) - 1) * n, base.astype(np.int64)[:, ::-1]]
    return Mesh(vertices, np.concatenate(faces).astype(np.uint32))


def inset(outline: Floats, distance: float) -> Floats:
    """Move every side of a counter-clockwise outline (n, 2) inwards, corner by corner."""
    before = outline - np.roll(outline, 1, axis=0)
    after = np.roll(outline, -1, axis=0) - outline
    normal_before = _left(before)
    normal_after = _left(after)
    bisector = normal_before + normal_after
    bisector /= 1 + np.sum(normal_before * normal_after, axis=1, keepdims=True)
    return np.asarray(outline + distance * bisector)


def plate(outline: Floats, bottom: float, top: float, *, edge: str, edge_size: float) -> Mesh:
    """Return a plate whose upper rim is ``sharp``, ``bevelled`` or ``rounded``."""
    if edge == "sharp" or edge_size == 0:
        return prism(outline, bottom, top)
    turns = np.linspace(0, np.pi / 2, 2 if edge == "bevelled" else 6)
    rings = [outline] + [inset(outline, edge_size * (1 - np.cos(turn))) for turn in turns]
    heights = [bottom] + [top - edge_size * (1 - np.sin(turn)) for turn in turns]
    return loft(rings, heights)


def refined(mesh: Mesh, size: float) -> Mesh:
    """Split edges until none is longer than ``size``, without gaps between neighbours.

    Only an edge's length decides about its split, so both triangles split it at the same place.
    """
    vertices, triangles = mesh.vertices, mesh.triangles.astype(np.int64)
    while True:
        edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1), axis=-1)
        ends = vertices[edges]
        long = np.linalg.norm(ends[..., 1, :] - ends[..., 0, :], axis=-1) > size
        if not long.any():
            return Mesh(vertices, triangles.astype(np.uint32))
        split, each = np.unique(edges[long], axis=0, return_inverse=True)
        middles = np.full(long.shape, -1)
        middles[long] = len(vertices) + each.ravel()
        vertices = np.concatenate([vertices, vertices[split].mean(axis=1)])
        triangles = np.concatenate(list(_halves(triangles, middles)))


def _halves(triangles: Ints, middles: Ints) -> Iterator[Ints]:
    """Yield the parts of triangles whose edges (first to second corner first) have ``middles``."""
    count = (middles >= 0).sum(axis=1)
    yield triangles[count == 0]
    for number in (1, 2, 3):
        chosen = count == number
        corners, split = triangles[chosen], middles[chosen] >= 0
        # Turn each so that its first edge is split, and with two its first and second.
        first = split.argmax(axis=1)
        if number == 2:
            first = (split.argmin(axis=1) + 1) % 3
        turned = (np.arange(3) + first[:, None]) % 3
        a, b, c = np.take_along_axis(corners, turned, axis=1).T
        ab, bc, ca = np.take_along_axis(middles[chosen], turned, axis=1).T
        if number == 1:
            yield np.column_stack([a, ab, c])
            yield np.column_stack([ab, b, c])
        elif number == 2:
            yield np.column_stack([ab, b, bc])
            yield np.column_stack([a, ab, c])
            yield np.column_stack([ab, bc, c])
        else:
            yield np.column_stack([a, ab, ca])
            yield np.column_stack([ab, b, bc])
            yield np.column_stack([ca, bc, c])
            yield np.column_stack([ab, bc, ca])


def box(length: float, width: float, bottom: float, top: float) -> Mesh:
    """Return an upright box round the origin."""
    x, y = length / 2, width / 2
    return prism(np.array([[-x, -y], [x, -y], [x, y], [-x, y]]), bottom, top)


def revolve(profile: list[tuple[float, float]], sides: int = 32) -> Mesh:
    """Turn a profile of (radius, height) round the z axis, from below to above; both ends close."""
    phase = np.arange(sides) * 2 * np.pi / sides
    unit = np.column_stack([np.cos(phase), np.sin(phase)])
    return loft([radius * unit for radius, _ in profile], [height for _, height in profile])


def cylinder(diameter: float, bottom: float, top: float, sides: int = 48) -> Mesh:
    """Return an upright cylinder round the origin."""
    return revolve([(diameter / 2, bottom), (diameter / 2, top)], sides)


def _left(sides: Floats) -> Floats:
    length = np.linalg.norm(sides, axis=1, keepdims=True)
    return np.asarray(np.column_stack([-sides[:, 1], sides[:, 0]]) / length)
