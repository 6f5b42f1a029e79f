"""Registration without a laser: pairs of depth views, by what stands upright in them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from tablemap.config import OutlineConfig, RegistrationConfig
from tablemap.errors import EstimationError, ProcessWarning
from tablemap.geometry import Floats, Pose2
from tablemap.odometry import Odometry
from tablemap.record import Record
from tablemap.registration.depth_cloud import upright_cloud
from tablemap.registration.graph import (
    Anchor,
    Edge,
    GraphSolution,
    relative_covariance,
    solve_graph,
)
from tablemap.registration.pairs import Cloud, align_depth_pair
from tablemap.registration.polish import Polished, polish
from tablemap.registration.results import Pair, StopCheck, StopScan
from tablemap.registration.solution import (
    Solution,
    floored,
    judge_pair,
    localisation_anchors,
    odometry_edges,
    odometry_pairs,
    pose_list,
)
from tablemap.segmentation import Segmentation
from tablemap.snapshots import Snapshot

_GAPS = (1, 2, 3, 5, 8)
_OVERLAP_REACH = 0.2
_OVERLAP_POINTS = 150
_PAIR_ROBUST = 9.0
_LEAST_EDGE_POINTS = 15
_INDEPENDENT_PAIRS = 4
_PAIR_SIGMA = (0.01, 0.01, 0.005)  # no depth pair is believed further than this
_EDGE_SETTLED = 1e-4  # a tenth of a millimetre: what is left of it is noise
# A tilt t lifts the floor at d by d t and shifts what lies on a plane c lower by (c + x x / c) t.
_SIDEWAYS = 1.5
_FLOOR_STRIDE = 6
_FLOOR_BAND = 0.03  # metres
_LEAST_FLOOR = 100


def register_depth(
    snapshots: tuple[Snapshot, ...],
    segmentation: Segmentation,
    odometry: Odometry,
    initial: Floats,
    *,
    config: RegistrationConfig,
    seed: int,
    record: Record,
) -> Solution:
    """Register the views by their depth from ``initial`` (n, 3), as far as it can be trusted.

    Pairs of upright surfaces tie a graph of odometry and localisation; then the table's own edges
    are laid onto each other in all views at once, with the depth's scale as a nuisance. What none
    of this shows is a wrong focal length: it shifts all that a view sees by that share of its
    distance, and is the systematic part.
    """
    clouds = {}
    for i, snapshot in enumerate(snapshots):
        cloud = upright_cloud(
            snapshot, maximum_range=config.depth_range, points=config.depth_points
        )
        if cloud is not None:
            clouds[i] = cloud
    edges = odometry_edges(snapshots, odometry)
    anchors = localisation_anchors(snapshots, config)
    graph = solve_graph(initial, edges, anchors)
    pairs: list[Pair] = []
    for round_ in range(config.depth_rounds):
        located = pose_list(graph.poses)
        chosen = choose_views(clouds, located, config)
        pairs = [
            align_depth_pair(
                source,
                target,
                kind,
                (clouds[source], clouds[target]),
                located[target].inverse() @ located[source],
                # What the graph has laid right needs no wide gate again.
                gates=config.depth_gates[min(round_, len(config.depth_gates) - 1) :],
                kernel=config.depth_kernel,
                most_points=config.depth_pair_points,
                record=record,
            )
            for source, target, kind in chosen
        ]
        graph, pairs = _solve(graph, pairs, edges, anchors)
    held = _held(graph, pairs, edges)
    outlines = table_edges(snapshots, segmentation)
    polished = _polish(outlines, graph, held, config)
    poses, covariance = polished.poses, polished.covariance
    steps = np.linalg.norm(
        (poses - graph.poses)[:, :2] - (poses - graph.poses)[:, :2].mean(0), axis=1
    )
    warnings: list[ProcessWarning] = []
    if steps.max(initial=0.0) > config.depth_largest_step:
        poses, covariance = graph.poses, graph.covariance
        message = (
            f"the table's edges would move a snapshot by {steps.max():.2f} m; they are not used, "
            "and the snapshots' poses rest on odometry, localisation and depth pairs"
        )
        warnings.append(ProcessWarning("accuracy.registration_unchecked", "registration", message))
    informed = any(pair.used for pair in pairs) or polished.matched.any()
    return Solution(
        poses=poses,
        covariance=relative_covariance(poses, covariance + _tilt_covariance(snapshots)),
        pairs=(*pairs, *odometry_pairs(edges, graph.edge_weights[: len(edges)])),
        checks=_checks(pairs, polished, steps, len(snapshots)),
        source="depth" if informed else "localisation",
        systematic=config.depth_focal_sigma * _reach(outlines, poses),
        warnings=tuple(warnings),
    )


def table_edges(
    snapshots: tuple[Snapshot, ...], segmentation: Segmentation
) -> tuple[StopScan | None, ...]:
    """Return each view's edge of the top as a scan of it, None where the view shows none.

    Its ``directions`` are the points' offsets from the camera: along them a depth scale moves them.
    """
    from tablemap.outline import EdgeKind, find_edges

    try:
        outline = find_edges(snapshots, segmentation, None, config=OutlineConfig())
    except EstimationError:
        return (None,) * len(snapshots)
    at = {snapshot.index: place for place, snapshot in enumerate(snapshots)}
    scans: list[StopScan | None] = [None] * len(snapshots)
    for view in outline.views:
        real = (view.kind == EdgeKind.TABLE) & np.isfinite(view.points).all(axis=1)
        if real.sum() < _LEAST_EDGE_POINTS:
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


def _polish(
    outlines: tuple[StopScan | None, ...],
    graph: GraphSolution,
    held: Sequence[Edge],
    config: RegistrationConfig,
) -> Polished:
    """Lay the outlines of all views onto each other, over what the graph knows."""
    present = [i for i, outline in enumerate(outlines) if outline is not None]
    pairs = [(b, a) for a, b in itertools.combinations(present, 2)]
    if len(present) > config.partners:
        # Neighbours, and a few from all round: the rest says the same again.
        apart = max(1, 2 * len(present) // config.partners)
        pairs = [(b, a) for b, a in pairs if b - a <= 2 or (b - a) % apart == 0]
    edge_config = config.model_copy(
        update={
            "range_bias_sigma": config.depth_scale_sigma,
            "correlation": config.edge_correlation,
        }
    )
    return polish(outlines, graph.poses, pairs, held, config=edge_config, settled=_EDGE_SETTLED)


def _held(graph: GraphSolution, pairs: Sequence[Pair], edges: Sequence[Edge]) -> list[Edge]:
    """Return what the graph believed, as far as it did, the odometry freed of its yaw scale."""
    held = []
    for edge, weight in zip(edges, graph.edge_weights[: len(edges)], strict=True):
        step = edge.target_from_source
        scale = graph.yaw_scale if edge.turns_with_scale else 0.0
        turned = Pose2(step.x, step.y, step.yaw * (1 + scale))
        held.append(replace(edge, target_from_source=turned, information=weight * edge.information))
    used = [pair for pair in pairs if pair.used]
    views = len({index for pair in used for index in (pair.source, pair.target)})
    # A view errs alike in all its pairs: more than a few of them add little.
    share = min(1.0, _INDEPENDENT_PAIRS * max(views, 1) / max(2 * len(used), 1))
    held += [
        Edge(p.source, p.target, p.target_from_source, share * floored(p.information, _PAIR_SIGMA))
        for p in used
    ]
    return held


def _reach(outlines: Sequence[StopScan | None], poses: Floats) -> float:
    """Return how far what is seen lies from the views, in metres."""
    seen = [outline.directions for outline in outlines if outline is not None]
    if seen:
        return float(np.median(np.linalg.norm(np.concatenate(seen), axis=1)))
    centred = poses[:, :2] - poses[:, :2].mean(axis=0)
    return float(np.sqrt(np.mean(np.sum(centred**2, axis=1))))


def _tilt_covariance(snapshots: Sequence[Snapshot]) -> Floats:
    """Return (3n, 3n): what each view's own tilt adds, as the floors of the views disagree.

    A camera held by hand tilts differently in every view. The tilt that lifts the floor moves what
    lies on the top sideways by about `_SIDEWAYS` times as much, alike in all of the view.
    """
    medians = []
    for snapshot in snapshots:
        depth = snapshot.depth[::_FLOOR_STRIDE, ::_FLOOR_STRIDE]
        up = snapshot.base_from_camera[2, :3]
        rays = snapshot.camera.rays[::_FLOOR_STRIDE, ::_FLOOR_STRIDE]
        height = (rays @ up) * depth + snapshot.base_from_camera[2, 3]
        floor = height[np.abs(height) < _FLOOR_BAND]
        if len(floor) >= _LEAST_FLOOR:
            medians.append(float(np.median(floor)))
    if len(medians) < 2:
        return np.zeros((3 * len(snapshots), 3 * len(snapshots)))
    sideways = _SIDEWAYS * float(np.sqrt(np.mean(np.square(medians))))
    return np.diag(np.tile(np.square([sideways, sideways, 0.0]), len(snapshots)))


def _checks(
    pairs: Sequence[Pair], polished: Polished, steps: Floats, count: int
) -> tuple[StopCheck, ...]:
    used = [pair for pair in pairs if pair.used]
    return tuple(
        StopCheck(
            i,
            True,
            {
                "pairs": float(sum(i in (pair.source, pair.target) for pair in used)),
                "edge_points": float(polished.matched[i]),
                "edge_rms": polished.rms,
                "moved": float(steps[i]),
            },
            (),
        )
        for i in range(count)
    )


def choose_views(
    clouds: dict[int, Cloud], located: Sequence[Pose2], config: RegistrationConfig
) -> list[tuple[int, int, str]]:
    """Return (source, target, kind) of views that follow each other or that see the same."""
    trees = {i: cKDTree(located[i].apply(cloud.points)) for i, cloud in clouds.items()}
    chosen: dict[tuple[int, int], str] = {}
    for i, cloud in clouds.items():
        points = located[i].apply(cloud.points[:: max(1, len(cloud.points) // _OVERLAP_POINTS)])
        shares: list[tuple[float, int]] = []
        for j in clouds:
            if j >= i:
                continue
            distance, _ = trees[j].query(points, distance_upper_bound=_OVERLAP_REACH)
            share = float(np.isfinite(distance).mean())
            if share < config.minimum_overlap:
                continue
            if i - j in _GAPS:
                chosen[i, j] = "depth"
            else:
                shares.append((share, j))
        for _, j in sorted(shares, reverse=True)[: config.depth_loops]:
            chosen[i, j] = "loop"
    return [(s, t, kind) for (s, t), kind in sorted(chosen.items())]


def _solve(
    graph: GraphSolution, pairs: Sequence[Pair], edges: Sequence[Edge], anchors: Sequence[Anchor]
) -> tuple[GraphSolution, list[Pair]]:
    good = [pair for pair in pairs if pair.used]
    pair_edges = [
        Edge(
            p.source,
            p.target,
            p.target_from_source,
            floored(p.information, _PAIR_SIGMA),
            robust=_PAIR_ROBUST,
        )
        for p in good
    ]
    solved = solve_graph(graph.poses, [*edges, *pair_edges], anchors)
    weights = dict(zip(map(id, good), solved.edge_weights[len(edges) :], strict=True))
    return solved, [judge_pair(p, weights.get(id(p)), solved.poses) for p in pairs]
