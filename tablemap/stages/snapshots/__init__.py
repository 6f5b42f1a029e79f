"""Snapshots from the robot's stops: depth, calibration and pose of each viewpoint."""

from __future__ import annotations

from tablemap.stages.snapshots.directions import turned_left
from tablemap.stages.snapshots.noise import DepthNoise, depth_noise
from tablemap.stages.snapshots.result import Camera, SetAside, Snapshot, Snapshots, Viewpoint
from tablemap.stages.snapshots.stage import find_viewpoints, take_snapshots
from tablemap.stages.snapshots.stops import is_same_place

__all__ = [
    "Camera",
    "DepthNoise",
    "SetAside",
    "Snapshot",
    "Snapshots",
    "Viewpoint",
    "depth_noise",
    "find_viewpoints",
    "is_same_place",
    "take_snapshots",
    "turned_left",
]
