"""Legs from the laser's silhouettes and the depth below the top."""

from __future__ import annotations

from tablemap.stages.legs.layout import is_standing
from tablemap.stages.legs.result import Leg, Legs, RejectedCluster
from tablemap.stages.legs.stage import find_legs

__all__ = ["Leg", "Legs", "RejectedCluster", "find_legs", "is_standing"]
