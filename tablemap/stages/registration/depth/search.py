"""A search, by the table's edges, for the right place of views that contradict the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tablemap.config import RegistrationConfig, SensorsConfig
from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats, Pose2
from tablemap.stages.outline import Outline
from tablemap.stages.registration.correlative import likelihood_at, search
from tablemap.stages.registration.depth.check import Checked, check_views
from tablemap.stages.registration.depth.edges import Laid, lay_edges
from tablemap.stages.registration.graph import GraphEdge
from tablemap.stages.registration.result import StopScan
from tablemap.stages.snapshots import Snapshot

_ROUNDS = 2
_BETTER = 0.05  # of score: less is no reason to move a view
_LEAST_MARGIN = 0.1  # of score over any other place: a round table fits at any heading


def search_failed(
    outline: Outline | None,
    edges: Sequence[StopScan | None],
    held: Sequence[GraphEdge],
    laid: Laid,
    checked: Checked,
    config: RegistrationConfig,
    sensors: SensorsConfig,
) -> tuple[Laid, Checked, tuple[int, ...]]:
    """Search a better place for the views whose check failed, as long as this helps.

    Views that agree serve as the reference. Where a view moves, its ``held`` edges are dropped, as
    they led to the wrong place. Returns the best solution, its checks, and the indices of the views
    that were moved.
    """
    found: set[int] = set()
    for _ in range(_ROUNDS):
        poses = laid.polished.poses
        moved = _better_places(edges, poses, checked, config)
        if not moved:
            break
        start = poses.copy()
        for i, pose in moved.items():
            start[i] = pose.as_array()
        let_go = ~laid.kept | [bool({e.source, e.target} & set(moved)) for e in held]
        attempt = lay_edges(edges, start, held, config, sensors, let_go=let_go)
        again = check_views(outline, edges, attempt.polished.poses)
        if (again.passed, len(again.company)) <= (checked.passed, len(checked.company)):
            break
        laid, checked = attempt, again
        found |= set(moved)
    return laid, checked, tuple(sorted(i for i in found if checked.checks[i].passed))


def searched(found: Sequence[int], snapshots: Sequence[Snapshot]) -> tuple[ProcessWarning, ...]:
    """Say which views were found by searching."""
    return tuple(
        ProcessWarning(
            "registration.searched",
            "registration",
            f"snapshot {i} contradicted the other views and was found by searching",
            snapshots[i].stamp_ns,
        )
        for i in found
    )


def _better_places(
    edges: Sequence[StopScan | None],
    poses: Floats,
    checked: Checked,
    config: RegistrationConfig,
) -> dict[int, Pose2]:
    """Return better poses of views that failed; each view found helps to find the next."""
    placed = {
        i: Pose2.from_array(poses[i]).apply(edge.points)
        for i in checked.company
        if (edge := edges[i]) is not None
    }
    moved: dict[int, Pose2] = {}
    for i, edge in enumerate(edges):
        if edge is None or i in placed or not placed:
            continue
        field = np.concatenate(list(placed.values()))
        start = Pose2.from_array(poses[i])
        found = search(
            edge.points,
            field,
            start,
            radius=config.search_radius,
            turn=float(np.radians(config.search_angle_deg)),
        )
        better = found.score > likelihood_at(edge.points, field, start) + _BETTER
        if better and found.margin > _LEAST_MARGIN:
            moved[i] = found.pose
            placed[i] = found.pose.apply(edge.points)
    return moved
