"""Sensors whose frames have another prefix than in TF, and frames that nobody knows."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest

from tablemap.errors import RecordingError
from tablemap.recording import open_recording
from tests.making.messages import ROS2
from tests.making.rewriting import Change, Entry, reframed, rewrite

OWN = "head_rgbd_sensor_rgb_frame"


def renamed(name: Callable[[str], str], *, in_tf: bool) -> Change:
    """Rename the frames of TF, or those of the sensors' messages."""

    def change(entry: Entry) -> Iterable[Entry]:
        return [reframed(entry, name) if (entry.type == "TFMessage") == in_tf else entry]

    return change


@pytest.mark.parametrize("in_tf", [True, False])
def test_a_prefix_that_one_side_lacks(tmp_path: Path, plain_recording: Path, in_tf: bool) -> None:
    """Camera and laser are the frames of TF that have the same name behind a prefix."""
    change = renamed(lambda frame: f"rb7/{frame}", in_tf=in_tf)
    path = rewrite(plain_recording, tmp_path / "r.mcap", change)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        stamps = recording.depth_stamps()
        assert recording.names.laser is not None
        assert {each.code for each in recording.warnings} == {"recording.frame_name"}
        assert len(recording.warnings) == 2
        ours, theirs = (each.base_from_cameras(stamps) for each in (recording, plain))
        scanned = [each.base_from_laser(each.start_ns) for each in (recording, plain)]
    assert ours[1].all()
    np.testing.assert_allclose(ours[0], theirs[0], atol=1e-9)
    np.testing.assert_allclose(*scanned, atol=1e-9)


def test_two_namesakes_are_told_apart_by_the_topic_alone(
    tmp_path: Path, plain_recording: Path
) -> None:
    """Of ``r1/camera`` and ``r2/camera`` none is taken for a camera of neither namespace."""

    def change(entry: Entry) -> Iterable[Entry]:
        if entry.type == "TFMessage":
            yield reframed(entry, lambda frame: f"r2/{frame}")
            yield reframed(entry, lambda frame: f"r1/{frame}")
        else:
            yield entry

    path = rewrite(plain_recording, tmp_path / "r.mcap", change)
    with pytest.raises(RecordingError, match=f"{OWN}' is not in the TF tree"):
        open_recording(path)


def test_a_joint_that_nobody_knows_is_no_damage(tmp_path: Path, plain_recording: Path) -> None:
    """A gripper whose place is NaN in every message says nothing of the file."""
    get = ROS2.types.__getitem__

    def change(entry: Entry) -> Iterable[Entry]:
        if entry.type == "TFMessage" and len(entry.message.transforms) > 1:
            entry = copy.deepcopy(entry)
            unknown = copy.deepcopy(entry.message.transforms[0])
            unknown.header.frame_id, unknown.child_frame_id = "base_link", "gripper"
            unknown.transform.translation = get("geometry_msgs/msg/Vector3")(*3 * [float("nan")])
            entry.message.transforms.append(unknown)
        yield entry

    path = rewrite(plain_recording, tmp_path / "r.mcap", change)
    with open_recording(path) as recording:
        assert recording.warnings == []
        assert recording._channels.collector.never_valid.total() > 100
        assert "gripper" not in recording.tree.frames
