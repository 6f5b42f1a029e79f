"""Where the base was between the stops: KISS-ICP over the laser scans that moved."""

from tablemap.odometry.estimate import Odometry, estimate_odometry
from tablemap.odometry.lines import fit_windows
from tablemap.odometry.placing import OdometryMap, OdometryScan
from tablemap.odometry.sweep import points_in_base, sweep_motion
from tablemap.odometry.trajectory import Trajectory

__all__ = [
    "Odometry",
    "OdometryMap",
    "OdometryScan",
    "Trajectory",
    "estimate_odometry",
    "fit_windows",
    "points_in_base",
    "sweep_motion",
]
