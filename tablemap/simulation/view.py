"""A camera's view without noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from tablemap.geometry import Bools, Floats, Ints
from tablemap.simulation.lens import Lens
from tablemap.simulation.scene import Scene


@dataclass(frozen=True, eq=False)
class View:
    """A camera's view without noise, n = height x width pixels.

    - ``depth``: (n,) metres, inf for nothing
    - ``normals``: (n, 3) unit vectors in the map
    - ``parts``: (n,), indices into the scene's parts
    - ``cosine``: (n,), of the angle of incidence
    - ``behind_glass``: (n,) bool
    - ``edges``: indices of pixels near depth edges
    """

    scene: Scene
    map_from_camera: Floats
    depth: Floats
    normals: Floats
    parts: NDArray[np.int32]
    cosine: Floats
    behind_glass: Bools
    edges: Ints

    def of_material(
        self, name: Literal["reflectance", "gloss", "texture"], parts: NDArray[np.int32]
    ) -> Floats:
        """Return a property (n,) of the surfaces of parts (n,); 0 for nothing."""
        return np.array([getattr(part, name) for part in self.scene.parts] + [0.0])[parts]


@dataclass(frozen=True, eq=False)
class Reading:
    """What a camera reads, pixel by pixel, as errors are added; fields as in `View`, (n,) each.

    ``missing`` are the pixels without a measurement.
    """

    depth: Floats
    parts: NDArray[np.int32]
    cosine: Floats
    missing: Bools

    @staticmethod
    def of(view: View, *, nearest: float) -> Reading:
        """Return a view as a camera without errors reads it, from ``nearest`` metres on."""
        missing = ~np.isfinite(view.depth) | (view.depth < nearest)
        return Reading(view.depth.copy(), view.parts.copy(), view.cosine.copy(), missing)

    def put(self, where: Ints, depth: Floats, beside: Beside, chosen: Ints) -> None:
        """Give the pixels ``where`` (n,) a depth, and the surface of one ray (n,) beside each."""
        row = np.arange(len(where))
        self.depth[where] = depth
        self.parts[where] = beside.parts[row, chosen]
        self.cosine[where] = beside.cosine[row, chosen]


@dataclass(frozen=True, eq=False)
class Beside:
    """The surfaces met by k rays beside each pixel's own ray, fields as in `View`, (n, k) each.

    ``depth`` is that of the surface's plane at the pixel's own ray: so a displaced ray moves edges,
    but does not make a slanted plane rough.
    """

    depth: Floats
    parts: NDArray[np.int32]
    cosine: Floats


def see(lens: Lens, scene: Scene, glass: Scene | None, map_from_camera: Floats) -> View:
    """Cast one ray a pixel and find the jumps of depth."""
    rays = lens.rays @ map_from_camera[:3, :3].T
    origin = map_from_camera[:3, 3]
    hits = scene.cast(origin, rays)
    cosine = np.abs(np.sum(hits.normals * rays, axis=1)) / np.linalg.norm(rays, axis=1)
    behind_glass = np.zeros(len(rays), dtype=bool)
    if glass is not None:
        behind_glass = glass.cast(origin, rays).distance < hits.distance
    shape = (lens.height, lens.width)
    far = np.where(np.isfinite(hits.distance), hits.distance, 50.0).reshape(shape)
    parts = hits.parts.reshape(shape)
    edges = np.zeros(shape, dtype=bool)
    for a, b in (
        ((slice(None), slice(1, None)), (slice(None), slice(None, -1))),
        ((slice(1, None), slice(None)), (slice(None, -1), slice(None))),
    ):
        nearer = np.minimum(far[a], far[b])
        jump = (np.abs(far[a] - far[b]) > 0.03 + 0.02 * nearer**2) | (parts[a] != parts[b])
        edges[a] |= jump
        edges[b] |= jump
    near_edges = ndimage.maximum_filter(edges, size=5)
    return View(
        scene,
        map_from_camera,
        hits.distance,
        hits.normals,
        hits.parts,
        cosine,
        behind_glass,
        np.flatnonzero(near_edges),
    )


def look_beside(lens: Lens, view: View, where: Ints, places: Floats) -> Beside:
    """Cast rays at image places (n, k, 2) beside the pixels ``where`` (n,)."""
    rotation, origin = view.map_from_camera[:3, :3], view.map_from_camera[:3, 3]
    rays = lens.directions(places.reshape(-1, 2)) @ rotation.T
    hits = view.scene.cast(origin, rays)
    own = np.repeat(lens.rays[where] @ rotation.T, places.shape[1], axis=0)
    along = np.sum(hits.normals * own, axis=1)
    offset = np.sum(hits.normals * rays, axis=1) * np.where(
        np.isfinite(hits.distance), hits.distance, 0.0
    )
    steep = np.abs(along) < 0.08
    read = np.where(steep, hits.distance, offset / np.where(steep, 1.0, along))
    with np.errstate(invalid="ignore"):  # inf - inf, where the ray left the world
        wild = ~(np.abs(read - hits.distance) < 0.05)
    shape = places.shape[:2]
    return Beside(
        np.where(wild, hits.distance, read).reshape(shape),
        hits.parts.reshape(shape),
        (np.abs(along) / np.linalg.norm(own, axis=1)).reshape(shape),
    )


def in_front(depth: Floats) -> tuple[Floats, Bools]:
    """Return the nearest (n,) of depths (n, k), and which of them are of its surface."""
    nearest = depth.min(axis=1)
    tolerance = 0.02 + 0.01 * np.where(np.isfinite(nearest), nearest, 0.0) ** 2
    return nearest, depth < (nearest + tolerance)[:, None]


def hidden_from(lens: Lens, depth: Floats, baseline: float) -> Bools:
    """Return a mask of places that a nearer surface hides from a second eye to the right.

    A place in column u lies at u - f b / z in the image of that eye. It is visible if no place to
    its right lies further left in that image.
    """
    disparity = np.where(np.isfinite(depth), lens.k[0, 0] * baseline / depth, 0.0)
    u = np.arange(lens.width, dtype=np.float64)
    projected = u - disparity.reshape(lens.height, lens.width)
    least = np.minimum.accumulate(projected[:, ::-1], axis=1)[:, ::-1]
    hidden = np.zeros(projected.shape, dtype=bool)
    hidden[:, :-1] = projected[:, :-1] > least[:, 1:] + 0.5
    return hidden.ravel()
