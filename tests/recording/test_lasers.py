"""Lasers of every habit: what they send where they see nothing, several echoes, several lasers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tablemap.geometry import Floats
from tablemap.recording import Recording, inspect, open_recording
from tests.making.messages import ROS2
from tests.making.rewriting import DIALECTS, Change, Dialect, Entry, edit, rewrite

SIGHT = 2.0
"""Metres that the rewritten laser sees; the room is larger."""


def short_sighted(says: Floats | float, *, range_max: float = SIGHT + 0.02) -> Change:
    """Let the laser see two metres, and send something else where it sees nothing."""

    def change(entry: Entry) -> Iterable[Entry]:
        if entry.type != "LaserScan":
            return [entry]
        ranges = entry.message.ranges.astype(np.float64)
        seen = ranges < SIGHT
        nothing = np.broadcast_to(says, ranges.shape)
        ranges = np.where(seen, ranges, nothing).astype(np.float32)
        return [edit(entry, ranges=ranges, range_max=range_max)]

    return change


def free(recording: Recording) -> Floats:
    """Return which beams of all scans saw nothing, (scans, beams)."""
    return np.array([np.isinf(scan.ranges) for scan in recording.scans()])


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_number_just_under_the_maximum(
    tmp_path: Path, plain_recording: Path, dialect: Dialect
) -> None:
    """A laser of 2.02 m that says 2.01 m sees nothing there, and it is said."""
    change = short_sighted(SIGHT + 0.01)
    path = rewrite(plain_recording, tmp_path / "r.mcap", change, dialect=dialect)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        (warning,) = recording.warnings
        assert warning.code == "recording.silent_sensor"
        assert "sends 2.01 m where it sees nothing" in warning.message
        true = np.array([~(scan.ranges < SIGHT) for scan in plain.scans()])
        assert np.array_equal(free(recording), true)


def test_each_beam_has_its_own_maximum(tmp_path: Path, plain_recording: Path) -> None:
    """Merged scans end at another range in each beam."""
    with open_recording(plain_recording) as plain:
        beams = len(next(plain.scans()).ranges)
    own = SIGHT + 0.4 * np.sin(np.linspace(0, 3, beams)) + 0.01
    path = rewrite(plain_recording, tmp_path / "r.mcap", short_sighted(own, range_max=30.0))
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        assert "sends 2.01 to 2.41 m by beam" in recording.warnings[0].message
        true = np.array([~(scan.ranges < SIGHT) for scan in plain.scans()])
        found = free(recording)
        assert not (found & ~true).any()
        # A beam that saw nothing only now and then shows no number of its own.
        assert found.sum() > 0.95 * true.sum()


@pytest.mark.parametrize("says", [np.inf, np.nan, 0.0, SIGHT + 1.0])
def test_what_the_message_declares_needs_no_learning(
    tmp_path: Path, plain_recording: Path, says: float
) -> None:
    """Infinity, NaN, zero and more than the maximum are understood without a word."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", short_sighted(says))
    with open_recording(path) as recording:
        assert recording.warnings == []


def test_walls_stay(plain_recording: Path, demo_recording: Path) -> None:
    """Nothing is taken off a laser that sends infinity, as in the simulated recordings."""
    for path in (plain_recording, demo_recording):
        with open_recording(path) as recording:
            assert recording.warnings == []


@pytest.mark.parametrize("dialect", ["ros1", "ros2"])
def test_several_echoes(tmp_path: Path, plain_recording: Path, dialect: Dialect) -> None:
    """Of a multi-echo scan the first echo is read; a beam without one saw nothing."""

    def echoed(entry: Entry) -> Iterable[Entry]:
        if entry.type != "LaserScan":
            return [entry]
        scan, get = entry.message, ROS2.types.__getitem__
        beams = [
            get("sensor_msgs/msg/LaserEcho")(
                echoes=np.array([r, r + 0.5] if np.isfinite(r) else [], dtype=np.float32)
            )
            for r in scan.ranges
        ]
        fields = {k: v for k, v in vars(scan).items() if k[0] != "_"}
        fields |= {"ranges": beams, "intensities": []}
        made = get("sensor_msgs/msg/MultiEchoLaserScan")(**fields)
        return [replace(entry, message=made)]

    path = rewrite(plain_recording, tmp_path / "r.mcap", echoed, dialect=dialect)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        assert recording.warnings == []
        for ours, theirs in zip(recording.scans(), plain.scans(), strict=True):
            assert np.array_equal(ours.ranges, theirs.ranges)
            assert np.allclose(ours.angles, theirs.angles)


def test_two_lasers(tmp_path: Path, plain_recording: Path) -> None:
    """Of two lasers on one base one is taken, and both are named."""

    def doubled(entry: Entry) -> Iterable[Entry]:
        yield entry
        if entry.type == "LaserScan":
            header = replace(entry.message.header, frame_id="base_link")
            yield replace(edit(entry, header=header), topic="/rear_scan")

    path = rewrite(plain_recording, tmp_path / "r.mcap", doubled)
    with open_recording(path) as recording:
        assert recording.names.laser == "base_range_sensor_link"
        (warning,) = recording.warnings
        assert warning.code == "recording.topic_choice"
        assert "/rear_scan" in warning.message
        assert "--set topics.laser=TOPIC" in warning.message
        assert warning in inspect(path).warnings


def test_a_laser_that_sends_clouds_alone_is_named(tmp_path: Path, plain_recording: Path) -> None:
    """Without a LaserScan the drive goes on without a laser, and what was not read is said."""
    get = ROS2.types.__getitem__

    def change(entry: Entry) -> Iterable[Entry]:
        if entry.type != "LaserScan":
            return [entry]
        ranges = np.nan_to_num(entry.message.ranges, posinf=9.0).astype("<f4")
        points = np.stack([ranges, 0 * ranges, 0 * ranges], axis=1)
        field = get("sensor_msgs/msg/PointField")
        cloud = get("sensor_msgs/msg/PointCloud2")(
            header=entry.message.header,
            height=1,
            width=len(points),
            fields=[field(name=n, offset=4 * i, datatype=7, count=1) for i, n in enumerate("xyz")],
            is_bigendian=False,
            point_step=12,
            row_step=12 * len(points),
            data=points.ravel().view(np.uint8),
            is_dense=True,
        )
        return [replace(entry, topic="/velodyne_points", message=cloud)]

    path = rewrite(plain_recording, tmp_path / "r.mcap", change)
    with open_recording(path) as recording:
        assert recording.names.laser is None
        (warning,) = recording.warnings
    assert warning.code == "recording.unread_cloud"
    assert "/velodyne_points" in warning.message
    assert warning in inspect(path).warnings
