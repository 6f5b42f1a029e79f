"""The stops' poses: pairwise Open3D ICP, degeneracy, a pose graph and a joint polish, in SE(2)."""

from __future__ import annotations

from tablemap.registration.register import register
from tablemap.registration.results import (
    Pair,
    PairIteration,
    PairStarted,
    Registration,
    StopCheck,
    StopScan,
)

__all__ = [
    "Pair",
    "PairIteration",
    "PairStarted",
    "Registration",
    "StopCheck",
    "StopScan",
    "register",
]
