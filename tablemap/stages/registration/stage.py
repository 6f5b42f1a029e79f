"""The stages of registration in their order."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from threadpoolctl import threadpool_limits

from tablemap.config import RegistrationConfig, SensorsConfig
from tablemap.errors import EstimationError, ProcessWarning, WarnedPlace
from tablemap.events import Record
from tablemap.geometry import Floats, Pose2
from tablemap.recording import Recording
from tablemap.stages.odometry import Odometry
from tablemap.stages.outline import Outline
from tablemap.stages.registration.depth.depth import register_depth
from tablemap.stages.registration.laser.laser import register_laser
from tablemap.stages.registration.laser.stops import stop_scan
from tablemap.stages.registration.laser.sweep import said_of, told_share, turn_seconds
from tablemap.stages.registration.placement import bend_trajectory, place_in_map, stretched
from tablemap.stages.registration.result import DepthStatistics, Registration, StopScan
from tablemap.stages.registration.solution import Solution
from tablemap.stages.snapshots import Snapshot
from tablemap.words import counted

_LEAST_STOP_POINTS = 40
_DEPTH_EXCESS = 2.0
"""Real errors of poses from depth alone over their formal sigmas, as measured on real drives."""
_SWEEP_ROUNDS = 5
_LOST, _LOST_SHARE = 0.3, 1 / 3  # metres, and share of views: a localisation that is lost
_WANDERS = 0.10  # metres: a localisation that spreads further is worth a warning
_MARK = 0.15  # metres: radius of a circle about a view that is not used


def register(
    recording: Recording,
    snapshots: tuple[Snapshot, ...],
    odometry: Odometry,
    *,
    edges: Callable[[], Outline],
    config: RegistrationConfig,
    sensors: SensorsConfig,
    record: Record,
) -> Registration:
    """Place all snapshots in the map, relative to each other to millimetres, and check them.

    The poses come from the laser's stop scans. Without a laser they come from upright surfaces in
    the depth images and from the table's ``edges``, which are computed only then; likewise if the
    laser loses views and depth loses fewer. Without both they come from the localisation. Every
    stop's scan and every ICP iteration go to ``record``. Nothing here is random. Raises
    `EstimationError` without any snapshot.
    """
    if not snapshots:
        raise EstimationError("expected at least one snapshot to register, found none")
    localised = np.array([snapshot.map_from_base.as_array() for snapshot in snapshots])
    initial = _initial(odometry, snapshots, localised)
    warnings: list[ProcessWarning] = []

    def by_depth() -> Solution:
        return register_depth(
            snapshots, edges, odometry, initial, config=config, sensors=sensors, record=record
        )

    # The systems are small: threads cost more than they save, and one thread makes runs repeat.
    with threadpool_limits(limits=1):
        stops = _stop_scans(recording, snapshots, odometry, config, sensors, record)
        if sum(stop is not None for stop in stops) >= 2:
            stops, solution, share = _by_laser(
                recording, stops, snapshots, odometry, initial, config, sensors, record
            )
            warnings = said_of(share, recording)
            if not all(check.passed for check in solution.checks):
                solution = of_more_views(solution, by_depth(), warnings)
        else:
            solution = by_depth()
        relative, covariance = solution.poses, solution.covariance
        stretch_sigma = sensors.laser_range_scale_sigma
        if solution.source != "laser":
            relative, stretch_sigma = stretched(
                relative, localised, sigma=sensors.drive_scale_sigma
            )
            covariance = _DEPTH_EXCESS**2 * covariance
        fit, placement = place_in_map(relative, localised)
    poses = tuple(fit @ Pose2.from_array(pose) for pose in relative)
    warnings += [*solution.warnings, *_missing(stops, snapshots, solution)]
    warnings += _doubts(solution, snapshots, poses, localised)
    return Registration(
        map_from_base=poses,
        covariance=_turned(covariance, fit.rotation),
        placement_covariance=placement,
        graph_before=tuple(Pose2.from_array(pose) for pose in initial),
        used=tuple(check.passed for check in solution.checks),
        checks=solution.checks,
        pairs=solution.pairs,
        stop_scans=tuple(stop for stop in stops if stop is not None),
        trajectory=bend_trajectory(odometry.trajectory, [s.stamp_ns for s in snapshots], poses),
        source=solution.source,
        systematic=solution.systematic,
        warnings=tuple(warnings),
        stretch_sigma=stretch_sigma,
    )


def of_more_views(
    by_laser: Solution, by_depth: Solution, warnings: list[ProcessWarning]
) -> Solution:
    """Return the solution whose checks pass more of the views that show the top's edge.

    Only there the two can be compared: a view without edges has nothing that depth is checked by.
    If they pass the same number, the laser's is taken. It is the more precise one.
    """
    shown = [
        check.index
        for check in by_depth.checks
        if isinstance(check.statistics, DepthStatistics) and check.statistics.edge_points
    ]
    scanned, seen = (
        sum(solution.checks[index].passed for index in shown) for solution in (by_laser, by_depth)
    )
    if seen <= scanned:
        return by_laser
    message = (
        f"the laser places {scanned} of the {counted(len(shown), 'view')} of the table's edge, and "
        f"depth places {seen} of them: all poses come from depth, and are less certain than by a "
        "laser that sees the walls at all stops"
    )
    warnings[:] = [ProcessWarning("registration.depth_instead", "registration", message)]
    return by_depth


def _by_laser(
    recording: Recording,
    stops: tuple[StopScan | None, ...],
    snapshots: tuple[Snapshot, ...],
    odometry: Odometry,
    initial: Floats,
    config: RegistrationConfig,
    sensors: SensorsConfig,
    record: Record,
) -> tuple[tuple[StopScan | None, ...], Solution, float]:
    """Register by the laser, again where it shows that the scans took a part of a turn.

    Returns the scans that were registered at last, the solution, and that share.
    """

    def solved() -> Solution:
        return register_laser(
            stops, snapshots, odometry, initial, config=config, sensors=sensors, record=record
        )

    share, solution = 0.0, solved()
    for _ in range(_SWEEP_ROUNDS):
        missing = told_share(solution.sweep, share)
        if not missing:
            break
        share += missing
        stops = _stop_scans(
            recording, snapshots, odometry, config, sensors, record, turn_share=share
        )
        solution = solved()
    return stops, solution, share


def _initial(odometry: Odometry, snapshots: tuple[Snapshot, ...], localised: Floats) -> Floats:
    """Return (n, 3): the odometry's poses at the snapshots, moved as one body to the localisation.

    If the odometry is only the localisation, these are the localised poses.
    """
    if odometry.source == "localisation":
        return localised
    carried = np.array([odometry.trajectory.at(s.stamp_ns).as_array() for s in snapshots])
    fit, _ = place_in_map(carried, localised)
    return np.array([(fit @ Pose2.from_array(pose)).as_array() for pose in carried])


def _stop_scans(
    recording: Recording,
    snapshots: tuple[Snapshot, ...],
    odometry: Odometry,
    config: RegistrationConfig,
    sensors: SensorsConfig,
    record: Record,
    *,
    turn_share: float = 0.0,
) -> tuple[StopScan | None, ...]:
    """Return and record the scans at the stops, of snapshots that have a good one."""
    if recording.names.laser is None:
        return (None,) * len(snapshots)
    turn = turn_seconds(recording)
    scans = [
        stop_scan(
            recording,
            snapshot,
            odometry.trajectory,
            most_scans=config.stop_scans,
            maximum_range=sensors.laser_maximum_range_registration,
            turn_seconds=turn,
            turn_share=turn_share,
        )
        for snapshot in snapshots
    ]
    stops = tuple(
        scan if scan is not None and len(scan.points) >= _LEAST_STOP_POINTS else None
        for scan in scans
    )
    for stop in stops:
        if stop is not None:
            record(stop)
    return stops


def _turned(covariance: Floats, rotation: Floats) -> Floats:
    n = len(covariance) // 3
    block = np.eye(3)
    block[:2, :2] = rotation
    turn = np.kron(np.eye(n), block)
    return np.asarray(turn @ covariance @ turn.T, dtype=np.float64)


def _missing(
    stops: tuple[StopScan | None, ...], snapshots: tuple[Snapshot, ...], solution: Solution
) -> list[ProcessWarning]:
    if solution.source != "laser":
        return []
    warnings = []
    for stop, snapshot, check in zip(stops, snapshots, solution.checks, strict=True):
        if stop is None:
            fate = "depth connects it to the others" if check.passed else "it is not used"
            message = f"there is no usable laser scan at this snapshot; {fate}"
            warnings.append(
                ProcessWarning("registration.no_scan", "registration", message, snapshot.stamp_ns)
            )
    return warnings


def _doubts(
    solution: Solution,
    snapshots: tuple[Snapshot, ...],
    poses: tuple[Pose2, ...],
    localised: Floats,
) -> list[ProcessWarning]:
    warnings = []
    for check, snapshot, pose in zip(solution.checks, snapshots, poses, strict=True):
        if not check.passed and check.statistics:
            message = f"snapshot {check.index} is not used: {'; '.join(check.reasons)}"
            code = "accuracy.registration_failed"
            places = (WarnedPlace.about((pose.x, pose.y), _MARK, height=0.0),)
            warnings.append(
                ProcessWarning(code, "registration", message, snapshot.stamp_ns, places)
            )
    apart = np.array([pose.as_array()[:2] for pose in poses]) - localised[:, :2]
    off = np.linalg.norm(apart, axis=1)
    spread, far = float(np.median(off)), int(np.sum(off > _LOST))
    if far > _LOST_SHARE * len(off):
        message = (
            f"{far} of {len(off)} localised poses lie more than {_LOST} m from the registered ones "
            f"(up to {off.max():.1f} m): the localisation wandered, and the table's place in the "
            "map is hardly known"
        )
        warnings.append(ProcessWarning("accuracy.localisation", "registration", message))
    elif spread > _WANDERS:
        message = (
            f"the localised poses lie {1e3 * spread:.0f} mm (median) from the registered ones; "
            "the table's place in the map is as uncertain as this"
        )
        warnings.append(ProcessWarning("registration.placement", "registration", message))
    return warnings
