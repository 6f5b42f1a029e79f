"""The common result of registration by laser and by depth, and the parts both build it from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tablemap.config import SensorsConfig
from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats, Pose2
from tablemap.stages.odometry import Odometry
from tablemap.stages.registration.graph import GraphAnchor, GraphEdge, edge_error
from tablemap.stages.registration.result import Pair, PoseSource, StopCheck
from tablemap.stages.snapshots import Snapshot

_ODOMETRY_ROBUST = 16.0
_ANCHOR_ROBUST = 4.0
_USED_WEIGHT = 0.1


@dataclass(frozen=True, eq=False)
class Solution:
    """``poses`` (n, 3) and their relative ``covariance`` (3n, 3n), not yet placed in the map.

    ``sweep`` is what `polish` found of scans that do not say how long they took.
    """

    poses: Floats
    covariance: Floats
    pairs: tuple[Pair, ...]
    checks: tuple[StopCheck, ...]
    source: PoseSource
    systematic: float
    warnings: tuple[ProcessWarning, ...]
    sweep: tuple[float, float] | None = None


def odometry_edges(snapshots: Sequence[Snapshot], odometry: Odometry) -> list[GraphEdge]:
    """Tie each snapshot to the one before by the odometry; a longer way makes a looser tie."""
    edges = []
    trajectory = odometry.trajectory
    for i in range(1, len(snapshots)):
        before, now = snapshots[i - 1].stamp_ns, snapshots[i].stamp_ns
        step = trajectory.at(before).inverse() @ trajectory.at(now)
        information = np.linalg.inv(odometry.covariance_between(before, now))
        edges.append(
            GraphEdge(
                source=i,
                target=i - 1,
                target_from_source=step,
                information=np.asarray(information, dtype=np.float64),
                robust=_ODOMETRY_ROBUST,
                turns_with_scale=odometry.source == "wheels",
            )
        )
    return edges


def localisation_anchors(
    snapshots: Sequence[Snapshot], sensors: SensorsConfig
) -> list[GraphAnchor]:
    """Bind each snapshot loosely to its localised pose; a pose that has jumped loses its weight.

    A pose counts less if its recorded covariance is larger than the assumed one.
    """
    heading = np.radians(sensors.localisation_sigma_deg)
    believed = np.array([sensors.localisation_sigma, sensors.localisation_sigma, heading])

    def information(said: Floats | None) -> Floats:
        sigma = believed if said is None else np.maximum(believed, said)
        return np.diag(1.0 / sigma**2)

    return [
        GraphAnchor(
            i, snapshot.map_from_base, information(snapshot.localised_sigma), _ANCHOR_ROBUST
        )
        for i, snapshot in enumerate(snapshots)
    ]


def floored(information: Floats, sigma: tuple[float, float, float]) -> Floats:
    """Add to a pair's covariance the errors that every pair has (a moved chair, the texture)."""
    values, vectors = np.linalg.eigh(information)
    weak = np.diag(np.square(sigma))
    positive = np.maximum(values, 1e-6)
    covariance = (vectors / positive) @ vectors.T + weak
    return np.asarray(np.linalg.inv(covariance), dtype=np.float64)


def pair_edges(
    pairs: Sequence[Pair], *, sigma: tuple[float, float, float], robust: float
) -> list[GraphEdge]:
    """Return aligned pairs as edges of the graph, none with a smaller sigma than ``sigma``."""
    return [
        GraphEdge(
            pair.source,
            pair.target,
            pair.target_from_source,
            floored(pair.information, sigma),
            robust=robust,
        )
        for pair in pairs
    ]


def judge_pair(pair: Pair, weight: float | None, poses: Floats) -> Pair:
    """Mark a pair as dropped, with the reason, if the graph dropped it or never had it.

    ``weight`` is the robust weight of the pair's edge, None if the pair was not in the graph.
    """
    if not pair.used:
        return pair
    if weight is None:
        return replace(
            pair, used=False, reason=f"only {100 * pair.fitness:.0f} % of its points overlap"
        )
    if weight > _USED_WEIGHT:
        return pair
    error = edge_error(
        poses, GraphEdge(pair.source, pair.target, pair.target_from_source, pair.information)
    )
    reason = (
        f"disagrees with the others by {1e3 * np.hypot(error[0], error[1]):.0f} mm "
        f"and {np.degrees(abs(error[2])):.1f} degrees"
    )
    return replace(pair, used=False, reason=reason)


def odometry_pairs(edges: Sequence[GraphEdge], weights: Floats) -> list[Pair]:
    """Report the odometry's edges among the pairs; edges that the graph dropped are not used."""
    pairs = []
    for edge, weight in zip(edges, weights, strict=True):
        used = bool(weight > _USED_WEIGHT)
        reason = None if used else "disagrees with the other constraints"
        pairs.append(
            Pair(
                edge.source,
                edge.target,
                "odometry",
                edge.target_from_source,
                edge.information,
                1.0,
                0.0,
                0,
                used,
                reason,
            )
        )
    return pairs


def pose_list(poses: Floats) -> list[Pose2]:
    """Return the rows of (n, 3) as poses."""
    return [Pose2.from_array(pose) for pose in poses]
