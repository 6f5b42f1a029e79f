"""The upright surfaces in a depth image, as points with normals: they bind x, y and yaw."""

from __future__ import annotations

import numpy as np

from tablemap import imports
from tablemap.geometry import Floats, transform
from tablemap.stages.registration.pairs import Cloud, make_cloud
from tablemap.stages.snapshots import Snapshot

_EVERY_PIXEL = 3
_VOXEL = 0.03
_NORMAL_RADIUS = 0.09
_NORMAL_NEIGHBOURS = 30
# The least share of a normal's length in the plane. Below it, a surface is floor or table top: such
# surfaces bind nothing in the plane.
_UPRIGHT = 0.35
_LEAST_HEIGHT = 0.06  # metres over the floor
_AZIMUTHS = 18
_LEAST_POINTS = 60


def upright_cloud(snapshot: Snapshot, *, maximum_range: float) -> Cloud | None:
    """Return points on upright surfaces, in the base, one a voxel; None where there are few."""
    open3d = imports.open3d()
    every = snapshot.depth[::_EVERY_PIXEL, ::_EVERY_PIXEL]
    seen = np.isfinite(every) & (every > 0) & (every < maximum_range)
    rays = snapshot.camera.rays[::_EVERY_PIXEL, ::_EVERY_PIXEL][seen]
    in_base = transform(snapshot.base_from_camera, rays * every[seen, None])
    # Floor points are no use. They would also bend the normals of the things that stand on it.
    in_base = in_base[in_base[:, 2] > _LEAST_HEIGHT / 2]
    if len(in_base) < _LEAST_POINTS:
        return None
    cloud = open3d.geometry.PointCloud()
    cloud.points = open3d.utility.Vector3dVector(np.ascontiguousarray(in_base))
    cloud = cloud.voxel_down_sample(_VOXEL)
    cloud.estimate_normals(
        open3d.geometry.KDTreeSearchParamHybrid(_NORMAL_RADIUS, _NORMAL_NEIGHBOURS)
    )
    cloud.orient_normals_towards_camera_location(snapshot.base_from_camera[:3, 3])
    # Open3D's threads sum in any order, which changes the last bits: rounding makes runs repeat.
    places = np.round(np.asarray(cloud.points), 7)
    normals = np.round(np.asarray(cloud.normals), 7)
    upright = np.linalg.norm(normals[:, :2], axis=1) > _UPRIGHT
    upright &= np.isfinite(places).all(axis=1) & (places[:, 2] > _LEAST_HEIGHT)
    places, normals = places[upright], normals[upright]
    if len(places) < _LEAST_POINTS:
        return None
    return make_cloud(places, normals)


def balanced_cloud(cloud: Cloud, points: int) -> Cloud:
    """Return up to ``points`` of a cloud's points, with the azimuths of their normals balanced.

    Rare directions keep all their points, so that one large wall does not outvote the rest.
    """
    kept = balanced(np.arctan2(cloud.normals[:, 1], cloud.normals[:, 0]), points)
    return make_cloud(cloud.points[kept], cloud.normals[kept])


def balanced(azimuths: Floats, wanted: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return the indices of at most ``wanted`` azimuths, spread over the circle evenly."""
    bins = ((azimuths + np.pi) / (2 * np.pi) * _AZIMUTHS).astype(np.int64) % _AZIMUTHS
    counts = np.bincount(bins, minlength=_AZIMUTHS)
    # Find the number of points a bin at which all bins together hold the wanted number.
    low, high = 0, int(counts.max(initial=1))
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (
            (middle, high) if np.minimum(counts, middle).sum() <= wanted else (low, middle - 1)
        )
    chosen = []
    for azimuth in range(_AZIMUTHS):
        inside = np.flatnonzero(bins == azimuth)
        count = min(len(inside), max(low, 1))
        if count:
            chosen.append(inside[np.linspace(0, len(inside) - 1, count).astype(np.intp)])
    return np.sort(np.concatenate(chosen)) if chosen else np.zeros(0, dtype=np.intp)
