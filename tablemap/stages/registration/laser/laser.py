"""Registration by the laser: pairs, graph, joint polish, check, and a search where it fails.

Stops that the laser leaves open are tied to the others by depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tablemap.config import RegistrationConfig, SensorsConfig
from tablemap.errors import ProcessWarning
from tablemap.events import Record
from tablemap.geometry import Floats, Pose2
from tablemap.stages.odometry import Odometry
from tablemap.stages.registration.correlative import likelihood_at, search
from tablemap.stages.registration.depth.held import PAIR_ROBUST, PAIR_SIGMA
from tablemap.stages.registration.graph import (
    GraphAnchor,
    GraphEdge,
    relative_covariance,
    solve_graph,
)
from tablemap.stages.registration.laser.check import check_stops, suspicious
from tablemap.stages.registration.laser.joined import checked_by_depth, depth_pairs, open_stops
from tablemap.stages.registration.pairs import Cloud, align_laser_pair, laser_clouds
from tablemap.stages.registration.polish import RangePrior, polish
from tablemap.stages.registration.result import Pair, StopCheck, StopScan
from tablemap.stages.registration.solution import (
    Solution,
    judge_pair,
    localisation_anchors,
    odometry_edges,
    odometry_pairs,
    pair_edges,
    pose_list,
)
from tablemap.stages.snapshots import Snapshot

_CORRELATED_BEAMS = 8.0  # neighbouring beams on one surface err together: they count as one
_PAIR_ROBUST = 25.0
_LEAST_PAIR_SIGMA = (0.003, 0.003, 0.002)  # metres, metres, radians: however well a pair fits
_SEARCH_ROUNDS = 3
_BETTER = 0.05  # of score: less is no reason to move a stop
_LEAST_FOUND_SCORE = 0.55
_MOVED, _MOVED_TURN = 0.05, np.radians(2.0)
_TABLE_REACH = 2.5  # metres: the usual distance of the table from the laser


@dataclass(frozen=True, eq=False)
class _Attempt:
    poses: Floats
    covariance: Floats
    pairs: tuple[Pair, ...]
    checks: tuple[StopCheck, ...]
    sweep: tuple[float, float] | None


def register_laser(
    stops: tuple[StopScan | None, ...],
    snapshots: tuple[Snapshot, ...],
    odometry: Odometry,
    initial: Floats,
    *,
    config: RegistrationConfig,
    sensors: SensorsConfig,
    record: Record,
) -> Solution:
    """Register the stops by their scans from ``initial`` (n, 3); search for stops that failed.

    Depth pairs join at stops without a scan, and at stops that laser and odometry bind more
    loosely than a pair of depth views would.
    """
    edges = odometry_edges(snapshots, odometry)
    anchors = localisation_anchors(snapshots, sensors)
    clouds = {i: laser_clouds(stop) for i, stop in enumerate(stops) if stop is not None}
    aligned: dict[tuple[int, int], Pair] = {}
    attempt = _attempt(stops, clouds, initial, edges, [], anchors, aligned, config, sensors, record)
    warnings: list[ProcessWarning] = []
    tried: set[int] = set()
    for _ in range(_SEARCH_ROUNDS):
        moved = _search_suspicious(stops, attempt, config, tried)
        if not moved:
            break
        start = attempt.poses.copy()
        for i, pose in moved.items():
            start[i] = pose.as_array()
            message = f"snapshot {i} was found by searching {_from_to(attempt.poses[i], pose)} away"
            warnings.append(
                ProcessWarning(
                    "registration.searched", "registration", message, snapshots[i].stamp_ns
                )
            )
        aligned = {k: v for k, v in aligned.items() if not set(k) & set(moved)}
        attempt = _attempt(
            stops, clouds, start, edges, [], anchors, aligned, config, sensors, record
        )
    loose = open_stops(stops, attempt.covariance)
    if loose:
        depth = depth_pairs(snapshots, attempt.poses, loose, config=config, record=record)
        start = attempt.poses
        attempt = _attempt(
            stops, clouds, start, edges, depth, anchors, aligned, config, sensors, record
        )
    spread = float(np.median([_reach(stop) for stop in stops if stop is not None]))
    return Solution(
        poses=attempt.poses,
        covariance=attempt.covariance,
        pairs=attempt.pairs,
        checks=attempt.checks,
        source="laser",
        systematic=float(
            np.hypot(sensors.laser_range_scale_sigma_wide * spread, sensors.laser_mounting_sigma)
        ),
        warnings=tuple(warnings),
        sweep=attempt.sweep,
    )


def _attempt(
    stops: tuple[StopScan | None, ...],
    clouds: dict[int, tuple[Cloud, Cloud]],
    start: Floats,
    edges: Sequence[GraphEdge],
    depth: Sequence[Pair],
    anchors: Sequence[GraphAnchor],
    aligned: dict[tuple[int, int], Pair],
    config: RegistrationConfig,
    sensors: SensorsConfig,
    record: Record,
) -> _Attempt:
    """Align the pairs that are not yet in ``aligned``, solve the graph, polish and check.

    ``edges`` are the odometry's, and ``depth`` are pairs of depth views that join the graph.
    """
    located = pose_list(start)
    chosen = choose_pairs(stops, start, config)
    for source, target in chosen:
        if (source, target) not in aligned:
            aligned[source, target] = align_laser_pair(
                source,
                target,
                (clouds[source][0], clouds[target][1]),
                located[target].inverse() @ located[source],
                gates=config.gates,
                kernel=config.kernel,
                correlation=_CORRELATED_BEAMS,
                record=record,
            )
    pairs = [aligned[key] for key in chosen]
    good = [pair for pair in pairs if pair.used and pair.fitness >= config.minimum_overlap / 2]
    scanned = pair_edges(good, sigma=_LEAST_PAIR_SIGMA, robust=_PAIR_ROBUST)
    views = [pair for pair in depth if pair.used]
    holding = [*edges, *pair_edges(views, sigma=PAIR_SIGMA, robust=PAIR_ROBUST)]
    graph = solve_graph(start, [*holding, *scanned], anchors)
    weights = graph.edge_weights
    kept = dict(zip(map(id, [*views, *good]), weights[len(edges) :], strict=True))
    judged = tuple(judge_pair(pair, kept.get(id(pair)), graph.poses) for pair in pairs)
    joined = tuple(judge_pair(pair, kept.get(id(pair)), graph.poses) for pair in depth)
    held = [
        replace(edge, information=edge.information * weight)
        for edge, weight in zip(holding, weights[: len(holding)], strict=True)
    ]
    used = [(pair.source, pair.target) for pair in judged if pair.used]
    polished = polish(
        stops,
        graph.poses,
        used,
        held,
        gates=config.gates,
        kernel=config.kernel,
        correlation=_CORRELATED_BEAMS,
        ranges=RangePrior(sensors.laser_range_bias_sigma, sensors.laser_range_bend_sigma),
    )
    checks = tuple(
        checked_by_depth(check, joined) if depth and stops[check.index] is None else check
        for check in check_stops(stops, polished.poses, chosen)
    )
    return _Attempt(
        poses=polished.poses,
        covariance=relative_covariance(polished.poses, polished.covariance),
        pairs=(*judged, *joined, *odometry_pairs(edges, weights[: len(edges)])),
        checks=checks,
        sweep=polished.sweep,
    )


def choose_pairs(
    stops: Sequence[StopScan | None], poses: Floats, config: RegistrationConfig
) -> list[tuple[int, int]]:
    """Return (source, target) of each stop with its predecessor and its nearest neighbours."""
    present = [i for i, stop in enumerate(stops) if stop is not None]
    chosen = set(zip(present[1:], present[:-1], strict=True))
    for i in present:
        near = sorted(
            (j for j in present if j != i),
            key=lambda j: (float(np.linalg.norm(poses[i, :2] - poses[j, :2])), j),
        )
        chosen |= {(max(i, j), min(i, j)) for j in near[: config.scan_partners]}
    return sorted(chosen)


def _search_suspicious(
    stops: tuple[StopScan | None, ...],
    attempt: _Attempt,
    config: RegistrationConfig,
    tried: set[int],
) -> dict[int, Pose2]:
    """Search a place for the suspicious stops among those that passed; return the new poses."""
    asked = {i: score for i, score in suspicious(attempt.checks).items() if i not in tried}
    if not asked:
        return {}
    scans = {i: stop for i, stop in enumerate(stops) if stop is not None}
    placed = {c.index: Pose2.from_array(attempt.poses[c.index]) for c in attempt.checks if c.passed}
    if not placed:
        first = max(asked, key=lambda i: (asked[i], -i))
        placed = {first: Pose2.from_array(attempt.poses[first])}
    moved: dict[int, Pose2] = {}
    # The worst stops come last: the stops found before then help to find them.
    for i in sorted(asked, key=lambda i: (-asked[i], i)):
        others = [pose.apply(scans[j].points) for j, pose in placed.items() if j != i]
        if not others:
            continue
        field = np.concatenate(others)
        start = Pose2.from_array(attempt.poses[i])
        now = likelihood_at(scans[i].points, field, start)
        if now + _BETTER >= 1.0:  # no place is so much better
            tried.add(i)
            continue
        found = search(
            scans[i].points,
            field,
            start,
            radius=config.search_radius,
            turn=float(np.radians(config.search_angle_deg)),
        )
        step = start.inverse() @ found.pose
        far = np.hypot(step.x, step.y) > _MOVED or abs(step.yaw) > _MOVED_TURN
        if far and found.score > max(now + _BETTER, _LEAST_FOUND_SCORE):
            moved[i] = found.pose
            placed[i] = found.pose
        else:
            tried.add(i)
    return moved


def _from_to(before: Floats, after: Pose2) -> str:
    step = Pose2.from_array(before).inverse() @ after
    place = float(np.hypot(step.x, step.y))
    return f"{place:.2f} m and {abs(np.degrees(step.yaw)):.0f} degrees"


def _reach(stop: StopScan) -> float:
    nearest = np.sort(np.linalg.norm(stop.points - stop.origin, axis=1))
    return float(min(nearest[len(nearest) // 2], _TABLE_REACH))
