"""Tops as eight views round them see them, and poses of these views: right, moved, tied."""

from __future__ import annotations

import numpy as np

from tablemap.geometry import Floats, Pose2
from tablemap.stages.outline import EdgeKind, Outline, ViewEdges
from tablemap.stages.registration.depth.check import Checked, check_views
from tablemap.stages.registration.depth.edges import table_edges
from tablemap.stages.registration.graph import GraphEdge

VIEWS = 8


class Seen:
    """A top as eight views round it see it: its edge every centimetre, votes every two."""

    def __init__(self, ring: Floats, normals: Floats, *, seed: int = 0) -> None:
        """Place the views 1.4 m from the middle, looking at it; ``ring`` (n, 2) is the edge."""
        rng = np.random.default_rng(seed)
        angle = np.arange(VIEWS) * 2 * np.pi / VIEWS
        self.poses = np.stack([1.4 * np.cos(angle), 1.4 * np.sin(angle), angle + np.pi], axis=1)
        axis = np.arange(-1.2, 1.2, 0.02)
        grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
        # Convex tops: a point lies inside where it is behind every edge.
        inside = ((grid[:, None] - ring[None, ::5]) * normals[None, ::5]).sum(-1).max(1) < 0
        views = []
        for i, pose in enumerate(self.poses):
            base = Pose2.from_array(pose).inverse()
            noise = rng.normal(0, 0.002, (len(ring), 1)) * normals
            views.append(
                ViewEdges(
                    index=i,
                    points=base.apply(ring + noise),
                    normals=base.rotate(normals),
                    sigma=np.full(len(ring), 0.002),
                    kind=np.full(len(ring), EdgeKind.TABLE, dtype=np.uint8),
                    is_near=np.zeros(len(ring), dtype=bool),
                    widening=np.zeros(len(ring)),
                    hole=np.zeros(len(ring)),
                    metres_per_px=np.full(len(ring), 0.003),
                    pixels=np.zeros((len(ring), 2)),
                    camera_xy=np.zeros(2),
                    drop=0.4,
                    axis=np.array([0.8, 0.0, -0.6]),
                    top=base.apply(grid[inside]),
                    free=base.apply(grid[~inside]),
                )
            )
        self.outline = Outline(tuple(views), 0.7, 0.001, {}, None, None, ())
        self.edges = table_edges([_Indexed(i) for i in range(VIEWS)], self.outline)  # type: ignore[misc]

    def check(self, poses: Floats) -> Checked:
        """Check the views at other poses."""
        return check_views(self.outline, self.edges, poses)


class _Indexed:
    def __init__(self, index: int) -> None:
        self.index = index


def rectangle(length: float = 1.2, width: float = 0.8) -> Seen:
    """A rectangular top."""
    parts, normals = [], []
    for reach, along, normal in (
        (length / 2, width, (1, 0)),
        (length / 2, width, (-1, 0)),
        (width / 2, length, (0, 1)),
        (width / 2, length, (0, -1)),
    ):
        n = np.array(normal, dtype=np.float64)
        t = np.arange(-along / 2, along / 2, 0.01)[:, None]
        parts.append(n * reach + t * n[::-1])
        normals.append(np.tile(n, (len(t), 1)))
    return Seen(np.concatenate(parts), np.concatenate(normals))


def disc(diameter: float = 0.6) -> Seen:
    """A round top."""
    angle = np.arange(0, 2 * np.pi, 0.02)
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return Seen(diameter / 2 * normals, normals)


def moved(poses: Floats, which: list[int], step: Pose2) -> Floats:
    """Return the poses with some of them moved in their own base."""
    result = poses.copy()
    for i in which:
        result[i] = (Pose2.from_array(poses[i]) @ step).as_array()
    return result


def chain(poses: Floats, sigma: float = 0.03) -> list[GraphEdge]:
    """Tie each view to the one before it where ``poses`` have them."""
    information = np.diag(1 / np.square([sigma, sigma, sigma]))
    return [
        GraphEdge(
            i,
            i - 1,
            Pose2.from_array(poses[i - 1]).inverse() @ Pose2.from_array(poses[i]),
            information,
        )
        for i in range(1, len(poses))
    ]
