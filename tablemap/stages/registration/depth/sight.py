"""The upright surfaces and the free space that a depth view saw, compared with another view's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from tablemap.geometry import Floats, Pose2, invert, transform
from tablemap.stages.registration.depth.cloud import balanced_cloud
from tablemap.stages.registration.pairs import Cloud
from tablemap.stages.snapshots import Camera, Snapshot

_POINTS = 300
_AROUND = 5  # pixels a side: a line of sight beside a depth edge says nothing
_NEAREST = 0.3
_MARGIN = 0.2  # metres: points this near to the range limit may be cut off in the other view
_HIDDEN = 0.15  # metres: a point this far behind the seen surface is hidden from the other view
_THROUGH = 0.2  # metres: the other view saw through a point this far before the seen surface
_FACING = 0.2  # cosine: a surface turned further away is not seen
_NEAR = 0.10
_NEIGHBOURS = 4
_NORMAL_COSINE = 0.9
_SIGMA = 0.03  # metres off the other view's surface: depth at three metres errs by so much


@dataclass(frozen=True, eq=False)
class UprightSight:
    """A view's upright points, and the depth that it saw.

    - ``points``, ``normals``: the points that are looked up in other views
    - ``every``: all upright points, among which other views' points are looked up
    - ``nearest``: (height, width) metres, the least depth about each pixel, 0 where any is missing
    """

    points: Floats
    normals: Floats
    every: Cloud
    nearest: NDArray[np.float32]
    camera: Camera
    camera_from_base: Floats
    origin: Floats
    maximum_range: float


@dataclass(frozen=True)
class Sighting:
    """How well the upright points of two views fit.

    - ``points``: how many points both views could see
    - ``score``: in [0, 1], the mean likelihood that a point lies on a surface of the other view and
      has its normal
    - ``violation``: the share of points in space that the other view saw through
    """

    points: int
    score: float
    violation: float


def make_sight(snapshot: Snapshot, every: Cloud, *, maximum_range: float) -> UprightSight:
    """Prepare a view, given ``every`` upright point of it, for comparison with others."""
    some = balanced_cloud(every, _POINTS)
    depth = snapshot.depth
    measured = np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0))
    return UprightSight(
        points=some.points,
        normals=some.normals,
        every=every,
        nearest=np.asarray(minimum_filter(measured, _AROUND, mode="constant"), dtype=np.float32),
        camera=snapshot.camera,
        camera_from_base=invert(snapshot.base_from_camera),
        origin=snapshot.base_from_camera[:3, 3],
        maximum_range=maximum_range,
    )


def sighting(first: UprightSight, second: UprightSight, second_from_first: Pose2) -> Sighting:
    """Compare two views' upright points, in both directions."""
    there = _seen_by(second, first, second_from_first)
    back = _seen_by(first, second, second_from_first.inverse())
    points, score, violation = np.add(there, back)
    count = max(points, 1.0)
    return Sighting(int(points), float(score / count), float(violation / count))


def _seen_by(watcher: UprightSight, other: UprightSight, pose: Pose2) -> tuple[float, float, float]:
    """Return the number of the other's points in sight, and the sums of scores and violations."""
    points = pose.apply(other.points)
    normals = np.column_stack([pose.rotate(other.normals[:, :2]), other.normals[:, 2]])
    camera = watcher.camera
    in_camera = transform(watcher.camera_from_base, points)
    depth = in_camera[:, 2]
    before = (depth > _NEAREST) & (depth < watcher.maximum_range - _MARGIN)
    safe = np.where(before, depth, 1.0)
    u = np.round(in_camera[:, 0] / safe * camera.fx + camera.cx)
    v = np.round(in_camera[:, 1] / safe * camera.fy + camera.cy)
    inside = before & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    pixels = np.where(inside, v, 0).astype(np.intp), np.where(inside, u, 0).astype(np.intp)
    nearest = np.where(inside, watcher.nearest[pixels], 0.0)
    towards = watcher.origin - points
    facing = np.einsum("ni,ni->n", towards, normals) > _FACING * np.linalg.norm(towards, axis=1)
    sight = facing & (nearest > 0) & (depth < nearest + _HIDDEN)
    if not sight.any():
        return 0.0, 0.0, 0.0
    points, normals = points[sight], normals[sight]
    distance, index = watcher.every.tree.query(points, k=_NEIGHBOURS, distance_upper_bound=_NEAR)
    found = np.isfinite(distance)
    index = np.where(found, index, 0)
    onto = watcher.every.normals[index]
    found &= np.einsum("nki,ni->nk", onto, normals) > _NORMAL_COSINE
    apart = np.einsum("nki,nki->nk", onto, points[:, None] - watcher.every.points[index])
    likely = np.where(found, np.exp(-0.5 * np.square(apart / _SIGMA)), 0.0).max(axis=1)
    through = depth[sight] < nearest[sight] - _THROUGH
    return float(sight.sum()), float(likely.sum()), float(through.sum())
