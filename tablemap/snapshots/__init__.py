"""Where the robot stood still: depth, calibration and pose of each viewpoint."""

from __future__ import annotations

from tablemap.snapshots.directions import turned_left
from tablemap.snapshots.noise import axial_noise, depth_sigma
from tablemap.snapshots.stops import is_same_place
from tablemap.snapshots.taking import take_snapshots
from tablemap.snapshots.types import Camera, SetAside, Snapshot, Snapshots

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
