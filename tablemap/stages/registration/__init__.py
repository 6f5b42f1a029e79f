"""The stops' poses: pairwise Open3D ICP, degeneracy, a pose graph and a joint polish, in SE(2)."""

from __future__ import annotations

from tablemap.stages.registration.result import (
    DepthPairStatistics,
    DepthStatistics,
    LaserStatistics,
    Pair,
    PairIteration,
    PairStarted,
    Registration,
    StopCheck,
    StopScan,
)
from tablemap.stages.registration.stage import register

__all__ = [
    "DepthPairStatistics",
    "DepthStatistics",
    "LaserStatistics",
    "Pair",
    "PairIteration",
    "PairStarted",
    "Registration",
    "StopCheck",
    "StopScan",
    "register",
]
