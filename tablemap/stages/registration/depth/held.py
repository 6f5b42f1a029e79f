"""Which edges of odometry and which depth pairs still count after the graph is solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tablemap.geometry import Bools, Floats, Pose2
from tablemap.stages.registration.graph import GraphEdge, GraphSolution, edge_weights
from tablemap.stages.registration.result import Pair
from tablemap.stages.registration.solution import floored, odometry_pairs

PAIR_ROBUST = 9.0
PAIR_SIGMA = (0.01, 0.01, 0.005)
"""The least sigma of a depth pair (metres, metres, radians), however well its points fit."""
_LET_GO = 16.0  # squared sigmas in three freedoms: one right pair in a thousand
_INDEPENDENT_PAIRS = 4


def contradicted(pairs: Sequence[Pair], kept: Bools) -> list[Pair]:
    """Mark those used pairs as dropped that the table's edges contradict (not ``kept``)."""
    used = [pair for pair in pairs if pair.used]
    gone = {id(pair) for pair, keep in zip(used, kept, strict=True) if not keep}
    reason = "contradicts the table's edges in all views"
    return [replace(p, used=False, reason=reason) if id(p) in gone else p for p in pairs]


def _unscaled(graph: GraphSolution, edges: Sequence[GraphEdge]) -> list[GraphEdge]:
    """Return the odometry's edges with the common yaw scale taken out."""
    freed = []
    for edge in edges:
        step = edge.target_from_source
        scale = graph.yaw_scale if edge.turns_with_scale else 0.0
        turned = Pose2(step.x, step.y, step.yaw * (1 + scale))
        freed.append(replace(edge, target_from_source=turned))
    return freed


def odometry_report(edges: Sequence[GraphEdge], graph: GraphSolution, poses: Floats) -> list[Pair]:
    """Report the odometry's edges; an edge is used if the graph kept it and ``poses`` agree."""
    if not edges:
        return []
    at_last = edge_weights(poses, _unscaled(graph, edges))
    return odometry_pairs(edges, np.minimum(graph.edge_weights[: len(edges)], at_last))


def held_edges(
    graph: GraphSolution, pairs: Sequence[Pair], edges: Sequence[GraphEdge]
) -> list[GraphEdge]:
    """Return the graph's edges by the weight it left them, the odometry without its yaw scale."""
    held = [
        replace(edge, information=weight * edge.information)
        for edge, weight in zip(
            _unscaled(graph, edges), graph.edge_weights[: len(edges)], strict=True
        )
    ]
    used = [pair for pair in pairs if pair.used]
    views = len({index for pair in used for index in (pair.source, pair.target)})
    # A view makes the same error in all its pairs: more than a few pairs add little.
    share = min(1.0, _INDEPENDENT_PAIRS * max(views, 1) / max(2 * len(used), 1))
    held += [
        GraphEdge(
            p.source,
            p.target,
            p.target_from_source,
            share * floored(p.information, PAIR_SIGMA),
            robust=share * _LET_GO,
        )
        for p in used
    ]
    return held
