"""KISS-ICP over laser scans of the moving base."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from tablemap.config import OdometryConfig, SensorsConfig
from tablemap.errors import ProcessWarning
from tablemap.events import Record
from tablemap.geometry import Floats, Pose2
from tablemap.recording import Recording
from tablemap.stages.odometry.choosing import chosen_scans, is_jump
from tablemap.stages.odometry.constraint import constrained, held_share
from tablemap.stages.odometry.recorded import RecordedPoses, has_wheels
from tablemap.stages.odometry.result import OdometryMap, OdometryScan
from tablemap.stages.odometry.sweep import points_in_base, sweep_motion, sweep_window
from tablemap.stages.odometry.trajectory import Trajectory
from tablemap.words import counted

EVENT_POINTS = 360
"""Most points of a scan that is recorded for the review."""

EVENT_MAPS = 30
"""States of KISS-ICP's map that are recorded for the review, spread over the drive."""

_LEAST_POINTS = 30
# Metres of surface. In simulated rooms scans see 8 to 19 of them, and the motion between two stops
# errs by 8 mm and 0.1 degrees at most. Of 1.3 to 6.5 metres, seen by a laser that ends at 3.5 m, it
# erred by up to 105 mm and 2.2 degrees, and the wheels by 12 mm and 0.8 degrees.
_LEAST_LENGTH = 7.0


@dataclass(frozen=True, eq=False)
class PlacedScans:
    """The base's poses at the used scans, and the number of skipped scans.

    ``left_open`` (n, 2, 2), in the odometry's frame, projects onto the directions in which the
    prior was kept: those that the scan did not constrain, or all.
    """

    trajectory: Trajectory
    skipped: int
    left_open: Floats


def place_scans(
    recording: Recording,
    config: OdometryConfig,
    sensors: SensorsConfig,
    record: Record,
    warnings: list[ProcessWarning],
) -> PlacedScans | None:
    """Register the scans of the moving base, one after the other; None without a usable scan."""
    on_wheels = has_wheels(recording)
    recorded = RecordedPoses(recording.odom_from_bases if on_wheels else recording.fixed_from_bases)
    stamps_ns = recording.scan_stamps()
    priors = recorded.prepared(stamps_ns)
    due = chosen_scans(
        stamps_ns,
        priors.poses,
        priors.known,
        recording.fixed_from_bases(stamps_ns)[1],
        config=config,
        sensors=sensors,
        on_wheels=on_wheels,
    )
    threshold = config.threshold if on_wheels else config.threshold_without_wheels
    kiss = _make_kiss(config, sensors.laser_maximum_range_odometry, threshold)
    start: Pose2 | None = None
    last = last_prior = Pose2()
    last_delta = Pose2()
    last_ns = 0
    stamps: list[int] = []
    poses: list[Floats] = []
    left_open: list[Floats] = []
    kept_prior = 0
    sweep: tuple[int, int] | None = None
    between_maps_ns = (recording.end_ns - recording.start_ns) // EVENT_MAPS
    last_map_ns: int | None = None
    for scan in recording.scans(stamps_ns=due):
        prior = recorded.at(scan.stamp_ns)
        fixed = recording.fixed_from_base(scan.stamp_ns) if start is None else None
        if prior is None or (start is None and fixed is None):
            continue
        delta = Pose2()
        if stamps:
            delta = last_prior.inverse() @ prior
            if not on_wheels and _is_jump(delta, (scan.stamp_ns - last_ns) * 1e-9, sensors):
                delta = last_delta
        if sweep is None and (sweep := sweep_window(scan)) is not None:
            recorded.prepared(np.concatenate([due + offset for offset in sweep]))
        motion, _ = sweep_motion(scan, recorded.at)
        sweep_seconds = scan.time_increment * len(scan.ranges)
        if motion is not None and _is_jump(motion, sweep_seconds, sensors):
            motion = None
        base_from_laser = recording.base_from_laser(scan.stamp_ns)
        points, valid = points_in_base(
            scan,
            base_from_laser,
            maximum_range=sensors.laser_maximum_range_odometry,
            motion=motion,
        )
        frame = points[valid]
        if len(frame) < _LEAST_POINTS:
            continue
        constraint = constrained(frame[:, :2], base_from_laser[:2, 3], voxel=config.voxel_size)
        if on_wheels and constraint.length < _LEAST_LENGTH:
            continue
        if start is None:
            assert fixed is not None
            start = Pose2.projected(fixed)
        used_threshold = float(kiss.adaptive_threshold.get_threshold())
        moved = (last @ delta).inverse() @ _register(kiss, frame, last, delta)
        held = np.eye(2)
        if stamps:
            held = held_share(constraint.shares)
            moved = Pose2.from_array([*(held @ moved.translation), moved.yaw])
        correction = float(np.hypot(*moved.translation))
        if correction > config.maximum_correction:
            moved, held, kept_prior = Pose2(), np.zeros((2, 2)), kept_prior + 1
        pose = last @ delta @ moved
        kiss.last_pose = pose.lifted()
        last_delta = last.inverse() @ pose
        last, last_prior, last_ns = pose, prior, scan.stamp_ns
        odom_from_base = start @ pose
        stamps.append(scan.stamp_ns)
        poses.append(odom_from_base.as_array())
        turn = odom_from_base.rotation
        left_open.append(turn @ (np.eye(2) - held) @ turn.T)
        thinned = frame[:: -(-len(frame) // EVENT_POINTS), :2]
        placed = odom_from_base.apply(thinned)
        record(OdometryScan(scan.stamp_ns, odom_from_base, placed, used_threshold, correction))
        if last_map_ns is None or scan.stamp_ns - last_map_ns >= between_maps_ns:
            last_map_ns = scan.stamp_ns
            record(OdometryMap(scan.stamp_ns, start.apply(kiss.local_map.point_cloud()[:, :2])))
    if kept_prior:
        message = (
            f"KISS-ICP moved {kept_prior} of {counted(len(stamps), 'scan')} too far from their "
            "prediction; their prediction was kept"
        )
        warnings.append(ProcessWarning("odometry.kept_prior", "odometry", message))
    if start is None:
        return None
    if last_map_ns != stamps[-1]:
        record(OdometryMap(stamps[-1], start.apply(kiss.local_map.point_cloud()[:, :2])))
    trajectory = Trajectory(np.array(stamps, dtype=np.int64), np.array(poses))
    return PlacedScans(trajectory, len(stamps_ns) - len(stamps), np.array(left_open))


def _make_kiss(config: OdometryConfig, maximum_range: float, threshold: float) -> Any:
    # The import takes a second, so it is here. All sections are given: KISS-ICP would otherwise
    # read missing ones from the environment.
    from kiss_icp.config import KISSConfig
    from kiss_icp.config.config import (
        AdaptiveThresholdConfig,
        DataConfig,
        MappingConfig,
        RegistrationConfig,
    )
    from kiss_icp.kiss_icp import KissICP

    return KissICP(
        KISSConfig(
            out_dir="",
            data=DataConfig(max_range=maximum_range, min_range=0.0, deskew=False),
            registration=RegistrationConfig(
                max_num_iterations=100, convergence_criterion=1e-5, max_num_threads=1
            ),
            mapping=MappingConfig(voxel_size=config.voxel_size, max_points_per_voxel=20),
            adaptive_threshold=AdaptiveThresholdConfig(
                fixed_threshold=threshold, initial_threshold=threshold, min_motion_th=0.01
            ),
        )
    )


def _register(kiss: Any, frame: Floats, last: Pose2, delta: Pose2) -> Pose2:
    kiss.last_pose = last.lifted()
    kiss.last_delta = delta.lifted()
    kiss.register_frame(frame, np.zeros(len(frame)))
    return Pose2.projected(np.asarray(kiss.last_pose))


def _is_jump(delta: Pose2, seconds: float, sensors: SensorsConfig) -> bool:
    return is_jump(math.hypot(delta.x, delta.y), abs(delta.yaw), seconds, sensors)
