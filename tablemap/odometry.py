"""Where the base was between the stops: KISS-ICP over the laser scans that moved."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablemap.config import OdometryConfig
from tablemap.errors import EstimationError, ProcessWarning
from tablemap.geometry import Floats, Pose2, transform
from tablemap.record import Record
from tablemap.recording import Recording
from tablemap.recording.messages import LaserScan
from tablemap.snapshots import Snapshot


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Base poses over time: ``stamps_ns`` (n,) int64 ascending, ``poses`` (n, 3) x, y, yaw."""

    stamps_ns: NDArray[np.int64]
    poses: Floats

    def at(self, stamp_ns: int) -> Pose2:
        """Interpolate; before the first and after the last stamp the end pose holds."""
        i = int(
            np.clip(np.searchsorted(self.stamps_ns, stamp_ns), 1, max(len(self.stamps_ns) - 1, 1))
        )
        if len(self.stamps_ns) == 1:
            return Pose2.from_array(self.poses[0])
        span = int(self.stamps_ns[i] - self.stamps_ns[i - 1])
        fraction = float(np.clip((stamp_ns - int(self.stamps_ns[i - 1])) / max(span, 1), 0.0, 1.0))
        first, second = Pose2.from_array(self.poses[i - 1]), Pose2.from_array(self.poses[i])
        step = first.inverse() @ second
        place = (1 - fraction) * first.translation + fraction * second.translation
        return Pose2(
            float(place[0]), float(place[1]), (first @ Pose2(0, 0, fraction * step.yaw)).yaw
        )


@dataclass(frozen=True, eq=False)
class Odometry:
    """Motion of the base in a frame of its own (its first pose is the localised one).

    ``source`` is ``laser``, ``wheels`` or ``localisation``, whichever it had to rest on;
    ``covariance_per_metre`` (3, 3) how its error grows. ``localised`` and ``wheels`` are the
    recorded trajectories at the same stamps (``wheels`` None without them).
    """

    trajectory: Trajectory
    localised: Trajectory
    wheels: Trajectory | None
    source: str
    scans_used: int
    scans_skipped: int
    covariance_per_metre: Floats
    warnings: tuple[ProcessWarning, ...]


@dataclass(frozen=True, eq=False)
class OdometryScan:
    """Event: one scan as KISS-ICP placed it. ``points`` (n, 2) in the odometry's frame."""

    stamp_ns: int
    odom_from_base: Pose2
    points: Floats
    threshold: float


# How the error of each source grows with the way, as standard deviations a metre (x, y, yaw): the
# first two as measured on simulated laps, the last so loose that a localisation's jump fits in.
_ERROR_PER_METRE = {
    "laser": (0.004, 0.004, 0.001),
    "wheels": (0.03, 0.03, 0.015),
    "localisation": (0.08, 0.08, 0.04),
}
_LONGEST_FALLBACK = 20_000
_LEAST_POINTS = 30


def estimate_odometry(
    recording: Recording,
    snapshots: tuple[Snapshot, ...],
    *,
    config: OdometryConfig,
    record: Record,
) -> Odometry:
    """Run KISS-ICP over the scans of the whole drive, or fall back to what was recorded.

    Scans are streamed; those that moved are used, de-skewed by the recorded motion. Each used one
    goes to ``record`` as an `OdometryScan`. Raises `EstimationError` where there is no pose at all.
    Source of the method: Vizzo et al., KISS-ICP, RA-L 2023, here in the plane and with a prior.
    """
    warnings: list[ProcessWarning] = []
    placed = _place_scans(recording, config, record, warnings) if recording.names.laser else None
    if placed is not None and len(placed.stamps_ns) >= 2:
        trajectory, used, skipped, source = placed.trajectory, placed.used, placed.skipped, "laser"
    else:
        trajectory, source = _recorded_trajectory(recording, snapshots)
        used, skipped = 0, placed.skipped if placed else 0
        code = "odometry.no_laser" if source == "wheels" else "odometry.no_wheels"
        message = f"no usable laser scan; the motion between the stops is that of the {source}"
        warnings.append(ProcessWarning(code, "odometry", message))
    variances = np.square(_ERROR_PER_METRE[source])
    return Odometry(
        trajectory=trajectory,
        localised=_sampled(recording.fixed_from_base, trajectory),
        wheels=_sampled(recording.odom_from_base, trajectory) if _has_wheels(recording) else None,
        source=source,
        scans_used=used,
        scans_skipped=skipped,
        covariance_per_metre=np.diag(variances),
        warnings=tuple(warnings),
    )


def points_in_base(
    scan: LaserScan,
    base_from_laser: Floats,
    *,
    maximum_range: float,
    motion: Pose2 | None = None,
) -> tuple[Floats, NDArray[np.bool_]]:
    """Lift a scan to 3D in the base at its stamp.

    ``motion`` is the base's during the sweep (first beam to last), each beam is moved back by its
    share. Returns (n, 3) points of all beams and the (n,) mask of those that measured something.
    """
    ranges = np.asarray(scan.ranges, dtype=np.float64)
    nearest = max(scan.range_min, 0.02)
    # Beams at the very end of the range are "nothing seen" with some drivers.
    farthest = min(maximum_range, scan.range_max - 1e-3 if scan.range_max > 0 else maximum_range)
    valid = np.isfinite(ranges) & (ranges >= nearest) & (ranges <= farthest)
    distance = np.where(valid, ranges, 0.0)
    beams = np.zeros((len(ranges), 3))
    beams[:, 0] = distance * np.cos(scan.angles)
    beams[:, 1] = distance * np.sin(scan.angles)
    points = transform(base_from_laser, beams)
    if motion is not None and len(ranges) > 1:
        share = np.linspace(0.0, 1.0, len(ranges))
        cos, sin = np.cos(share * motion.yaw), np.sin(share * motion.yaw)
        x = cos * points[:, 0] - sin * points[:, 1] + share * motion.x
        y = sin * points[:, 0] + cos * points[:, 1] + share * motion.y
        points[:, 0], points[:, 1] = x, y
    return points, valid


def sweep_motion(
    scan: LaserScan, base_at: Callable[[int], Pose2 | None]
) -> tuple[Pose2 | None, float]:
    """Return the base's motion during a scan (None: unknown or none), and the time it took.

    A driver that leaves ``time_increment`` at zero is taken at its word.
    """
    duration = float(scan.time_increment) * max(len(scan.ranges) - 1, 0)
    if not 0.0 < duration < 1.0:
        return None, 0.0
    # Poses are recorded more coarsely than a sweep takes: a longer base is steadier.
    span = max(duration, 0.1)
    before = base_at(scan.stamp_ns + round((duration - span) / 2 * 1e9))
    after = base_at(scan.stamp_ns + round((duration + span) / 2 * 1e9))
    if before is None or after is None:
        return None, duration
    step = before.inverse() @ after
    share = duration / span
    return Pose2(step.x * share, step.y * share, step.yaw * share), duration


@dataclass(frozen=True, eq=False)
class _Placed:
    trajectory: Trajectory
    used: int
    skipped: int

    @property
    def stamps_ns(self) -> NDArray[np.int64]:
        return self.trajectory.stamps_ns


def _place_scans(
    recording: Recording, config: OdometryConfig, record: Record, warnings: list[ProcessWarning]
) -> _Placed | None:
    has_wheels = _has_wheels(recording)
    recorded = recording.odom_from_base if has_wheels else recording.fixed_from_base

    def base_at(stamp_ns: int) -> Pose2 | None:
        matrix = recorded(stamp_ns)
        return None if matrix is None else Pose2.projected(matrix)

    threshold = config.threshold if has_wheels else config.threshold_without_wheels
    kiss = _make_kiss(config, threshold)
    start: Pose2 | None = None
    last = last_prior = Pose2()
    last_delta = Pose2()
    last_ns = 0
    stamps: list[int] = []
    poses: list[Floats] = []
    skipped = standing = kept_prior = 0
    for scan in recording.scans():
        prior = base_at(scan.stamp_ns)
        fixed = recording.fixed_from_base(scan.stamp_ns) if start is None else None
        if prior is None or (start is None and fixed is None):
            skipped += 1
            continue
        delta = Pose2()
        if stamps:
            if scan.stamp_ns <= last_ns:
                skipped += 1
                continue
            delta = last_prior.inverse() @ prior
            seconds = (scan.stamp_ns - last_ns) * 1e-9
            if not has_wheels and _is_jump(delta, seconds, config):
                delta = last_delta
            if not _moved(delta, config):
                standing += 1
                if standing % config.standing_every:
                    skipped += 1
                    continue
        motion, _ = sweep_motion(scan, base_at)
        if motion is not None and _is_jump(motion, scan.time_increment * len(scan.ranges), config):
            motion = None
        points, valid = points_in_base(
            scan,
            recording.base_from_laser(scan.stamp_ns),
            maximum_range=config.maximum_range,
            motion=motion,
        )
        frame = points[valid]
        if len(frame) < _LEAST_POINTS:
            skipped += 1
            continue
        if start is None:
            assert fixed is not None
            start = Pose2.projected(fixed)
        pose = _register(kiss, frame, last, delta)
        correction = (last @ delta).inverse() @ pose
        if np.hypot(correction.x, correction.y) > config.maximum_correction:
            pose, kept_prior = last @ delta, kept_prior + 1
        kiss.last_pose = pose.lifted()
        last_delta = last.inverse() @ pose
        last, last_prior, last_ns = pose, prior, scan.stamp_ns
        odom_from_base = start @ pose
        stamps.append(scan.stamp_ns)
        poses.append(odom_from_base.as_array())
        thinned = frame[:: -(-len(frame) // config.event_points), :2]
        record(
            OdometryScan(scan.stamp_ns, odom_from_base, odom_from_base.apply(thinned), threshold)
        )
    if kept_prior:
        message = f"{kept_prior} of {len(stamps)} scans moved too far from their prior and kept it"
        warnings.append(ProcessWarning("odometry.kept_prior", "odometry", message))
    if not stamps:
        return None
    trajectory = Trajectory(np.array(stamps, dtype=np.int64), np.array(poses))
    return _Placed(trajectory, len(stamps), skipped)


def _make_kiss(config: OdometryConfig, threshold: float) -> Any:
    # Imported here: it takes a second. Every section is given, or it would read the environment.
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
            data=DataConfig(max_range=config.maximum_range, min_range=0.0, deskew=False),
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


def _moved(delta: Pose2, config: OdometryConfig) -> bool:
    far = bool(np.hypot(delta.x, delta.y) > config.moved)
    return far or bool(np.degrees(abs(delta.yaw)) > config.turned_deg)


def _is_jump(delta: Pose2, seconds: float, config: OdometryConfig) -> bool:
    # Two centimetres and half a degree: what a localisation may jitter between two scans.
    far = np.hypot(delta.x, delta.y) > config.maximum_speed * seconds + 0.02
    turned = np.degrees(abs(delta.yaw)) > config.maximum_turn_deg * seconds + 0.5
    return bool(far or turned)


def _has_wheels(recording: Recording) -> bool:
    """Tell whether wheel odometry was recorded: a frame may be named and never be sent."""
    if recording.names.odom is None:
        return False
    probes = np.linspace(recording.start_ns, recording.end_ns, 7).astype(np.int64)
    return any(recording.odom_from_base(int(stamp)) is not None for stamp in probes)


def _recorded_trajectory(
    recording: Recording, snapshots: tuple[Snapshot, ...]
) -> tuple[Trajectory, str]:
    """Take the wheels' trajectory, moved to begin at its localised pose, or the localisation's."""
    stamps = np.unique(
        np.concatenate(
            [recording.pose_stamps(), np.array([s.stamp_ns for s in snapshots], dtype=np.int64)]
        )
    ).astype(np.int64)
    wanted = {snapshot.stamp_ns for snapshot in snapshots}
    every = -(-max(len(stamps), 1) // _LONGEST_FALLBACK)
    kept = [int(s) for i, s in enumerate(stamps) if i % every == 0 or int(s) in wanted]
    both = [(s, recording.fixed_from_base(s), recording.odom_from_base(s)) for s in kept]
    wheels = [(s, fixed, odom) for s, fixed, odom in both if fixed is not None and odom is not None]
    if _has_wheels(recording) and len(wheels) >= 2:
        _, fixed, odom = wheels[0]
        placed = Pose2.projected(fixed) @ Pose2.projected(odom).inverse()
        return _trajectory([(s, placed @ Pose2.projected(odom)) for s, _, odom in wheels]), "wheels"
    localised = [(s, Pose2.projected(fixed)) for s, fixed, _ in both if fixed is not None]
    if not localised:
        localised = [(snapshot.stamp_ns, snapshot.map_from_base) for snapshot in snapshots]
    if not localised:
        raise EstimationError(
            "expected poses of the base over time, found none in the recording; "
            "record /tf with the localisation (map to base)"
        )
    return _trajectory(localised), "localisation"


def _trajectory(timed: list[tuple[int, Pose2]]) -> Trajectory:
    stamps = np.array([stamp for stamp, _ in timed], dtype=np.int64)
    return Trajectory(stamps, np.array([pose.as_array() for _, pose in timed]))


def _sampled(base_at: Callable[[int], Floats | None], trajectory: Trajectory) -> Trajectory:
    """Sample a recorded pose at the trajectory's stamps; an unknown one is its neighbour's."""
    matrices = [base_at(int(stamp)) for stamp in trajectory.stamps_ns]
    known = [Pose2.projected(m) if m is not None else None for m in matrices]
    first = next((pose for pose in known if pose is not None), Pose2())
    held = itertools.accumulate(
        known, lambda last, pose: last if pose is None else pose, initial=first
    )
    poses = [pose.as_array() for pose in itertools.islice(held, 1, None) if pose is not None]
    return Trajectory(trajectory.stamps_ns, np.array(poses).reshape(-1, 3))
