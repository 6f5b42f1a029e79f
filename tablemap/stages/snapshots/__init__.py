"""Snapshots from the robot's stops: depth, calibration and pose of each viewpoint."""

from __future__ import annotations

from tablemap.stages.snapshots.directions import turned_left
from tablemap.stages.snapshots.noise import axial_noise, depth_sigma
from tablemap.stages.snapshots.result import Camera, SetAside, Snapshot, Snapshots
from tablemap.stages.snapshots.stage import take_snapshots
from tablemap.stages.snapshots.stops import is_same_place

__all__ = [
    "Camera",
    "SetAside",
    "Snapshot",
    "Snapshots",
    "axial_noise",
    "depth_sigma",
    "is_same_place",
    "take_snapshots",
    "turned_left",
]
