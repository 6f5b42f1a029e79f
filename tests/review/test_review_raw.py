"""The raw log of a recording in the viewer: what each sensor said, of every container."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from rerun.chunk import RrdReader

from tablemap.config import TopicsConfig
from tablemap.errors import RecordingError
from tablemap.review.raw import write_raw
from tablemap.review.viewer import viewer
from tests.making import messages as w
from tests.making.command import tablemap_here
from tests.making.reviews import columns

DEPTH = "/head_rgbd_sensor/depth_registered/image_rect_raw"
SCANS = 10 * (w.IMAGES - 1) + 1


def entities(path: Path) -> set[str]:
    """The entities of an .rrd."""
    return {chunk.entity_path for chunk in RrdReader(path).stream()}


def with_inertia(recorder: w.RosRecorder, stamp_ns: int) -> None:
    """Write depth, and a message that processing does not read."""
    w.raw_depth(recorder, stamp_ns)
    vector, turn = (
        recorder.type(f"geometry_msgs/msg/{name}") for name in ("Vector3", "Quaternion")
    )
    message = recorder.type("sensor_msgs/msg/Imu")(
        header=recorder.header(stamp_ns, "base_link"),
        orientation=turn(0.0, 0.0, 0.0, 1.0),
        orientation_covariance=np.zeros(9),
        angular_velocity=vector(0.0, 0.0, 0.1),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vector(0.0, 0.0, 9.8),
        linear_acceleration_covariance=np.zeros(9),
    )
    recorder.write("/imu", "sensor_msgs/msg/Imu", message, stamp_ns)


@pytest.mark.parametrize("version", [1, 2])
def test_what_our_readers_know_is_drawn(version: int, tmp_path: Path) -> None:
    """Depth to scale with its camera, scans as points, colour, and frames, of ROS 1 and 2."""
    recording = tmp_path / "lap.mcap"
    w.write_drive(recording, version=version)
    file, warnings = write_raw(recording, tmp_path)
    assert warnings == []
    (first, *_), *rest = columns(file, f"{DEPTH}/image", "EncodedDepthImage:blob")
    assert len(rest) == w.IMAGES - 1
    with PIL.Image.open(io.BytesIO(bytes(first))) as image:  # type: ignore[call-overload]
        assert np.array_equal(np.asarray(image), w.millimetres())
    assert columns(file, f"{DEPTH}/image", "EncodedDepthImage:meter")[0] == [1000.0]
    assert columns(file, DEPTH, "Pinhole:parent_frame") == [[w.CAMERA]]
    points = columns(file, "/base_scan", "Points3D:positions")
    assert len(points) == SCANS
    assert len(points[0]) == 31
    assert "/head_rgbd_sensor/rgb/image_rect_color/image" in entities(file)
    assert columns(file, "/tf/odom", "Transform3D:parent_frame") == [["map"]] * SCANS
    assert columns(file, f"/tf/{w.LASER}", "Transform3D:parent_frame") == [["base_link"]]


def test_other_topics_are_left_to_rerun_s_importer(tmp_path: Path) -> None:
    """In the same recording of the viewer; what we draw is not drawn twice."""
    recording = tmp_path / "lap.mcap"
    w.write_drive(recording, depth=with_inertia)
    file, _ = write_raw(recording, tmp_path)
    assert "/imu" in entities(file)
    assert len(columns(file, "/base_scan", "Points3D:positions")) == SCANS
    assert viewer.is_whole(file)
    assert not any("camera_info" in entity for entity in entities(file))


def cut_short(recorder: w.RosRecorder, stamp_ns: int) -> None:
    """Write depth whose PNG lacks its end."""
    recorder.compressed(DEPTH, stamp_ns, w.png(w.millimetres())[:200], "16UC1; png")


def test_what_cannot_be_drawn_is_said(tmp_path: Path) -> None:
    """In the log, once for all messages of a kind; all else is shown."""
    recording = tmp_path / "lap.mcap"
    w.write_drive(recording, depth=cut_short)
    file, _ = write_raw(recording, tmp_path)
    ((said,),) = columns(file, "/log", "TextLog:text")
    assert str(said).startswith(f"{w.IMAGES} messages not shown: {DEPTH} ")
    assert len(columns(file, "/base_scan", "Points3D:positions")) == SCANS


def test_a_part_of_the_drive_is_shown(tmp_path: Path) -> None:
    """As ``process`` takes it."""
    recording = tmp_path / "lap.mcap"
    w.write_drive(recording)
    file, _ = write_raw(recording, tmp_path, topics=TopicsConfig(start="1.95", end="3.05"))
    assert len(columns(file, f"{DEPTH}/image", "EncodedDepthImage:blob")) == 2


def test_a_recording_without_messages_is_refused(tmp_path: Path) -> None:
    """In one sentence."""
    recording = tmp_path / "lap.mcap"
    recording.write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(RecordingError, match="with messages"):
        write_raw(recording, tmp_path)


def test_the_command_tells_runs_from_recordings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A recording's raw log is opened; a part of a run is wrong usage."""
    w.write_drive(tmp_path / "lap.mcap")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "run.rrd").write_bytes(b"RRF2 and no end")
    opened: list[Path] = []
    monkeypatch.setattr(viewer, "open_viewer", opened.append)
    done = tablemap_here("view", "lap.mcap", "--start", "1", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert opened[0].name == "lap.rrd"
    assert len(columns(opened[0], "/base_scan", "Points3D:positions")) == SCANS - 10
    done = tablemap_here("view", "run", "--start", "1", cwd=tmp_path)
    assert done.returncode == 2
    assert "go with a recording" in done.stderr
    assert len(opened) == 1
