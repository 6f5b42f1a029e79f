"""Legs from the laser's silhouettes and the depth below the top."""

from __future__ import annotations

from tablemap.legs.find import find_legs
from tablemap.legs.layout import is_standing
from tablemap.legs.types import Leg, Legs, RejectedCluster

__all__ = ["Leg", "Legs", "RejectedCluster", "find_legs", "is_standing"]
