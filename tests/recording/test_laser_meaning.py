"""A laser whose ranges or angles are in other units than metres and radians is read rightly."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tablemap.readiness import inspect
from tablemap.recording import Recording, open_recording
from tests.making.rewriting import Change, Entry, edit, rewrite

DEGREE = np.pi / 180.0


def scans(edited: Callable[[Any], dict[str, Any]]) -> Change:
    """Return what replaces fields of all scans."""

    def change(entry: Entry) -> Iterable[Entry]:
        return [edit(entry, **edited(entry.message)) if entry.type == "LaserScan" else entry]

    return change


def in_unit(unit: float, *, limits: bool = True) -> Change:
    """Send ranges in a unit of so many metres, with ``limits`` also the least and greatest."""

    def edited(scan: Any) -> dict[str, Any]:
        far = {"range_min": scan.range_min / unit, "range_max": scan.range_max / unit}
        return {"ranges": scan.ranges / np.float32(unit), **(far if limits else {})}

    return scans(edited)


def assert_same_scans(recording: Recording, plain: Recording) -> None:
    """Fail unless all scans are those of another recording, to a tenth of a millimetre."""
    for ours, theirs in zip(recording.scans(), plain.scans(), strict=True):
        np.testing.assert_allclose(ours.angles, theirs.angles, atol=1e-4)
        np.testing.assert_allclose(ours.ranges, theirs.ranges, atol=1e-4)
        assert ours.range_max == pytest.approx(theirs.range_max)


@pytest.mark.parametrize(
    ("change", "unit"),
    [
        (in_unit(0.001), "millimetres"),
        (in_unit(0.001, limits=False), "millimetres"),
        (in_unit(0.01), "centimetres"),
        (in_unit(0.0254), "inches"),
    ],
)
def test_ranges_in_another_unit(
    tmp_path: Path, plain_recording: Path, change: Change, unit: str
) -> None:
    """The robot's motion tells the unit; scans come out in metres, and it is said."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", change)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        (warning,) = recording.warnings
        assert_same_scans(recording, plain)
    assert warning.code == "recording.laser_meaning"
    assert f"in {unit} they fit the robot's motion" in warning.message
    (laser,) = [each for each in inspect(path).fitness if each.role == "laser"]
    assert laser.state != "missing"


@pytest.mark.parametrize(
    "wrong",
    [
        {"angle_min", "angle_max", "angle_increment"},
        {"angle_increment"},
        {"angle_min", "angle_max"},
    ],
)
def test_angles_in_degrees(tmp_path: Path, plain_recording: Path, wrong: set[str]) -> None:
    """No laser goes round more than once: angles that would are degrees, and it is said."""
    change = scans(lambda scan: {name: getattr(scan, name) / DEGREE for name in wrong})
    path = rewrite(plain_recording, tmp_path / "r.mcap", change)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        (warning,) = recording.warnings
        assert_same_scans(recording, plain)
    assert warning.code == "recording.laser_meaning"
    assert all(name in warning.message for name in wrong)


def test_no_angle_between_beams(tmp_path: Path, plain_recording: Path) -> None:
    """An angle_increment of zero follows from the first and the last angle."""
    change = scans(lambda scan: {"angle_increment": 0.0})
    path = rewrite(plain_recording, tmp_path / "r.mcap", change)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        assert [warning.code for warning in recording.warnings] == ["recording.laser_meaning"]
        for ours, theirs in zip(recording.scans(), plain.scans(), strict=True):
            np.testing.assert_allclose(ours.angles, theirs.angles, atol=2 * theirs.angle_increment)


def test_intensities_are_no_ranges(tmp_path: Path, plain_recording: Path) -> None:
    """Numbers that fit the motion in no unit are no distances: the laser is left out."""
    change = scans(lambda scan: {"ranges": np.float32(3000) / (scan.ranges + np.float32(0.1))})
    path = rewrite(plain_recording, tmp_path / "r.mcap", change)
    with open_recording(path) as recording:
        assert recording.names.laser is None
        (warning,) = recording.warnings
    assert "in no unit do they fit the robot's motion: it was not used" in warning.message
