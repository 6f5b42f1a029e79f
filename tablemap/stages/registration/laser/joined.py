"""Depth for stops that the laser leaves open: upright surfaces tie their views to others."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from tablemap.config import RegistrationConfig
from tablemap.events import Record
from tablemap.geometry import Floats
from tablemap.stages.registration.depth.cloud import balanced_cloud, upright_cloud
from tablemap.stages.registration.depth.depth import PAIR_GATES, choose_views
from tablemap.stages.registration.depth.held import PAIR_SIGMA
from tablemap.stages.registration.pairs import align_depth_pair
from tablemap.stages.registration.result import DepthPairStatistics, Pair, StopCheck, StopScan
from tablemap.stages.registration.solution import pose_list
from tablemap.stages.snapshots import Snapshot
from tablemap.words import counted

_LEAST_PARTNERS = 2


def open_stops(stops: Sequence[StopScan | None], covariance: Floats) -> list[int]:
    """Return the stops without a scan, and those that are loose by the ``covariance`` (3n, 3n).

    A stop is loose if a depth pair would bind it better, as in a corridor, or in a hall with a wall
    on one side.
    """
    loose = []
    for i, stop in enumerate(stops):
        block = covariance[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        place = float(np.sqrt(max(np.linalg.eigvalsh(block[:2, :2])[-1], 0.0)))
        heading = float(np.sqrt(max(block[2, 2], 0.0)))
        if stop is None or place > PAIR_SIGMA[0] or heading > PAIR_SIGMA[2]:
            loose.append(i)
    return loose


def depth_pairs(
    snapshots: Sequence[Snapshot],
    poses: Floats,
    wanted: Collection[int],
    *,
    config: RegistrationConfig,
    record: Record,
) -> list[Pair]:
    """Align the views of the ``wanted`` stops with all overlapping views, from ``poses`` (n, 3)."""
    located = pose_list(poses)
    clouds = {
        i: balanced_cloud(cloud, config.depth_points)
        for i, snapshot in enumerate(snapshots)
        if (cloud := upright_cloud(snapshot, maximum_range=config.depth_range)) is not None
    }
    return [
        align_depth_pair(
            source,
            target,
            kind,
            (clouds[source], clouds[target]),
            located[target].inverse() @ located[source],
            gates=PAIR_GATES,
            record=record,
        )
        for source, target, kind in choose_views(clouds, located, config)
        if source in wanted or target in wanted
    ]


def checked_by_depth(check: StopCheck, judged: Sequence[Pair]) -> StopCheck:
    """Pass a stop without a scan if the graph kept its depth pairs with two other views."""
    mine = [pair for pair in judged if check.index in (pair.source, pair.target)]
    kept = [pair for pair in mine if pair.used]
    statistics = DepthPairStatistics(depth_pairs=len(mine), depth_pairs_used=len(kept))
    if len(kept) >= _LEAST_PARTNERS:
        return StopCheck(check.index, True, statistics, ())
    reason = (
        f"its depth agrees with {counted(len(kept), 'other view')}, {_LEAST_PARTNERS} are needed"
    )
    return replace(check, statistics=statistics, reasons=(*check.reasons, reason))
