"""The recorded motion of the base: the wheels', or the localisation's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tablemap.errors import EstimationError
from tablemap.geometry import Bools, Floats, Ints, Pose2, planar
from tablemap.recording import Recording
from tablemap.stages.odometry.result import MotionSource
from tablemap.stages.odometry.trajectory import Trajectory, composed, undone
from tablemap.stages.snapshots import Snapshot

PosesAt = Callable[[Ints], tuple[Floats, Bools]]
"""Returns the poses (n, 4, 4) at stamps (n,), and a mask of the known ones."""

_LONGEST = 20_000


@dataclass(frozen=True, eq=False)
class KnownPoses:
    """Poses (n, 3) x, y, yaw, and which of them (n,) were recorded."""

    poses: Floats
    known: Bools


class RecordedPoses:
    """The recorded motion, remembered at stamps that were looked up together.

    One look at a thousand stamps costs as much as ten looks at one.
    """

    def __init__(self, poses_at: PosesAt) -> None:
        self._poses_at = poses_at
        self._held: dict[int, Pose2 | None] = {}

    def prepared(self, stamps_ns: Ints) -> KnownPoses:
        """Look up and remember the poses at stamps (n,)."""
        matrices, known = self._poses_at(stamps_ns)
        poses = planar(matrices)
        for stamp, (x, y, yaw), is_known in zip(
            stamps_ns.tolist(), poses.tolist(), known.tolist(), strict=True
        ):
            self._held[stamp] = Pose2(x, y, yaw) if is_known else None
        return KnownPoses(poses, known)

    def at(self, stamp_ns: int) -> Pose2 | None:
        """Return the pose at a stamp, None where none was recorded."""
        if stamp_ns not in self._held:
            self.prepared(np.array([stamp_ns], dtype=np.int64))
        return self._held[stamp_ns]


def has_wheels(recording: Recording) -> bool:
    """Tell whether wheel odometry was recorded: its frame may have a name but no poses."""
    if recording.names.odom is None:
        return False
    probes = np.linspace(recording.start_ns, recording.end_ns, 7).astype(np.int64)
    return bool(recording.odom_from_bases(probes)[1].any())


def recorded_trajectory(
    recording: Recording, snapshots: tuple[Snapshot, ...]
) -> tuple[Trajectory, MotionSource]:
    """Return the wheels' trajectory, started at its localised pose, or the localisation's."""
    at_snapshots = np.array([s.stamp_ns for s in snapshots], dtype=np.int64)
    stamps = np.union1d(thinned_stamps(recording), at_snapshots)
    fixed, localised = recording.fixed_from_bases(stamps)
    odom, rolled = recording.odom_from_bases(stamps)
    both = localised & rolled
    if both.sum() >= 2:
        wheels = planar(odom[both])
        begin = composed(planar(fixed[both][:1])[0], undone(wheels[0])[None])[0]
        return Trajectory(stamps[both], composed(begin, wheels)), "wheels"
    if localised.any():
        return Trajectory(stamps[localised], planar(fixed[localised])), "localisation"
    if not snapshots:
        raise EstimationError(
            "expected poses of the base over time, found none in the recording; "
            "record /tf with the localisation (map to base)"
        )
    return Trajectory.of([(s.stamp_ns, s.map_from_base) for s in snapshots]), "localisation"


def thinned_stamps(recording: Recording) -> Ints:
    """Return the stamps of the recorded poses, evenly thinned to at most 20 000."""
    stamps = np.unique(recording.pose_stamps()).astype(np.int64)
    return stamps[:: -(-max(len(stamps), 1) // _LONGEST)]


def known_poses(poses_at: PosesAt, stamps_ns: Ints) -> Trajectory:
    """Return the recorded poses at the stamps that have one."""
    matrices, known = poses_at(stamps_ns)
    return Trajectory(stamps_ns[known], planar(matrices[known]))


def sampled(poses_at: PosesAt, stamps_ns: Ints) -> Trajectory:
    """Sample a recorded pose at stamps (n,); an unknown pose repeats the last known one."""
    matrices, known = poses_at(stamps_ns)
    if not known.any():
        return Trajectory(stamps_ns, np.zeros((len(stamps_ns), 3)))
    last = np.maximum.accumulate(np.where(known, np.arange(len(known)), int(np.argmax(known))))
    return Trajectory(stamps_ns, planar(matrices)[last])
