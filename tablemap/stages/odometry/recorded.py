"""The recorded motion of the base: the wheels', or the localisation's."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tablemap.errors import EstimationError
from tablemap.geometry import Bools, Floats, Ints
from tablemap.recording import Recording
from tablemap.stages.odometry.result import MotionSource
from tablemap.stages.odometry.trajectory import Trajectory, composed, undone
from tablemap.stages.snapshots import Snapshot

PosesAt = Callable[[Ints], tuple[Floats, Bools]]
"""Returns the poses (n, 4, 4) at stamps (n,), and a mask of the known ones."""

_LONGEST = 20_000


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
        wheels = _planar(odom[both])
        begin = composed(_planar(fixed[both][:1])[0], undone(wheels[0])[None])[0]
        return Trajectory(stamps[both], composed(begin, wheels)), "wheels"
    if localised.any():
        return Trajectory(stamps[localised], _planar(fixed[localised])), "localisation"
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
    return Trajectory(stamps_ns[known], _planar(matrices[known]))


def sampled(poses_at: PosesAt, stamps_ns: Ints) -> Trajectory:
    """Sample a recorded pose at stamps (n,); an unknown pose repeats the last known one."""
    matrices, known = poses_at(stamps_ns)
    if not known.any():
        return Trajectory(stamps_ns, np.zeros((len(stamps_ns), 3)))
    last = np.maximum.accumulate(np.where(known, np.arange(len(known)), int(np.argmax(known))))
    return Trajectory(stamps_ns, _planar(matrices)[last])


def _planar(matrices: Floats) -> Floats:
    """Project (n, 4, 4) poses onto the ground: (n, 3) x, y and the heading of the x axis."""
    yaw = np.arctan2(matrices[:, 1, 0], matrices[:, 0, 0])
    return np.column_stack([matrices[:, 0, 3], matrices[:, 1, 3], yaw])
