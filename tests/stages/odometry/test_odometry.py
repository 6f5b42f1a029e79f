"""Odometry carries the base between the stops, from whatever was recorded."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tablemap.config import OdometryConfig
from tablemap.geometry import Pose2
from tablemap.stages.odometry import Odometry, OdometryMap, OdometryScan, Trajectory, points_in_base
from tablemap.stages.odometry.constraint import constrained, held_share
from tablemap.stages.odometry.placing import EVENT_MAPS, EVENT_POINTS
from tests.making.registered_laps import estimated
from tests.making.rooms import BASE_FROM_LASER, Drive, corridor, relative_errors, room


def estimate(drive: Drive) -> tuple[Odometry, list[object]]:
    """Run odometry over a drive and return it with its events."""
    events: list[object] = []
    return estimated(drive, events.append), events


def at_stops(odometry: Odometry, drive: Drive) -> np.ndarray:
    """Return (n, 3) odometry poses at the stops."""
    return np.array([odometry.trajectory.at(s).as_array() for s in drive.stop_stamps])


@pytest.fixture(scope="module")
def lap() -> tuple[Drive, Odometry, list[object]]:
    """A lap in a room, its laser skewed by the motion."""
    drive = Drive(room(1), seed=1, stops=6, standing_s=0.6, rate_hz=10)
    odometry, events = estimate(drive)
    return drive, odometry, events


def test_laser_odometry_is_right_to_a_centimetre(lap: tuple[Drive, Odometry, list[object]]) -> None:
    """KISS-ICP over the de-skewed scans beats wheels that are off by centimetres."""
    drive, odometry, _ = lap
    place, yaw = relative_errors(at_stops(odometry, drive), drive.truth())
    assert odometry.source == "laser"
    assert place.max() < 0.02
    assert np.degrees(yaw.max()) < 0.6
    assert not odometry.warnings


def test_odometry_begins_at_the_first_localised_pose(
    lap: tuple[Drive, Odometry, list[object]],
) -> None:
    """Its frame is where the localisation put the base at the first scan."""
    drive, odometry, _ = lap
    assert np.allclose(odometry.trajectory.poses[0, :2], drive.localised[0, :2], atol=0.02)


def test_every_used_scan_is_recorded_in_order_and_thinned(
    lap: tuple[Drive, Odometry, list[object]],
) -> None:
    """What was registered can be reviewed; standing scans are mostly left out."""
    drive, odometry, events = lap
    scans = [event for event in events if isinstance(event, OdometryScan)]
    assert len(scans) == odometry.scans_used == len(odometry.trajectory.stamps_ns)
    assert odometry.scans_used + odometry.scans_skipped == len(drive.stamps)
    assert odometry.scans_skipped > 0
    assert (np.diff(odometry.trajectory.stamps_ns) > 0).all()
    assert max(len(scan.points) for scan in scans) <= EVENT_POINTS


def test_what_scans_are_registered_to_is_recorded_now_and_then(
    lap: tuple[Drive, Odometry, list[object]],
) -> None:
    """KISS-ICP's map grows round the room; the last one is that of the last scan."""
    _, odometry, events = lap
    maps = [event for event in events if isinstance(event, OdometryMap)]
    assert 2 <= len(maps) <= EVENT_MAPS + 1
    assert maps[-1].stamp_ns == odometry.trajectory.stamps_ns[-1]
    assert len(maps[-1].points) > len(maps[0].points) > 100
    scans = {event.stamp_ns: event for event in events if isinstance(event, OdometryScan)}
    assert all(scans[one.stamp_ns].threshold == OdometryConfig().threshold for one in maps)
    assert max(scan.correction for scan in scans.values()) < OdometryConfig().maximum_correction
    last = cKDTree(maps[-1].points).query(scans[maps[-1].stamp_ns].points)[0]
    assert np.median(last) < 0.03


def test_it_repeats_bit_for_bit(lap: tuple[Drive, Odometry, list[object]]) -> None:
    """The same drive gives the same trajectory."""
    drive, odometry, _ = lap
    again, _ = estimate(drive)
    assert np.array_equal(again.trajectory.poses, odometry.trajectory.poses)


def test_without_a_laser_the_wheels_carry(lap: tuple[Drive, Odometry, list[object]]) -> None:
    """The wheels' steps are kept, their frame is laid onto the localisation, and it is said."""
    drive = Drive(room(1), seed=1, stops=6, standing_s=0.6, rate_hz=10, laser=False)
    odometry, _ = estimate(drive)
    assert odometry.source == "wheels"
    assert [w.code for w in odometry.warnings] == ["odometry.no_laser"]
    place, _ = relative_errors(
        at_stops(odometry, drive),
        np.array([Pose2.projected(drive.odom_from_base(s)).as_array() for s in drive.stop_stamps]),  # type: ignore[arg-type]
    )
    assert place.max() < 1e-6


def test_with_neither_the_localisation_carries() -> None:
    """What is left is the recorded pose, and a warning that says so."""
    drive = Drive(room(1), seed=1, stops=4, standing_s=0.4, rate_hz=5, laser=False, wheels=False)
    odometry, _ = estimate(drive)
    assert odometry.source == "localisation"
    assert [w.code for w in odometry.warnings] == ["odometry.no_wheels"]
    expected = [snapshot.map_from_base.as_array() for snapshot in drive.snapshots()]
    assert np.allclose(at_stops(odometry, drive), expected, atol=1e-9)


def test_the_wheels_bridge_what_the_laser_did_not_see(
    lap: tuple[Drive, Odometry, list[object]],
) -> None:
    """A laser that is silent over a quarter of the lap costs centimetres, and that is said."""
    drive, whole, _ = lap
    first, last = (int(np.mean(drive.stop_stamps[k : k + 2])) for k in (2, 4))

    class Silent(Drive):
        """The drive, its laser silent from between two stops to between two others."""

        def scans(self, *span, **due):  # type: ignore[no-untyped-def]
            """Yield the scans outside of the gap."""
            for scan in super().scans(*span, **due):
                if not first < scan.stamp_ns < last:
                    yield scan

    silent = Silent(drive.segments, seed=1, stops=6, standing_s=0.6, rate_hz=10)
    odometry, _ = estimate(silent)
    assert odometry.source == "laser"
    assert [w.code for w in odometry.warnings] == ["odometry.bridged"]
    ((begin, end),) = odometry.gaps
    assert abs(begin - first) < 3e8
    assert abs(end - last) < 3e8
    place, yaw = relative_errors(at_stops(odometry, silent), silent.truth())
    assert place.max() < 0.06
    assert np.degrees(yaw.max()) < 2.0
    # What was bridged is believed as wheels are, the rest as before.
    early, late = drive.stop_stamps[:2], drive.stop_stamps[2:4]
    kept, loose = odometry.covariance_between(*early), odometry.covariance_between(*late)
    assert np.allclose(kept, whole.covariance_between(*early), rtol=0.05)
    assert loose[0, 0] > 4 * whole.covariance_between(*late)[0, 0]
    assert place.max() < 4 * np.sqrt(loose[0, 0])


def test_the_wheels_carry_where_the_laser_sees_little(
    lap: tuple[Drive, Odometry, list[object]],
) -> None:
    """A short laser sees pieces of walls that end with its range; they would drag the base."""
    drive, _, _ = lap

    class Short(Drive):
        """The drive with a laser that sees two metres far."""

        def scans(self, *span, **due):  # type: ignore[no-untyped-def]
            """Yield the scans with infinity where nothing is near."""
            for scan in super().scans(*span, **due):
                ranges = np.where(scan.ranges < 2.0, scan.ranges, np.float32(np.inf))
                yield replace(scan, ranges=ranges)

    short = Short(drive.segments, seed=1, stops=6, standing_s=0.6, rate_hz=10)
    odometry, _ = estimate(short)
    rolled = np.array(
        [Pose2.projected(short.odom_from_base(s)).as_array() for s in short.stop_stamps]  # type: ignore[arg-type]
    )
    place, yaw = relative_errors(at_stops(odometry, short), rolled)
    assert place.max() < 1e-6
    assert yaw.max() < 1e-6


def test_the_wheels_go_on_after_the_last_scan(lap: tuple[Drive, Odometry, list[object]]) -> None:
    """Before the first and after the last placed scan the base does not stand still."""
    drive, _, _ = lap

    class Late(Drive):
        """The drive, its laser switched on after the second stop."""

        def scans(self, *span, **due):  # type: ignore[no-untyped-def]
            """Yield the scans of the later stops."""
            for scan in super().scans(*span, **due):
                if scan.stamp_ns > drive.stop_stamps[2]:
                    yield scan

    late = Late(drive.segments, seed=1, stops=6, standing_s=0.6, rate_hz=10)
    odometry, _ = estimate(late)
    place, _ = relative_errors(at_stops(odometry, late), late.truth())
    assert place.max() < 0.08
    assert odometry.trajectory.stamps_ns[0] < drive.stop_stamps[0]


def test_wheels_that_end_up_metres_from_the_laser_are_said() -> None:
    """Wheels of half their size roll twice as far; the laser carries, and that is said."""
    drive = Drive(room(1), seed=1, stops=6, standing_s=0.6, rate_hz=10)
    drive.wheel_poses = drive.wheel_poses * [2.0, 2.0, 1.0]
    odometry, _ = estimate(drive)
    place, _ = relative_errors(at_stops(odometry, drive), drive.truth())
    assert place.max() < 0.03
    (warning,) = (w for w in odometry.warnings if w.code == "odometry.wheels_disagree")
    assert re.search(r"end up [2-9]\.\d m apart after a drive of", warning.message)


CORRIDOR_YAW = 0.4


@pytest.fixture(scope="module")
def along() -> tuple[Drive, Odometry, list[object]]:
    """A lap round a table in a corridor without an end."""
    drive = Drive(
        corridor(CORRIDOR_YAW), seed=2, stops=6, standing_s=0.6, rate_hz=10, wheel_error=0.01
    )
    odometry, events = estimate(drive)
    return drive, odometry, events


def test_along_a_corridor_the_wheels_carry(along: tuple[Drive, Odometry, list[object]]) -> None:
    """Walls do not say how far the base went along them; across and in heading they still do."""
    drive, odometry, _ = along
    assert odometry.source == "laser"
    assert "odometry.left_open" in [w.code for w in odometry.warnings]
    true, found = drive.truth(), at_stops(odometry, drive)
    walls = np.array([np.cos(CORRIDOR_YAW), np.sin(CORRIDOR_YAW)])
    sigmas = []
    for k in range(len(true) - 1):
        steps = [
            Pose2.from_array(poses[k]).inverse() @ Pose2.from_array(poses[k + 1])
            for poses in (found, true)
        ]
        off = steps[0].translation - steps[1].translation
        direction = Pose2(0.0, 0.0, -true[k, 2]).rotate(walls[None])[0]
        covariance = odometry.covariance_between(*drive.stop_stamps[k : k + 2])
        across = np.array([-direction[1], direction[0]])
        sigma = np.sqrt(
            [direction @ covariance[:2, :2] @ direction, across @ covariance[:2, :2] @ across]
        )
        assert abs(direction @ off) < min(3 * sigma[0], 0.03)
        assert abs(across @ off) < min(3 * sigma[1], 0.01)
        assert abs(steps[0].yaw - steps[1].yaw) < np.radians(0.3)
        sigmas.append(sigma)
    assert np.min(np.divide(*np.transpose(sigmas))) > 3


def test_a_room_holds_in_both_directions_and_a_corridor_in_one(
    lap: tuple[Drive, Odometry, list[object]], along: tuple[Drive, Odometry, list[object]]
) -> None:
    """The shares add up to one, turn with the scan, and do not depend on its resolution."""
    for drive, least, most in ((lap[0], 0.2, 0.5), (along[0], 0.0, 0.05)):
        scan = next(drive.recording().scans())
        points, valid = points_in_base(scan, BASE_FROM_LASER, maximum_range=30.0)
        points, origin = points[valid][:, :2], BASE_FROM_LASER[:2, 3]
        whole = constrained(points, origin, voxel=0.1)
        values = np.linalg.eigvalsh(whole.shares)
        assert np.isclose(values.sum(), 1.0)
        assert least <= values[0] <= most
        thinned = constrained(points[::2], origin, voxel=0.1)
        assert np.linalg.eigvalsh(thinned.shares)[0] < most + 0.02
        turn = Pose2(0.0, 0.0, 0.7).rotation
        turned = constrained(points @ turn.T, turn @ origin, voxel=0.1)
        assert np.allclose(turned.shares, turn @ whole.shares @ turn.T, atol=0.01)
        gain = np.linalg.eigvalsh(held_share(whole.shares))
        assert np.allclose(gain, [float(least > 0), 1.0])
    nothing = constrained(np.zeros((0, 2)), np.zeros(2), voxel=0.1)
    assert not nothing.shares.any()
    assert nothing.length == 0
    assert not held_share(constrained(np.ones((9, 2)), np.zeros(2), voxel=0.1).shares).any()


def test_missing_and_out_of_range_beams_are_left_out() -> None:
    """NaN, infinity, zero and the end of the range are not measurements."""
    drive = Drive(room(1), stops=2, standing_s=0.2, rate_hz=2)
    scan = next(drive.recording().scans())
    scan.ranges[:5] = [np.nan, np.inf, 0.0, -1.0, 60.0]
    points, valid = points_in_base(scan, BASE_FROM_LASER, maximum_range=30.0)
    assert not valid[:5].any()
    assert valid[5:].mean() > 0.9
    assert np.allclose(points[valid][:, 2], BASE_FROM_LASER[2, 3])


def test_a_trajectory_interpolates_across_the_turn_of_pi() -> None:
    """Half-way between 175 and -175 degrees lies 180, not 0."""
    yaw = np.radians(175)
    trajectory = Trajectory(np.array([0, 10]), np.array([[0, 0, yaw], [1, 0, -yaw]]))
    assert abs(abs(trajectory.at(5).yaw) - np.pi) < 1e-9
