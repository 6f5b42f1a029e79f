"""The motion of the base between the stops: by the laser, or by the wheels if it saw too little."""

from __future__ import annotations

import numpy as np

from tablemap.config import OdometryConfig, SensorsConfig
from tablemap.errors import ProcessWarning
from tablemap.events import Record
from tablemap.geometry import Floats, Ints
from tablemap.recording import Recording
from tablemap.stages.odometry.bridging import bridge
from tablemap.stages.odometry.placing import PlacedScans, place_scans
from tablemap.stages.odometry.recorded import (
    has_wheels,
    known_poses,
    recorded_trajectory,
    sampled,
    thinned_stamps,
)
from tablemap.stages.odometry.result import MotionSource, Odometry
from tablemap.stages.odometry.trajectory import Trajectory, composed, undone
from tablemap.stages.snapshots import Snapshot
from tablemap.words import counted

_APART, _APART_SHARE = 1.0, 0.02  # metres, and share of the way: wheels drift by less
_OPEN_SHARE = 0.1  # of the way, in one direction: a smaller open share is no corridor


def estimate_odometry(
    recording: Recording,
    snapshots: tuple[Snapshot, ...],
    *,
    config: OdometryConfig,
    sensors: SensorsConfig,
    record: Record,
) -> Odometry:
    """Run KISS-ICP over the scans of the whole drive, or use the recorded motion without scans.

    Scans are streamed. Scans of the moving base are used, de-skewed by the recorded motion. Each
    used scan goes to ``record`` as an `OdometryScan`; from time to time the map goes there as an
    `OdometryMap`. If no scan could be placed, the wheels bridge the gap. Raises `EstimationError`
    without any pose.
    Source of the method: Vizzo et al., KISS-ICP, RA-L 2023, here in the plane and with a prior.
    """
    warnings: list[ProcessWarning] = []
    placed = None
    if recording.names.laser:
        placed = place_scans(recording, config, sensors, record, warnings)
    on_wheels = has_wheels(recording)
    gaps = np.zeros((0, 2), dtype=np.int64)
    if placed is not None and len(placed.trajectory.stamps_ns) >= 2:
        source: MotionSource = "laser"
        trajectory = placed.trajectory
        used, skipped = len(trajectory.stamps_ns), placed.skipped
        if on_wheels:
            stamps = np.union1d(thinned_stamps(recording), trajectory.stamps_ns)
            wheels = known_poses(recording.odom_from_bases, stamps)
            trajectory, gaps = bridge(trajectory, wheels, moved=config.moved)
            warnings += _bridged(trajectory, gaps) + _disagreeing(trajectory, wheels)
        open_way = _open_way(placed, trajectory.stamps_ns)
        warnings += _left_open(trajectory, open_way, "wheels" if on_wheels else "localisation")
    else:
        trajectory, source = recorded_trajectory(recording, snapshots)
        open_way = np.zeros((len(trajectory.stamps_ns), 2, 2))
        used, skipped = 0, placed.skipped if placed else 0
        code = "odometry.no_laser" if source == "wheels" else "odometry.no_wheels"
        message = f"there is no usable laser scan; the motion of the {source} was taken"
        warnings.append(ProcessWarning(code, "odometry", message))
    at = trajectory.stamps_ns
    return Odometry(
        trajectory=trajectory,
        localised=sampled(recording.fixed_from_bases, at),
        wheels=sampled(recording.odom_from_bases, at) if on_wheels else None,
        source=source,
        scans_used=used,
        scans_skipped=skipped,
        gaps=gaps,
        open_way=open_way,
        warnings=tuple(warnings),
    )


def _open_way(placed: PlacedScans, stamps_ns: Ints) -> Floats:
    """Return (n, 2, 2) metres of way, up to each stamp, that the placed scans left open."""
    steps = np.diff(placed.trajectory.way())[:, None, None] * placed.left_open[1:]
    summed = np.concatenate([np.zeros((1, 2, 2)), np.cumsum(steps, axis=0)]).reshape(-1, 4)
    known = placed.trajectory.stamps_ns.astype(np.float64)
    each = [np.interp(stamps_ns.astype(np.float64), known, column) for column in summed.T]
    return np.stack(each, axis=1).reshape(-1, 2, 2)


def _left_open(trajectory: Trajectory, open_way: Floats, prior: str) -> list[ProcessWarning]:
    way, most = trajectory.way()[-1], float(np.trace(open_way[-1]))
    if most <= _OPEN_SHARE * way:
        return []
    message = (
        f"over {most:.1f} of {way:.1f} m the laser saw nothing that fixes the position along one "
        f"direction, as in a corridor; along it the motion of the {prior} was taken"
    )
    first = int(np.argmax(np.trace(open_way, axis1=1, axis2=2) > 0))
    stamp_ns = int(trajectory.stamps_ns[first])
    return [ProcessWarning("odometry.left_open", "odometry", message, stamp_ns)]


def _disagreeing(trajectory: Trajectory, wheels: Trajectory) -> list[ProcessWarning]:
    """Warn if the wheels end up metres from the laser, both begun at one pose."""
    stamps = trajectory.stamps_ns
    stamps = stamps[(stamps >= wheels.stamps_ns[0]) & (stamps <= wheels.stamps_ns[-1])]
    rolled, seen = wheels.at_all(stamps), trajectory.at_all(stamps)
    rolled = composed(seen[0], composed(undone(rolled[0]), rolled))
    apart = np.linalg.norm((rolled - seen)[:, :2], axis=1)
    most, way = int(np.argmax(apart)), float(trajectory.way()[-1])
    if apart[most] <= _APART + _APART_SHARE * way:
        return []
    message = (
        f"wheels and laser end up {apart[most]:.1f} m apart after a drive of {way:.1f} m; the "
        "laser's motion was taken, and the scans of the stops check it; slipping wheels or a wrong "
        "wheel size would explain the difference"
    )
    code = "odometry.wheels_disagree"
    return [ProcessWarning(code, "odometry", message, int(stamps[most]))]


def _bridged(trajectory: Trajectory, gaps: Ints) -> list[ProcessWarning]:
    if not len(gaps):
        return []
    ways = [trajectory.way_between(*gap) for gap in gaps]
    message = (
        f"no laser scan could be placed over {sum(ways):.1f} of {trajectory.way()[-1]:.1f} m "
        f"({counted(len(gaps), 'gap')}, the longest {max(ways):.1f} m); there the motion of the "
        "wheels was taken"
    )
    return [ProcessWarning("odometry.bridged", "odometry", message, int(gaps[0][0]))]
