"""Topics are found by what they carry; what is missing is said, with what to do."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tablemap.config import TopicsConfig
from tablemap.errors import RecordingError
from tablemap.recording import inspect, open_recording, sha256
from tests.making import messages as w

CONFIDENCE = "/head_rgbd_sensor/confidence/image_raw"


def with_others(recorder: w.RosRecorder, stamp_ns: int) -> None:
    """Write depth, raw and encoded, and images that look like depth and are none."""
    w.raw_depth(recorder, stamp_ns)
    data = bytes(12) + w.png(w.millimetres())
    recorder.compressed(f"{w.PREFIX}/image_rect_raw/compressedDepth", stamp_ns, data, "16UC1")
    recorder.image("/head_rgbd_sensor/ir/image_raw", stamp_ns, w.millimetres(), "mono16")
    recorder.image(CONFIDENCE, stamp_ns, w.millimetres(), "16UC1")


def with_hand_camera(recorder: w.RosRecorder, stamp_ns: int) -> None:
    """Write a second depth camera, with its calibration."""
    w.raw_depth(recorder, stamp_ns)
    recorder.image(
        "/hand_camera/depth/image", stamp_ns, w.millimetres(), "16UC1", frame="hand_frame"
    )
    recorder.camera_info("/hand_camera/depth/camera_info", stamp_ns, frame="hand_frame")


def write(tmp_path: Path, depth: Callable[[w.RosRecorder, int], None] | None = None) -> Path:
    """Write a drive with other images."""
    path = tmp_path / "drive.mcap"
    w.write_drive(path, depth=depth)
    return path


def test_raw_depth_of_one_camera_is_chosen_without_a_warning(tmp_path: Path) -> None:
    """Infrared and confidence are no depth, and an encoded copy is no second camera."""
    with open_recording(write(tmp_path, with_others)) as recording:
        assert recording.roles.depth is not None
        assert recording.roles.depth.name == f"{w.PREFIX}/image_rect_raw"
        assert recording.roles.colour is not None
        assert "rgb" in recording.roles.colour.name
        assert recording.warnings == []


def test_choice_between_cameras_is_said_and_can_be_set(tmp_path: Path) -> None:
    """The head's camera is taken; the warning names the other, which the setting takes."""
    path = write(tmp_path, with_hand_camera)
    with open_recording(path) as recording:
        assert recording.roles.depth is not None
        assert recording.roles.depth.name.startswith(w.PREFIX)
        (warning,) = recording.warnings
        assert warning.code == "recording.topic_choice"
        assert "/hand_camera/depth/image" in warning.message
    info = inspect(path, topics=TopicsConfig(depth="/hand_camera/depth/image"))
    roles = {topic.role: topic.name for topic in info.topics if topic.role != "transforms"}
    assert roles["depth"] == "/hand_camera/depth/image"
    assert roles["calibration"] == "/hand_camera/depth/camera_info"
    assert any("hand_frame" in text for text in info.missing)


def test_unknown_topic_names_the_near_ones(tmp_path: Path) -> None:
    """A typing error is answered with what was probably meant."""
    with pytest.raises(RecordingError, match=r"did you mean .*image_rect_raw"):
        open_recording(
            write(tmp_path, w.raw_depth), topics=TopicsConfig(depth=f"{w.PREFIX}/image_rect_row")
        )


def test_topic_that_cannot_play_its_role_is_refused(tmp_path: Path) -> None:
    """A laser scan is no depth."""
    with pytest.raises(RecordingError, match="cannot be taken for depth"):
        open_recording(write(tmp_path, w.raw_depth), topics=TopicsConfig(depth="/base_scan"))


def test_missing_parts_are_said_with_the_topics_that_are_there(tmp_path: Path) -> None:
    """Without depth, and without transforms, the sentence says so and lists the topics."""
    path = write(tmp_path, lambda recorder, stamp_ns: None)
    with pytest.raises(RecordingError, match=r"No topic with depth.*/base_scan"):
        open_recording(path)
    no_tf = tmp_path / "no_tf.mcap"
    w.write_drive(no_tf, transforms=False)
    with pytest.raises(RecordingError, match="No poses were found"):
        open_recording(no_tf)
    no_calibration = tmp_path / "no_calibration.mcap"
    w.write_drive(no_calibration, calibration=lambda recorder, stamp_ns: None)
    with pytest.raises(RecordingError, match="No calibration"):
        open_recording(no_calibration)
    info = inspect(no_calibration)
    assert len(info.missing) == 1
    assert not info.to_dict()["processable"]


@pytest.mark.parametrize(
    ("k", "size", "says"),
    [
        ([70.0, 0, 0, 0, 70, 0, 0, 0, 1], (80, 60), "principal point"),
        ([0.0, 0, 39.5, 0, 0, 29.5, 0, 0, 1], (80, 60), "focal"),
        ([-70.0, 0, 39.5, 0, 70, 29.5, 0, 0, 1], (80, 60), "focal"),
        ([float("nan"), 0, 39.5, 0, 70, 29.5, 0, 0, 1], (80, 60), "focal"),
        (w.K, (80, 80), "no enlargement"),
    ],
)
def test_impossible_calibration_is_refused(
    tmp_path: Path, k: list[float], size: tuple[int, int], says: str
) -> None:
    """What some simulators publish (cx = cy = 0) is no calibration."""
    path = tmp_path / "drive.mcap"
    w.write_drive(
        path,
        calibration=lambda r, t: r.camera_info(f"{w.PREFIX}/camera_info", t, k=k, size=size),
    )
    with pytest.raises(RecordingError, match=says):
        open_recording(path)
    assert any(says in text for text in inspect(path).missing)


def test_calibration_of_a_larger_image_is_scaled(tmp_path: Path) -> None:
    """Half the size has half the focal length, and its centre stays the centre."""
    path = tmp_path / "drive.mcap"
    k = [140.0, 0, 79.5, 0, 140.0, 59.5, 0, 0, 1]
    w.write_drive(
        path,
        calibration=lambda r, t: r.camera_info(f"{w.PREFIX}/camera_info", t, k=k, size=(160, 120)),
    )
    with open_recording(path) as recording:
        frame = next(recording.depth_frames())
        assert np.allclose(frame.k, np.reshape(w.K, (3, 3)))


def test_info_tells_topics_rates_and_tree(tmp_path: Path) -> None:
    """What `tablemap info` shows: roles, counts, rates, frames; and it survives JSON."""
    info = inspect(write(tmp_path, with_others))
    by_name = {topic.name: topic for topic in info.topics}
    scan = by_name["/base_scan"]
    assert (scan.role, scan.count) == ("laser", 51)
    assert scan.rate_hz == pytest.approx(10.0)
    assert by_name[CONFIDENCE].role is None
    assert info.duration_s == pytest.approx(5.0)
    assert info.missing == ()
    assert info.tree_lines()[:3] == ["map", "  odom", "    base_footprint"]
    assert json.loads(json.dumps(info.to_dict()))["processable"] is True


def test_sha256_is_that_of_the_bytes(tmp_path: Path) -> None:
    """The well-known hash of "abc"."""
    path = tmp_path / "abc"
    path.write_bytes(b"abc")
    assert sha256(path).startswith("ba7816bf8f01cfea")


def test_real_recordings(real_recordings: Path) -> None:
    """Both are read whole: 200 images of a hand-held Kinect (ROS 2), 6 of an HSR (ROS 1)."""
    for name, images, base in (("kitchen", 200, "map"), ("hsr_living_room", 6, "map")):
        path = real_recordings / f"{name}.mcap"
        info = inspect(path)
        assert info.missing == ()
        with open_recording(path) as recording:
            assert recording.names.fixed == base
            assert recording.warnings == []
            stamps = recording.depth_stamps()
            assert len(stamps) == images
            assert recording.fixed_from_bases(stamps)[1].all()
            first = next(recording.depth_frames(stamps[2:3]))
            assert first.depth.shape == (480, 640)
            assert 0.3 < np.nanmedian(first.depth) < 4.0
            assert len(recording.colour_near(stamps)) == images
