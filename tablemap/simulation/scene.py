"""Rays into a world of triangles, by Open3D."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablemap import imports
from tablemap.geometry import Floats
from tablemap.simulation.meshes import MeshPart


@dataclass(frozen=True, eq=False)
class Hits:
    """The surfaces that n rays met.

    - ``distance``: (n,), in lengths of the rays' directions, inf for nothing
    - ``normals``: (n, 3) unit vectors
    - ``parts``: (n,) indices, -1 for nothing
    """

    distance: Floats
    normals: Floats
    parts: NDArray[np.int32]


class Scene:
    """Parts to cast rays at. ``parts`` keeps their order: `Hits.parts` are indices into it."""

    def __init__(self, parts: Sequence[MeshPart]) -> None:
        o3d = imports.open3d()
        self.parts = tuple(parts)
        self._tensor = tensor = o3d.core.Tensor
        # One thread: recordings are simulated in parallel already.
        self._scene: Any = o3d.t.geometry.RaycastingScene(nthreads=1)
        counts = np.cumsum([0] + [len(part.mesh.vertices) for part in parts])
        vertices = np.concatenate([part.mesh.vertices for part in parts]).astype(np.float32)
        triangles = np.concatenate(
            [part.mesh.triangles + start for part, start in zip(parts, counts[:-1], strict=True)]
        ).astype(np.uint32)
        self._part_of_triangle = np.repeat(
            np.arange(len(parts), dtype=np.int32), [len(part.mesh.triangles) for part in parts]
        )
        self._scene.add_triangles(tensor(vertices), tensor(triangles))

    def cast(self, origins: Floats, directions: Floats) -> Hits:
        """Cast rays from (n, 3) or (3,) origins along (n, 3) directions, both in the map."""
        rays = np.empty((len(directions), 6), dtype=np.float32)
        rays[:, :3] = origins
        rays[:, 3:] = directions
        found = self._scene.cast_rays(self._tensor(rays))
        triangles = found["primitive_ids"].numpy().astype(np.int64)
        missed = triangles >= len(self._part_of_triangle)
        parts = self._part_of_triangle[np.where(missed, 0, triangles)]
        return Hits(
            found["t_hit"].numpy().astype(np.float64),
            found["primitive_normals"].numpy().astype(np.float64),
            np.where(missed, np.int32(-1), parts),
        )
