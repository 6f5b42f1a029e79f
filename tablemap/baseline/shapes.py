"""The concave hull of the report, and its two shapes, found by RANSAC among the hull points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import Delaunay

from tablemap.errors import EstimationError
from tablemap.geometry import Floats
from tablemap.model.shapes import CIRCLE, MESH, PARALLELOGRAM

TRIALS = 4000


@dataclass(frozen=True, eq=False)
class Found:
    """A shape that was found.

    - ``shape``: its name
    - ``x``, ``y``, ``yaw``: pose of its centroid in the map, metres and radians
    - ``dimensions``: by name, metres; an angle in radians
    - ``outline``: (n, 2), metres, in the map
    - ``score``: share of the hull points that are inliers
    """

    shape: str
    x: float
    y: float
    yaw: float
    dimensions: dict[str, float]
    outline: Floats
    score: float

    @staticmethod
    def of_hull(hull: Floats) -> Found:
        """Return the hull as a mesh; its points are ordered by their directions from the middle."""
        centre = hull.mean(axis=0)
        order = np.argsort(np.arctan2(*(hull - centre).T[::-1]))
        polygon = shapely.Polygon(hull[order])
        middle = polygon.centroid
        return Found(MESH.name, middle.x, middle.y, 0.0, {}, hull[order], 0.0)


def hull_points(points: Floats, alpha: float) -> Floats:
    """Return the (n, 2) vertices on the rim of the alpha shape (Edelsbrunner 1983).

    Raises `EstimationError` if all points lie on one line, or the alpha shape has no rim.
    """
    flat = np.unique(np.round(points, 4), axis=0)
    if len(flat) < 4 or np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False)[1] < 1e-3:
        raise EstimationError("the joined cloud lies on a line; look at the snapshots in run.rrd.")
    triangles = Delaunay(flat).simplices
    corners = flat[triangles]
    a, b, c = (np.hypot(*(corners[:, i] - corners[:, j]).T) for i, j in ((0, 1), (1, 2), (2, 0)))
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    kept = triangles[a * b * c <= 4 * np.maximum(area, 1e-12) * alpha]
    edges = np.sort(np.vstack([kept[:, [0, 1]], kept[:, [1, 2]], kept[:, [2, 0]]]), axis=1)
    edges, counts = np.unique(edges, axis=0, return_counts=True)
    rim: Floats = flat[np.unique(edges[counts == 1])]
    if len(rim) < 4:
        raise EstimationError("the joined cloud has no hull; look at the snapshots in run.rrd.")
    return rim


def find_circle(hull: Floats, threshold: float, rng: np.random.Generator) -> Found | None:
    """Find the circle through three points with the most inliers, and refine it on these."""
    p, q, r = (hull[rng.integers(len(hull), size=TRIALS)] for _ in range(3))
    d = 2 * (p[:, 0] * (q - r)[:, 1] + q[:, 0] * (r - p)[:, 1] + r[:, 0] * (p - q)[:, 1])
    valid = np.abs(d) > 1e-6
    if not valid.any():
        return None
    p, q, r, d = p[valid], q[valid], r[valid], d[valid]
    pp, qq, rr = ((s**2).sum(axis=1) for s in (p, q, r))
    x = (pp * (q - r)[:, 1] + qq * (r - p)[:, 1] + rr * (p - q)[:, 1]) / d
    y = (pp * (r - q)[:, 0] + qq * (p - r)[:, 0] + rr * (q - p)[:, 0]) / d
    radius = np.hypot(p[:, 0] - x, p[:, 1] - y)
    ranges = np.hypot(hull[:, 0] - x[:, None], hull[:, 1] - y[:, None])
    inliers = np.abs(ranges - radius[:, None]) <= threshold
    inliers[radius > 5.0] = False
    best = inliers[np.argmax(inliers.sum(axis=1))]
    if best.sum() < 3:
        return None
    # Algebraic least squares on the inliers (Kasa 1976).
    on = hull[best]
    solution, *_ = np.linalg.lstsq(
        np.column_stack([2 * on, np.ones(len(on))]), (on**2).sum(axis=1), rcond=None
    )
    cx, cy = float(solution[0]), float(solution[1])
    fitted = float(np.sqrt(max(solution[2] + cx**2 + cy**2, 0.0)))
    turns = 2 * np.pi * np.arange(72) / 72
    outline = np.column_stack([cx + fitted * np.cos(turns), cy + fitted * np.sin(turns)])
    score = float((np.abs(np.hypot(*(hull - [cx, cy]).T) - fitted) <= threshold).mean())
    return Found(CIRCLE.name, cx, cy, 0.0, {"diameter": 2 * fitted}, outline, score)


def find_parallelogram(hull: Floats, threshold: float, rng: np.random.Generator) -> Found | None:
    """Find two parallel lines through three points, remove their inliers, and find two more."""
    first = _parallel_lines(hull, threshold, rng)
    if first is None:
        return None
    second = _parallel_lines(hull[~first.inliers(hull, threshold)], threshold, rng)
    if second is None:
        return None
    crossing = np.array([first.normal, second.normal])
    if abs(np.linalg.det(crossing)) < 0.3:
        return None
    corners = [
        np.linalg.solve(crossing, [first.offsets[i], second.offsets[j]])
        for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
    ]
    outline = np.array(shapely.geometry.polygon.orient(shapely.Polygon(corners)).exterior.coords)[
        :4
    ]
    sides = np.roll(outline, -1, axis=0) - outline
    lengths = np.hypot(*sides.T)
    along = int(lengths[1] > lengths[0])
    length, width = lengths[along], lengths[1 - along]
    # Counter-clockwise from length to width, at the corner where the long side begins.
    u, v = sides[along], -sides[along - 1]
    angle = float(np.arctan2(u[0] * v[1] - u[1] * v[0], u @ v))
    on_lines = first.inliers(hull, threshold) | second.inliers(hull, threshold)
    x, y = outline.mean(axis=0)
    return Found(
        PARALLELOGRAM.name,
        float(x),
        float(y),
        float(np.arctan2(u[1], u[0]) % np.pi),
        {"length": float(length), "width": float(width), "angle": angle},
        outline,
        float(on_lines.mean()),
    )


@dataclass(frozen=True, eq=False)
class _Lines:
    """Two parallel lines: ``normal @ x`` of their points x is one of the two ``offsets``."""

    normal: Floats
    offsets: Floats

    def inliers(self, points: Floats, threshold: float) -> np.ndarray:
        return np.asarray(
            (np.abs((points @ self.normal)[:, None] - self.offsets) <= threshold).any(axis=1)
        )


def _parallel_lines(points: Floats, threshold: float, rng: np.random.Generator) -> _Lines | None:
    if len(points) < 4:
        return None
    p, q, r = (points[rng.integers(len(points), size=TRIALS)] for _ in range(3))
    along = q - p
    length = np.hypot(*along.T)
    normals = np.column_stack([-along[:, 1], along[:, 0]]) / np.maximum(length, 1e-9)[:, None]
    first, second = (normals * p).sum(axis=1), (normals * r).sum(axis=1)
    # Two lines with the same inliers are one line.
    valid = (length > 2 * threshold) & (np.abs(second - first) > 2 * threshold)
    if not valid.any():
        return None
    normals, first, second = normals[valid], first[valid], second[valid]
    projected = normals @ points.T
    near_first = np.abs(projected - first[:, None]) <= threshold
    near_second = np.abs(projected - second[:, None]) <= threshold
    best = int(np.argmax((near_first | near_second).sum(axis=1)))
    # Total least squares on the inliers: both lines have one direction, each has an offset.
    groups = [points[near_first[best]], points[near_second[best]]]
    centred = np.vstack([group - group.mean(axis=0) for group in groups])
    normal = np.linalg.svd(centred, full_matrices=False)[2][1]
    offsets = np.array([float(group.mean(axis=0) @ normal) for group in groups])
    return _Lines(normal, offsets)
