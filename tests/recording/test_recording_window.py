"""A part of a drive is read as a drive of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tablemap.config import TopicsConfig, load_config
from tablemap.errors import ConfigError, RecordingError
from tablemap.recording import inspect, open_recording
from tests.making import messages as w


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of 5 s, its first calibration and its static transforms at its begin alone."""
    path = tmp_path_factory.mktemp("window") / "drive.mcap"

    def calibration(recorder: w.RosRecorder, stamp_ns: int) -> None:
        if stamp_ns == w.START_NS:
            recorder.camera_info(f"{w.PREFIX}/camera_info", stamp_ns)

    w.write_drive(path, calibration=calibration)
    return path


@pytest.mark.parametrize(
    ("start", "end"),
    [
        ("1.5", "3.2"),
        ("-3.5", "-1.8"),
        (f"{(w.START_NS + 1.5e9) / 1e9:.1f}", f"{(w.START_NS + 3.2e9) / 1e9:.1f}"),
        ("2023-11-14T22:13:21.500", "2023-11-14T23:13:23.200000+01:00"),
    ],
)
def test_window_is_named_by_seconds_or_dates(drive: Path, start: str, end: str) -> None:
    """What was published once, before it, is read all the same; its counts are its own."""
    topics = load_config(overrides=[f"topics.start={start}", f"topics.end={end}"]).topics
    info = inspect(drive, topics=topics)
    assert not info.missing
    assert info.duration_s == pytest.approx(1.7)
    assert {topic.name: topic.count for topic in info.topics}["/base_scan"] == 18
    with open_recording(drive, topics=topics) as recording:
        stamps = [w.START_NS + 2 * w.SECOND, w.START_NS + 3 * w.SECOND]
        assert recording.depth_stamps().tolist() == stamps
        assert [frame.stamp_ns for frame in recording.depth_frames()] == stamps
        assert len(list(recording.scans())) == 18
        assert recording.fixed_from_bases(np.array(stamps))[1].all()
        assert recording.fixed_from_base(w.START_NS + w.SECOND) is None
        assert recording.warnings == []


def test_one_end_may_be_left_open(drive: Path) -> None:
    """From a moment on, or up to one."""
    with open_recording(drive, topics=TopicsConfig(start="3")) as recording:
        assert len(recording.depth_stamps()) == 3
    with open_recording(drive, topics=TopicsConfig(end="3")) as recording:
        assert len(recording.depth_stamps()) == 4


def test_window_without_messages_says_when_the_drive_was(drive: Path) -> None:
    """A typing error in the date, say."""
    with pytest.raises(RecordingError, match=r"begins at 2023-11-14T22:13:20.* lasts 5\.0 s"):
        open_recording(drive, topics=TopicsConfig(start="7"))


def test_what_is_no_moment_is_refused() -> None:
    """With what is expected."""
    with pytest.raises(ConfigError, match=r"topics\.start = 'soon' .*expected seconds, or a date"):
        load_config(overrides=["topics.start=soon"])
