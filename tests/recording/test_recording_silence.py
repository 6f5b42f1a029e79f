"""Sensors that say nothing are done without, and refusals of damaged files say the damage."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tablemap.errors import EstimationError, RecordingError
from tablemap.pipeline import process
from tablemap.recording import inspect, open_recording
from tests.making import messages as w


def drive_with(path: Path, **fields: Any) -> Path:
    """Write the drive with a laser whose scans have these fields."""
    w.write_drive(path, scan_fields=fields)
    return path


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -1.0, 0.0, 99.0])
def test_a_laser_without_returns_is_no_laser(tmp_path: Path, value: float) -> None:
    """It is said, and nothing is expected of it."""
    ranges = np.full(31, value, np.float32)
    with open_recording(drive_with(tmp_path / "drive.mcap", ranges=ranges)) as recording:
        assert recording.names.laser is None
        assert list(recording.scans()) == []
        (warning,) = recording.warnings
        assert warning.code == "recording.silent_sensor"
        assert "/base_scan" in warning.message


def test_a_laser_that_sees_something_once_is_one(tmp_path: Path) -> None:
    """A few returns in one scan are enough."""
    ranges = np.full(31, np.inf, np.float32)
    ranges[3:9] = 2.0
    with open_recording(drive_with(tmp_path / "drive.mcap", ranges=ranges)) as recording:
        assert recording.names.laser == w.LASER
        assert recording.warnings == []


@pytest.mark.parametrize("seconds", [1e9, -1e9, np.nan, np.inf])
def test_beams_of_an_impossible_sweep_are_of_one_moment(tmp_path: Path, seconds: float) -> None:
    """The scans are kept, and what was not believed is said once."""
    path = drive_with(tmp_path / "drive.mcap", time_increment=seconds)
    with open_recording(path) as recording:
        assert {scan.time_increment for scan in recording.scans()} == {0.0}
        (warning,) = recording.warnings
        assert "time_increment" in warning.message


@pytest.mark.parametrize("field", ["angle_min", "angle_max", "angle_increment"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_scans_without_angles_are_left_out(tmp_path: Path, field: str, value: float) -> None:
    """As if there were no laser."""
    path = drive_with(tmp_path / "drive.mcap", **{field: value})
    assert any("no numbers" in (topic.problem or "") for topic in inspect(path).topics)
    with open_recording(path) as recording:
        assert list(recording.scans()) == []


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0, 0.0, 3e38])
def test_depth_that_shows_nothing_is_refused(tmp_path: Path, value: float) -> None:
    """In words, with the topic."""

    def depth(recorder: w.RosRecorder, stamp_ns: int) -> None:
        values = np.full((w.HEIGHT, w.WIDTH), value, np.float32)
        recorder.image(f"{w.PREFIX}/image_rect_raw", stamp_ns, values, "32FC1")

    path = tmp_path / "drive.mcap"
    w.write_drive(path, depth=depth)
    with pytest.raises(RecordingError, match="6 show nothing"):
        open_recording(path)


def test_a_refusal_of_a_damaged_recording_says_that_it_is_damaged(tmp_path: Path) -> None:
    """Whatever the refusal is about: what is missing may have been in what was lost."""
    whole, cut = tmp_path / "whole.mcap", tmp_path / "cut.mcap"
    w.write_drive(whole)
    with open_recording(whole) as recording, pytest.raises(EstimationError) as sound:
        process(recording)
    assert "damaged" not in str(sound.value)
    data = whole.read_bytes()
    cut.write_bytes(data[: len(data) // 2])
    with open_recording(cut) as recording, pytest.raises(EstimationError) as damaged:
        process(recording)
    assert "The recording is damaged, which may be why: The file was cut short" in str(
        damaged.value
    )
    cut.write_bytes(data[:2000])
    with pytest.raises(RecordingError, match="is damaged, which may be why"):
        open_recording(cut)
    assert all("is damaged" in sentence for sentence in inspect(cut).missing)
    assert inspect(cut).missing
