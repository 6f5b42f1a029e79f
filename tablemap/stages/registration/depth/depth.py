"""Registration without a laser: pairs of depth views, aligned by their upright surfaces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from tablemap.config import RegistrationConfig, SensorsConfig
from tablemap.errors import EstimationError
from tablemap.events import Record
from tablemap.geometry import Floats, Pose2
from tablemap.stages.odometry import Odometry
from tablemap.stages.outline import Outline
from tablemap.stages.registration.depth.check import check_views, statistics_of
from tablemap.stages.registration.depth.cloud import balanced_cloud, upright_cloud
from tablemap.stages.registration.depth.edges import lay_edges, table_edges
from tablemap.stages.registration.depth.heading import check_headings
from tablemap.stages.registration.depth.held import (
    PAIR_ROBUST,
    PAIR_SIGMA,
    contradicted,
    held_edges,
    odometry_report,
)
from tablemap.stages.registration.depth.search import search_failed, searched
from tablemap.stages.registration.depth.sight import make_sight
from tablemap.stages.registration.graph import (
    GraphAnchor,
    GraphEdge,
    GraphSolution,
    relative_covariance,
    solve_graph,
)
from tablemap.stages.registration.pairs import Cloud, align_depth_pair, thinned
from tablemap.stages.registration.polish import Polished
from tablemap.stages.registration.result import Pair, PairKind, StopCheck, StopScan
from tablemap.stages.registration.solution import (
    Solution,
    judge_pair,
    localisation_anchors,
    odometry_edges,
    pair_edges,
    pose_list,
)
from tablemap.stages.snapshots import Snapshot

PAIR_GATES = (0.2, 0.12, 0.07)
"""Gates, metres: points of two depth views correspond within a gate; ICP uses them in turn."""

_ROUNDS = 2  # how often the pairs are aligned and the graph is solved
_GAPS = (1, 2, 3, 5, 8)
_MOST_LOOPS = 6  # pairs of a view beside those of `_GAPS`: more pairs add nothing new
_OVERLAP_REACH = 0.2
_OVERLAP_POINTS = 150
_LEAST_FITNESS = 0.1  # a smaller share of a view's points finds partners anywhere, by chance
_SAME_PLACE, _SAME_TURN = 0.03, np.radians(1.0)
# A tilt t of the camera lifts the floor at distance d by d t. It shifts a point at distance x, on a
# plane that lies c below the camera, by (c + x x / c) t.
_SIDEWAYS = 1.5
_FLOOR_STRIDE = 6
_FLOOR_BAND = 0.03  # metres
_LEAST_FLOOR = 100


def register_depth(
    snapshots: tuple[Snapshot, ...],
    find_outline: Callable[[], Outline],
    odometry: Odometry,
    initial: Floats,
    *,
    config: RegistrationConfig,
    sensors: SensorsConfig,
    record: Record,
) -> Solution:
    """Register the views by their depth from ``initial`` (n, 3), and check the result.

    Pairs of upright surfaces join odometry and localisation in a graph. Then the table's own edges
    are laid onto each other in all views at once, with the depth's scale as a nuisance. None of
    this shows a wrong focal length. It shifts each point by the same share of its distance, and
    makes the systematic part.
    """
    uprights = {
        i: cloud
        for i, snapshot in enumerate(snapshots)
        if (cloud := upright_cloud(snapshot, maximum_range=config.depth_range)) is not None
    }
    clouds = {i: balanced_cloud(cloud, config.depth_points) for i, cloud in uprights.items()}
    # With many pairs of each view, half the points are enough.
    most = config.depth_points // (2 if len(clouds) > config.partners else 1)
    sources = {i: thinned(cloud, most) for i, cloud in clouds.items()}
    edges = odometry_edges(snapshots, odometry)
    anchors = localisation_anchors(snapshots, sensors)
    graph = solve_graph(initial, edges, anchors)
    pairs: list[Pair] = []
    aligned: dict[tuple[int, int], Pair] = {}
    for round_ in range(_ROUNDS):
        located = pose_list(graph.poses)
        for source, target, kind in choose_views(clouds, located, config):
            start = located[target].inverse() @ located[source]
            before = aligned.get((source, target))
            if before is not None and _settled(before.target_from_source, start):
                continue
            aligned[source, target] = align_depth_pair(
                source,
                target,
                kind,
                (sources[source], clouds[target]),
                start,
                # The graph has brought the pairs close: the second round needs no wide gate.
                gates=PAIR_GATES[min(round_, len(PAIR_GATES) - 1) :],
                record=record,
            )
        graph, pairs = _solve(graph, list(aligned.values()), edges, anchors)
    try:
        outline = find_outline()
    except EstimationError:
        outline = None
    table = table_edges(snapshots, outline)
    held = held_edges(graph, pairs, edges)
    laid = lay_edges(table, graph.poses, held, config, sensors)
    checked = check_views(outline, table, laid.polished.poses)
    laid, checked, found = search_failed(outline, table, held, laid, checked, config, sensors)
    pairs = contradicted(pairs, laid.kept[len(edges) :])
    polished = laid.polished
    poses, covariance = polished.poses, polished.covariance
    moved = odometry_report(edges, graph, poses)
    sights = {
        i: make_sight(snapshots[i], cloud, maximum_range=config.depth_range)
        for i, cloud in uprights.items()
    }
    # A localisation in place of odometry errs independently at every view.
    independent = odometry.source != "localisation"
    ties = [(pair.source, pair.target) for pair in moved if pair.used and independent]
    checks, doubts = check_headings(checked, sights, table, poses, ties)
    informed = any(pair.used for pair in pairs) or polished.matched.any()
    return Solution(
        poses=poses,
        covariance=relative_covariance(poses, covariance + _tilt_covariance(snapshots)),
        pairs=(*pairs, *moved),
        checks=_with_context(checks, pairs, polished, graph),
        source="depth" if informed else "localisation",
        systematic=sensors.calibrated_focal_length_sigma * _reach(table, poses),
        warnings=(*searched(found, snapshots), *doubts),
    )


def _settled(found: Pose2, start: Pose2) -> bool:
    """Tell whether aligning again from ``start`` would find what was found."""
    return found.is_near(start, metres=_SAME_PLACE, radians=_SAME_TURN)


def _with_context(
    checks: Sequence[StopCheck], pairs: Sequence[Pair], polished: Polished, graph: GraphSolution
) -> tuple[StopCheck, ...]:
    """Add to the checks the number of pairs, and how far the edges moved each view."""
    used = [pair for pair in pairs if pair.used]
    steps = (polished.poses - graph.poses)[:, :2]
    moved = np.linalg.norm(steps - steps.mean(axis=0), axis=1)
    return tuple(
        replace(
            check,
            statistics=replace(
                statistics_of(check),
                pairs=sum(check.index in (p.source, p.target) for p in used),
                edge_rms=polished.rms,
                moved=float(moved[check.index]),
            ),
        )
        for check in checks
    )


def _reach(outlines: Sequence[StopScan | None], poses: Floats) -> float:
    """Return the distance between the views and the table's edges, metres."""
    seen = [outline.directions for outline in outlines if outline is not None]
    if seen:
        return float(np.median(np.linalg.norm(np.concatenate(seen), axis=1)))
    centred = poses[:, :2] - poses[:, :2].mean(axis=0)
    return float(np.sqrt(np.mean(np.sum(centred**2, axis=1))))


def _tilt_covariance(snapshots: Sequence[Snapshot]) -> Floats:
    """Return the covariance (3n, 3n) from each view's own tilt, as the floors show it.

    A camera held by hand tilts differently in every view. A tilt lifts the floor, and moves the
    points of the top sideways by about `_SIDEWAYS` times as much, all points of a view alike.
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


def choose_views(
    clouds: dict[int, Cloud], located: Sequence[Pose2], config: RegistrationConfig
) -> list[tuple[int, int, PairKind]]:
    """Return (source, target, kind) of views that follow each other or see the same surfaces."""
    trees = {i: cKDTree(located[i].apply(cloud.points)) for i, cloud in clouds.items()}
    chosen: dict[tuple[int, int], PairKind] = {}
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
        for _, j in sorted(shares, reverse=True)[:_MOST_LOOPS]:
            chosen[i, j] = "loop"
    return [(s, t, kind) for (s, t), kind in sorted(chosen.items())]


def _solve(
    graph: GraphSolution,
    pairs: Sequence[Pair],
    edges: Sequence[GraphEdge],
    anchors: Sequence[GraphAnchor],
) -> tuple[GraphSolution, list[Pair]]:
    good = [pair for pair in pairs if pair.used and pair.fitness >= _LEAST_FITNESS]
    held = [*edges, *pair_edges(good, sigma=PAIR_SIGMA, robust=PAIR_ROBUST)]
    solved = solve_graph(graph.poses, held, anchors)
    weights = dict(zip(map(id, good), solved.edge_weights[len(edges) :], strict=True))
    return solved, [judge_pair(p, weights.get(id(p)), solved.poses) for p in pairs]
