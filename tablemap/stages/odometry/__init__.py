"""The motion of the base between the stops: KISS-ICP over laser scans of the moving base."""

from tablemap.stages.odometry.lines import fit_windows
from tablemap.stages.odometry.result import Odometry, OdometryMap, OdometryScan
from tablemap.stages.odometry.stage import estimate_odometry
from tablemap.stages.odometry.sweep import (
    as_turning,
    combine_beams,
    points_in_base,
    sweep_motion,
    thinned,
)
from tablemap.stages.odometry.trajectory import Trajectory

__all__ = [
    "Odometry",
    "OdometryMap",
    "OdometryScan",
    "Trajectory",
    "as_turning",
    "combine_beams",
    "estimate_odometry",
    "fit_windows",
    "points_in_base",
    "sweep_motion",
    "thinned",
]
