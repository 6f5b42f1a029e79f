"""The true share of the top that each image shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from tablemap.geometry import Floats, transform
from tablemap.simulation.camera import DepthCamera
from tablemap.simulation.relief import Relief
from tablemap.simulation.scene import Scene
from tablemap.simulation.world import World

_PLACES = 600
_TOLERANCE = 0.002  # metres: a ray that comes so near to a place has met it


@dataclass(frozen=True)
class TopSeen:
    """Shares of the top's area.

    - ``in_image``: inside of the image, hidden or not
    - ``unhidden``: inside of the image, and nothing stands in front of it or on it
    """

    in_image: float
    unhidden: float


def places_on_top(world: World) -> Floats:
    """Return points (n, 3) in the map, evenly spread over the top."""
    low, high = world.top.outline.min(axis=0), world.top.outline.max(axis=0)
    spacing = np.sqrt(world.top.polygon.area / _PLACES)
    lines = [np.arange(a + spacing / 2, b, spacing) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*lines), axis=-1).reshape(-1, 2)
    places = grid[shapely.contains_xy(world.top.polygon, grid)]
    return np.column_stack(
        [world.map_from_table.apply(places), world.top.height + _rises(world.relief, places)]
    )


def _rises(relief: Relief | None, places: Floats) -> Floats:
    return relief.rises(places) if relief else np.zeros(len(places))


def top_seen(places: Floats, scene: Scene, camera: DepthCamera, map_from_camera: Floats) -> TopSeen:
    """Return the shares of the top's places (n, 3) that an image shows."""
    inside = camera.sees(transform(np.asarray(np.linalg.inv(map_from_camera)), places))
    origin = map_from_camera[:3, 3]
    rays = places - origin
    met = scene.cast(origin, rays).distance * np.linalg.norm(rays, axis=1)
    free = met > np.linalg.norm(rays, axis=1) - _TOLERANCE
    return TopSeen(float(inside.mean()), float((inside & free).mean()))
