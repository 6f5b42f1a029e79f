"""The table's own edges in all views, laid onto each other."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tablemap.config import RegistrationConfig, SensorsConfig
from tablemap.geometry import Bools, Floats, Pose2
from tablemap.stages.outline import EdgeKind, Outline
from tablemap.stages.registration.graph import GraphEdge, edge_errors
from tablemap.stages.registration.polish import Polished, RangePrior, polish
from tablemap.stages.registration.result import StopScan
from tablemap.stages.snapshots import Snapshot

_LEAST_POINTS = 15
_CORRELATED_POINTS = 15.0  # neighbouring edge points that err together: they count as one
_SETTLED = 1e-4  # a tenth of a millimetre: smaller steps are noise
_POLISHES = 3
# Edges fix a heading where a turn about the top lowers the mean likelihood by at least this.
_TURNED_MARGIN = 0.1
_TURNED_POINTS = 200
_TURNED_NEAR = 0.10
_TURNED_SIGMA = 0.01
_NORMAL_COSINE = 0.9


@dataclass(frozen=True, eq=False)
class Laid:
    """The ``polished`` poses, and a mask ``kept`` (n,) of the held edges."""

    polished: Polished
    kept: Bools


def table_edges(
    snapshots: Sequence[Snapshot], outline: Outline | None
) -> tuple[StopScan | None, ...]:
    """Return each view's edge of the top in the form of a scan; None where the view shows none.

    The scan's ``directions`` are the points' offsets from the camera: a depth scale moves the
    points along these.
    """
    at = {snapshot.index: place for place, snapshot in enumerate(snapshots)}
    scans: list[StopScan | None] = [None] * len(snapshots)
    for view in () if outline is None else outline.views:
        real = (view.kind == EdgeKind.TABLE) & np.isfinite(view.points).all(axis=1)
        if real.sum() < _LEAST_POINTS:
            continue
        scans[at[view.index]] = StopScan(
            index=view.index,
            points=view.points[real],
            normals=view.normals[real],
            scans=1,
            directions=view.points[real] - view.camera_xy,
            origin=view.camera_xy,
            bearings=np.zeros(0),
            ranges=np.zeros(0),
            noise=float(np.median(view.sigma[real])),
        )
    return tuple(scans)


def lay_edges(
    edges: Sequence[StopScan | None],
    poses: Floats,
    held: Sequence[GraphEdge],
    config: RegistrationConfig,
    sensors: SensorsConfig,
    *,
    let_go: Bools | None = None,
) -> Laid:
    """Lay the table's edges in all views onto each other, from ``poses`` (n, 3).

    ``held`` are edges of the graph, used as priors. Where the result contradicts a held edge by
    more than its ``robust`` limit, that edge is dropped and the rest is solved again: otherwise a
    few wrong pairs would bend all views. The mask ``let_go`` (n,) drops held edges from the start.
    """
    present = [i for i, scan in enumerate(edges) if scan is not None]
    pairs = [(b, a) for a, b in itertools.combinations(present, 2)]
    if len(present) > config.partners:
        # Take the neighbours and a few views from all round: further ones add nothing new.
        apart = max(1, 2 * len(present) // config.partners)
        pairs = [(b, a) for b, a in pairs if b - a <= 2 or (b - a) % apart == 0]
    gates = config.gates
    limits = np.array([np.inf if edge.robust is None else edge.robust for edge in held])
    information = np.array([edge.information for edge in held]).reshape(-1, 3, 3)
    kept = np.ones(len(held), dtype=bool) if let_go is None else ~let_go
    for _ in range(_POLISHES):
        believed = list(itertools.compress(held, kept))
        polished = polish(
            edges,
            poses,
            pairs,
            believed,
            gates=gates,
            kernel=config.kernel,
            correlation=_CORRELATED_POINTS,
            ranges=RangePrior(sensors.calibrated_depth_scale_sigma_registration),
            settled=_SETTLED,
        )
        poses = polished.poses
        error = edge_errors(poses, held)
        agree = kept & (np.einsum("ni,nij,nj->n", error, information, error) < limits)
        if (agree == kept).all():
            break
        kept = agree
        # The next solution is near: the narrow gates are enough.
        gates = config.gates[-2:]
    return Laid(polished, kept)


def turning_edges(
    edges: Mapping[int, StopScan | None], located: Sequence[Pose2], turns: Sequence[Pose2]
) -> list[int]:
    """Return the views whose edges fix their heading: any of the turns fits clearly worse.

    ``located`` are the poses of all views, and ``turns`` are motions in the frame of these poses.
    """
    scans = {i: edge for i, edge in edges.items() if edge is not None}
    points = {i: located[i].apply(scan.points) for i, scan in scans.items()}
    normals = {i: located[i].rotate(scan.normals) for i, scan in scans.items()}
    turning = []
    for i, scan in scans.items():
        others = [j for j in scans if j != i]
        if not others:
            continue
        field = np.concatenate([points[j] for j in others])
        facing = np.concatenate([normals[j] for j in others])
        tree = cKDTree(field)
        stride = max(1, len(scan.points) // _TURNED_POINTS)
        own, ahead = points[i][::stride], normals[i][::stride]
        sigma = max(_TURNED_SIGMA, 2 * scan.noise)
        scores = [
            _edge_score(moved.apply(own), moved.rotate(ahead), tree, field, facing, sigma)
            for moved in [Pose2(0.0, 0.0, 0.0), *turns]
        ]
        if scores[0] > max(scores[1:]) + _TURNED_MARGIN:
            turning.append(i)
    return turning


def _edge_score(
    points: Floats, normals: Floats, tree: cKDTree, field: Floats, facing: Floats, sigma: float
) -> float:
    distance, index = tree.query(points, distance_upper_bound=_TURNED_NEAR)
    found = np.isfinite(distance)
    index = np.where(found, index, 0)
    found &= np.einsum("ni,ni->n", facing[index], normals) > _NORMAL_COSINE
    apart = np.einsum("ni,ni->n", facing[index], points - field[index])
    return float(np.where(found, np.exp(-0.5 * np.square(apart / sigma)), 0.0).mean())
