"""Edges that run inside of the outline: they hint at two surfaces of one height taken for one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tablemap.config import SurfaceConfig
from tablemap.geometry import Floats
from tablemap.stages.surface.shapes.shape import signed_distance

_REACH = 0.05  # metres between neighbours of one line
_WIDEST = 0.025  # metres across a line of edge points, as their spread


@dataclass(frozen=True)
class InnerEdge:
    """A line of ``points`` edge points inside of the outline, ``length`` metres long.

    ``ends`` are the places of its two ends, metres as the points are.
    """

    length: float
    points: int
    ends: tuple[tuple[float, float], tuple[float, float]]


def inner_edges(points: Floats, corners: Floats, config: SurfaceConfig) -> list[InnerEdge]:
    """Return the lines that table-edge points (n, 2) form inside of an outline (m, 2).

    At an edge point a lower surface begins. Things on the top and holes in the depth image make no
    edge points. So a row of edge points well inside the outline is a gap between two surfaces, or a
    cut-out that no known shape has. The robust fit treats such a row as outliers.
    """
    inside = points[signed_distance(points, corners) < -config.inner_depth]
    if len(inside) < config.inner_points:
        return []
    # Imported here: most tables have no such edges.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = cKDTree(inside).query_pairs(_REACH, output_type="ndarray")
    joined = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(inside),) * 2)
    count, label = connected_components(joined, directed=False)
    found = []
    for which in range(count):
        mine = inside[label == which]
        if len(mine) < config.inner_points:
            continue
        middle = mine.mean(axis=0)
        centred = mine - middle
        _, axes = np.linalg.eigh(centred.T @ centred)
        across, along = (centred @ axes).T
        length = float(np.ptp(along))
        if length >= config.inner_length and float(np.std(across)) < _WIDEST:
            ends = middle + np.outer([along.min(), along.max()], axes[:, 1])
            (x0, y0), (x1, y1) = ends.tolist()
            found.append(InnerEdge(length, len(mine), ((x0, y0), (x1, y1))))
    return sorted(found, key=lambda edge: (-edge.length, -edge.points))
