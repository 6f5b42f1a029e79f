"""Views of the depth camera below the top: whether a thing reaches the top, and visible posts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy import ndimage
from shapely.geometry import Polygon

from tablemap.config import LegsConfig, SensorsConfig
from tablemap.geometry import Bools, Floats, Pose2, invert, transform
from tablemap.stages.legs.evidence import LegEvidence
from tablemap.stages.legs.silhouettes import WALL_DISTANCE, Walls
from tablemap.stages.snapshots import Snapshot

_STRIDE = 2  # pixels: posts of 3 cm are still 4 columns wide at 2 m
_CELL = 0.02
_LAYER = 0.05
_MARGIN = 0.03  # metres beyond the outline: poses by depth err by so much
_LEAST_PIXELS = 6  # of a layer of a post, or of its face


@dataclass(frozen=True)
class Reach:
    """How many looks at a thing's upper part (under the top, above a seat) hit it or passed it."""

    hit: int
    passed: int

    @property
    def is_up(self) -> bool:
        """Whether something stands there."""
        return self.hit >= 3 and self.hit >= self.passed

    @property
    def is_free(self) -> bool:
        """Whether the views passed freely."""
        return self.passed >= 4 and self.hit <= 0.15 * self.passed


@dataclass(frozen=True, eq=False)
class Post:
    """Something upright under the top that only depth shows.

    ``points`` are (n, 2) in the map; ``reason`` says why it is no leg, None if it may be one.
    """

    centre: Floats
    size: float
    evidence: LegEvidence
    points: Floats
    views: int
    filled: float
    reason: str | None


def reach(
    snapshots: tuple[Snapshot, ...],
    poses: dict[int, Pose2],
    place: Floats,
    radius: float,
    lowest: float,
    highest: float,
) -> Reach:
    """Look for a thing's upper part (``lowest`` to ``highest`` metres) in every depth image.

    One look is a view at one height. If the visible surface goes on to both sides (a wall, a
    panel), the look counts neither for nor against.
    """
    heights = np.arange(lowest, highest, 0.04)
    hits = passes = 0
    if not len(heights):
        return Reach(0, 0)
    for index, map_from_base in poses.items():
        snapshot = snapshots[index]
        camera = snapshot.camera
        base_xy = map_from_base.inverse().apply(place)
        axis = np.column_stack([np.tile(base_xy, (len(heights), 1)), heights])
        seen = transform(invert(snapshot.base_from_camera), axis)
        z = seen[:, 2]
        u, v = camera.project(seen).T
        pixels = camera.fx / np.maximum(z, 0.1)
        ok = (z > 0.3) & (v >= 0) & (v < camera.height - 1) & (u > 0) & (u < camera.width - 1)
        if not ok.any():
            continue
        aside = np.linspace(-1.0, 1.0, 41) * (radius + 0.10)
        columns = np.round(u[ok, None] + pixels[ok, None] * aside).astype(np.int64)
        rows = np.round(v[ok]).astype(np.int64)[:, None]
        valid = (columns >= 0) & (columns < camera.width)
        depth = snapshot.depth[rows, np.clip(columns, 0, camera.width - 1)].astype(np.float64)
        off = np.where(valid & np.isfinite(depth), depth - z[ok, None], np.nan)
        at = np.abs(off) < radius + 0.04
        inner, outer = np.abs(aside) < radius + 0.02, np.abs(aside) > radius + 0.05
        goes_on = at[:, outer & (aside < 0)].any(axis=1) & at[:, outer & (aside > 0)].any(axis=1)
        core = np.abs(aside) < max(0.7 * radius, 0.006)
        through = (off[:, core] > radius + 0.08).any(axis=1)
        hit = at[:, inner].any(axis=1)
        blocked = (off[:, inner] < -radius - 0.06).any(axis=1)
        hits += int((hit & ~goes_on).sum())
        passes += int((through & ~hit & ~blocked).sum())
    return Reach(hits, passes)


def find_posts(
    snapshots: tuple[Snapshot, ...],
    poses: dict[int, Pose2],
    outline: Polygon,
    height: float,
    walls: Walls,
    *,
    config: LegsConfig,
    sensors: SensorsConfig,
) -> list[Post]:
    """Find upright things under the top that reach from near the floor up to it.

    Only pixels inside the outline, between 5 cm above the floor and 5 cm under the top, count. A
    post is a column of the map whose layers of 5 cm are mostly filled, the upper ones too. Points
    on one of the ``walls`` that the laser found are left out.
    """
    low, high = 0.05, height - 0.06
    layers = int((high - low) / _LAYER)
    if layers < 3 or not poses:
        return []
    grown = outline.buffer(_MARGIN)
    x0, y0, x1, y1 = grown.bounds
    shape = (int((x1 - x0) / _CELL) + 2, int((y1 - y0) / _CELL) + 2, layers)
    counts = np.zeros(shape, dtype=np.int64)
    by_view: dict[int, Floats] = {}
    for index, map_from_base in poses.items():
        snapshot = snapshots[index]
        rays = snapshot.camera.rays[::_STRIDE, ::_STRIDE]
        depth = snapshot.depth[::_STRIDE, ::_STRIDE]
        mount = snapshot.base_from_camera
        # Of most pixels the height is enough to leave them out.
        z = depth * (rays @ mount[2, :3].astype(np.float32)) + np.float32(mount[2, 3])
        with np.errstate(invalid="ignore"):
            between = (z > low) & (z < low + layers * _LAYER)
        points = transform(mount, rays[between] * depth[between, None])
        points = map_from_base.apply(points)
        points = points[shapely.contains_xy(grown, points[:, 0], points[:, 1])]
        for normal, offset in walls:
            points = points[np.abs(points[:, :2] @ normal - offset) > WALL_DISTANCE]
        by_view[index] = points
        cells = ((points - [x0, y0, low]) / [_CELL, _CELL, _LAYER]).astype(np.int64)
        np.add.at(counts, tuple(cells.T), 1)
    # A column's neighbours count too: noise spreads a post over them.
    spread = (
        ndimage.uniform_filter(counts.astype(np.float64), size=(3, 3, 1), mode="constant") * 9.0
    )
    filled = (counts > 0) & (spread >= _LEAST_PIXELS)
    share = filled.mean(axis=2)
    upper = filled[..., layers // 2 :].mean(axis=2)
    solid = (share >= 0.3) & (upper >= 0.3)
    labels, count = ndimage.label(solid, structure=np.ones((3, 3)))
    middle = low + 0.5 * layers * _LAYER
    posts = []
    for k in range(1, count + 1):
        own = labels == k
        cells = np.argwhere(own)
        centre = np.array([x0, y0]) + (cells.mean(axis=0) + 0.5) * _CELL
        size = float(np.max(np.ptp(cells, axis=0) + 1) * _CELL)
        column = filled[own].any(axis=0)
        posts.append(
            _post(snapshots, poses, by_view, centre, size, column, middle, config, sensors)
        )
    return [post for post in posts if post is not None]


def _post(
    snapshots: tuple[Snapshot, ...],
    poses: dict[int, Pose2],
    by_view: dict[int, Floats],
    centre: Floats,
    size: float,
    column: Bools,
    middle: float,
    config: LegsConfig,
    sensors: SensorsConfig,
) -> Post | None:
    """Describe one connected column: its silhouette and face in every view that saw it.

    ``middle`` is half of its height, metres.
    """
    normals, points, levers = [], [], []
    sigmas: list[float] = []
    groups: list[int] = []
    hits, rays, rows, hit_levers = [], [], [], []
    collected: list[Floats] = []
    for index, cloud in by_view.items():
        own = cloud[np.linalg.norm(cloud[:, :2] - centre, axis=1) < 0.5 * size + 0.03]
        if len(own) < _LEAST_PIXELS:
            continue
        base = poses[index]
        eye = base.apply(snapshots[index].base_from_camera[:2, 3])
        sight = centre - eye
        distance = float(np.hypot(*sight))
        sight = sight / distance
        left = np.array([-sight[1], sight[0]])
        aside, along = (own[:, :2] - eye) @ left, (own[:, :2] - eye) @ sight
        front = float(np.percentile(along, 10))
        face = np.abs(along - front) < 0.05
        if face.sum() < _LEAST_PIXELS:
            continue
        lateral = 1.5 * _STRIDE * distance / snapshots[index].camera.fx
        around_aside, around_along = (cloud[:, :2] - eye) @ left, (cloud[:, :2] - eye) @ sight
        around = np.abs(around_along - front - 0.025) < 0.075
        # A surface beside it at its depth (a wall close behind) hides its edge. What is low, as an
        # arm of its base or a box, leaves the edge of its upper half.
        upper_face, upper_around = face & (own[:, 2] > middle), around & (cloud[:, 2] > middle)
        for side in (-1.0, 1.0):
            edge = _edge(side * aside[face], side * around_aside[around])
            if edge is None:
                edge = _edge(side * aside[upper_face], side * around_aside[upper_around])
            if edge is None:
                continue
            point = eye + sight * (front + 0.01) + left * side * edge
            normals.append(left * side)
            points.append(point)
            sigmas.append(float(np.hypot(lateral, sensors.depth_silhouette_sigma)))
            groups.append(len(collected))
            levers.append(point - base.translation)
        face_points = own[face][:: max(1, int(face.sum()) // 100), :2]
        hits.append(face_points)
        rays.append(np.tile(sight, (len(face_points), 1)))
        rows.append(np.full(len(face_points), len(collected)))
        hit_levers.append(centre - base.translation)
        collected.append(own[:, :2])
    if not sigmas:
        return None
    evidence = LegEvidence(
        normal=np.array(normals),
        point=np.array(points),
        range=np.zeros(len(sigmas)),
        sigma=np.array(sigmas),
        group=np.array(groups, dtype=np.int64),
        lever=np.array(levers),
        hits=np.concatenate(hits),
        rays=np.concatenate(rays),
        row=np.concatenate(rows),
        hit_sigma=np.full(len(collected), sensors.depth_silhouette_sigma),
        hit_group=np.arange(len(collected)),
        hit_lever=np.array(hit_levers),
    )
    filled = float(column.mean())
    upper = float(column[len(column) // 2 :].mean())
    reason = None
    if size > config.largest_depth_leg:
        reason = f"{100 * size:.0f} cm across: too large for a leg that depth alone saw"
    elif filled < 0.6 or upper < 0.6:
        reason = f"fills {100 * filled:.0f} % of the height under the top: it carries nothing"
    return Post(centre, size, evidence, np.concatenate(collected), len(collected), filled, reason)


def _edge(face: Floats, around: Floats) -> float | None:
    """Return where a face ends on one side, None if a surface goes on beside it.

    ``face`` (n,) and ``around`` (m,) are places along that side, metres, of the face's points and
    of all points at its depth.
    """
    if len(face) < _LEAST_PIXELS:
        return None
    edge = float(np.percentile(face, 97))
    beyond = around - edge
    hidden = ((beyond > 0.01) & (beyond < 0.05)).sum() >= _LEAST_PIXELS
    return None if hidden else edge
