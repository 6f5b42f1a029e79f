"""A laser that TF has turned, upside down or elsewhere is told by the motion of the wheels."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from tablemap.geometry import Pose2, invert
from tablemap.readiness import inspect
from tablemap.recording import open_recording
from tests.making.rewriting import Change, Entry, edit, rewrite, with_edges

LASER = "base_range_sensor_link"


def mounted(turn_deg: float = 0.0, *, ahead: float = 0.0) -> Change:
    """Return what puts the laser elsewhere in TF."""

    def moved(_: str, child: str, __: int, pose: Pose2) -> Pose2:
        turned = Pose2(pose.x + ahead, pose.y, pose.yaw + np.radians(turn_deg))
        return turned if child == LASER else pose

    def change(entry: Entry) -> Iterable[Entry]:
        changed = with_edges(entry, moved) if entry.type == "TFMessage" else entry
        return [] if changed is None else [changed]

    return change


def reversed_beams(entry: Entry) -> Iterable[Entry]:
    """Send the beams the other way round, as of a laser that hangs upside down."""
    if entry.type != "LaserScan":
        return [entry]
    return [edit(entry, ranges=entry.message.ranges[::-1].copy())]


@pytest.mark.parametrize("turn_deg", [8.0, 90.0, 180.0])
def test_a_turned_laser_is_turned_back(
    tmp_path: Path, plain_recording: Path, turn_deg: float
) -> None:
    """Its pose is that of the plain recording to a degree, its place is TF's, and it is said."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", mounted(turn_deg))
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        (warning,) = recording.warnings
        theirs, ours = (each.base_from_laser(each.start_ns) for each in (plain, recording))
    assert warning.code == "accuracy.laser_mounting"
    assert f"to the right by {turn_deg:.0f} degrees" in warning.message
    assert f"the transform from base_footprint to {LASER}" in warning.message
    np.testing.assert_allclose(ours[:3, 3], theirs[:3, 3], atol=1e-9)
    off = invert(theirs) @ ours
    assert abs(np.degrees(np.arctan2(off[1, 0], off[0, 0]))) < 1.0


def test_a_laser_whose_beams_run_the_other_way(tmp_path: Path, plain_recording: Path) -> None:
    """It is taken as hanging upside down, which puts its beams where they were."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", reversed_beams)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        (warning,) = recording.warnings
        theirs, ours = (each.base_from_laser(each.start_ns) for each in (plain, recording))
    assert "upside down (or its beams run the other way round)" in warning.message
    np.testing.assert_allclose(ours, theirs @ np.diag([1.0, -1, -1, 1]), atol=0.02)


def test_a_laser_elsewhere_is_said_and_left(tmp_path: Path, plain_recording: Path) -> None:
    """Wheels that misjudge distances look alike: info and the verdict say it, the pose stays."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", mounted(ahead=0.2))
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        (warning,) = recording.warnings
        theirs, ours = (each.base_from_laser(each.start_ns) for each in (plain, recording))
    assert warning.code == "accuracy.laser_mounting"
    assert "m further back than TF says" in warning.message
    np.testing.assert_allclose(ours[:3, :3], theirs[:3, :3], atol=1e-9)
    np.testing.assert_allclose(ours[:2, 3] - theirs[:2, 3], [0.2, 0.0], atol=1e-9)
    (laser,) = [each for each in inspect(path).fitness if each.role == "laser"]
    assert laser.state == "weak"
    assert warning.message in laser.says
