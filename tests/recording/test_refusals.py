"""What cannot be processed is refused with its cause, the same by ``info`` as by ``process``."""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tablemap.config import SensorsConfig, SnapshotsConfig, TopicsConfig
from tablemap.errors import EstimationError, RecordingError
from tablemap.recording import inspect, open_recording
from tablemap.stages.snapshots import take_snapshots
from tests.making.command import tablemap
from tests.making.rewriting import (
    DIALECTS,
    SECOND,
    Change,
    Dialect,
    Entry,
    depth_of,
    edit,
    rewrite,
    with_depth,
    with_edges,
)

CAMERA = "head_rgbd_sensor_rgb_frame"


def assert_refused(path: Path, *says: str) -> str:
    """Check that opening fails with these words, and that ``info`` says the same."""
    with pytest.raises(RecordingError) as refused:
        open_recording(path)
    sentence = str(refused.value)
    for words in says:
        assert re.search(words, sentence), sentence
    assert sentence in inspect(path).missing
    return sentence


def without_topic(name: str) -> Change:
    """Leave a topic out."""
    return lambda entry: [] if entry.topic == name else [entry]


def with_transforms(change: Callable[[object], None], *children: str) -> Change:
    """Change the transforms to some frames in place."""

    def changed(entry: Entry) -> Iterable[Entry]:
        if entry.type == "TFMessage":
            message = copy.deepcopy(entry.message)
            for each in message.transforms:
                if each.child_frame_id in children:
                    change(each)
            entry = replace(entry, message=message)
        return [entry]

    return changed


@pytest.mark.parametrize("dialect", ["ros1", "ros2"])
def test_a_later_file_of_a_split_recording(
    tmp_path: Path, plain_recording: Path, dialect: Dialect
) -> None:
    """Without /tf_static the refusal names it, and the ways out."""
    path = rewrite(
        plain_recording, tmp_path / "r.mcap", without_topic("/tf_static"), dialect=dialect
    )
    assert_refused(path, "no message on /tf_static", "--together FIRST THIS", "topics.extrinsics")


def zeros(transform: object) -> None:
    """Set a transform's quaternion to zeros, as a node that was not set up sends it."""
    turn = transform.transform.rotation  # type: ignore[attr-defined]
    turn.x = turn.y = turn.z = turn.w = 0.0


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_quaternion_of_zeros(tmp_path: Path, plain_recording: Path, dialect: Dialect) -> None:
    """The rejected transform is named by its edge and count, where it is the cause."""
    with open_recording(plain_recording) as plain:
        parent = plain.tree.edges[CAMERA][0].parent
    change = with_transforms(zeros, CAMERA)
    path = rewrite(plain_recording, tmp_path / "r.mcap", change, dialect=dialect)
    assert_refused(path, rf"\d+ transforms from {parent} to {CAMERA} \(a quaternion of zeros\)")


@pytest.mark.parametrize("dialect", DIALECTS)
def test_no_optical_frame(tmp_path: Path, plain_recording: Path, dialect: Dialect) -> None:
    """Where TF has the camera's body and not its optical frame, both are named."""

    def renamed(transform: object) -> None:
        transform.child_frame_id = "head_rgbd_sensor_link"  # type: ignore[attr-defined]

    change = with_transforms(renamed, CAMERA)
    path = rewrite(plain_recording, tmp_path / "r.mcap", change, dialect=dialect)
    assert_refused(path, f"'{CAMERA}' is not", "'head_rgbd_sensor_link' seems", "extrinsics=FILE")


def test_images_without_a_frame(tmp_path: Path, plain_recording: Path) -> None:
    """An empty frame_id is called that."""

    def nameless(entry: Entry) -> Iterable[Entry]:
        if entry.is_depth or entry.type == "CameraInfo":
            return [edit(entry, header=replace(entry.message.header, frame_id=""))]
        return [entry]

    path = rewrite(plain_recording, tmp_path / "r.mcap", nameless)
    assert_refused(path, "name no frame", "frame_id")


def test_a_unit_without_a_floor(tmp_path: Path, plain_recording: Path) -> None:
    """Metres that are millimetres are said where no floor tells, also by a later failure."""

    def ahead(entry: Entry) -> Iterable[Entry]:
        if not entry.is_depth:
            return [entry]
        values = depth_of(entry)
        values[values.shape[0] // 4 :] = 0
        return [with_depth(entry, values.astype(np.float32), encoding="32FC1")]

    path = rewrite(plain_recording, tmp_path / "r.mcap", ahead)
    with open_recording(path) as recording:
        (warning,) = (w for w in recording.warnings if w.code == "accuracy.depth_meaning")
    assert re.search(r"is \d{4} m in the middle", warning.message)
    assert "topics.depth_unit=0.001" in warning.message
    assert warning in inspect(path).warnings
    done = tablemap("process", path, "-o", tmp_path / "runs", "--review", "off", "-q")
    assert done.returncode == 1
    assert "This may be why: The depth on" in done.stderr
    with open_recording(path, topics=TopicsConfig(depth_unit=0.001)) as recording:
        assert not [w for w in recording.warnings if w.code == "accuracy.depth_meaning"]


def test_images_without_a_pose_of_the_camera(tmp_path: Path, plain_recording: Path) -> None:
    """They are said to have no pose, and never that they could not be decoded."""

    def early(entry: Entry) -> Iterable[Entry]:
        if entry.type != "TFMessage" or entry.topic == "/tf_static":
            return [entry]

        def kept(parent: str, child: str, stamp_ns: int, pose: object) -> object:
            return None if child == CAMERA and stamp_ns > first_ns + 2 * SECOND else pose

        changed = with_edges(entry, kept)  # type: ignore[arg-type]
        return [] if changed is None else [changed]

    with open_recording(plain_recording) as plain:
        first_ns = plain.start_ns
    path = rewrite(plain_recording, tmp_path / "r.mcap", early)
    with open_recording(path) as recording:
        stamps = recording.depth_stamps()
        try:
            taken = take_snapshots(recording, config=SnapshotsConfig(), sensors=SensorsConfig())
            reasons = {entry.reason for entry in taken.set_aside}
        except EstimationError as error:
            reasons = {str(error)}
    assert len(stamps) == 8
    assert any(f"no pose of '{CAMERA}'" in reason for reason in reasons)
    assert not any("decoded" in reason for reason in reasons)


def test_a_pointer_of_git_lfs(tmp_path: Path) -> None:
    """A clone without LFS has pointers in the files' places."""
    path = tmp_path / "lap.mcap"
    path.write_text(
        f"version https://git-lfs.github.com/spec/v1\noid sha256:{'4d7a' * 16}\nsize 30260553\n"
    )
    with pytest.raises(RecordingError, match="git lfs pull"):
        open_recording(path)


def test_every_line_of_a_batch_names_its_recording(tmp_path: Path, plain_recording: Path) -> None:
    """One that lacks something and one that is none: both sentences say whose they are."""
    lacking = rewrite(plain_recording, tmp_path / "lacking.mcap", without_topic("/tf_static"))
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(b"")
    done = tablemap("process", lacking, broken, "-o", tmp_path / "runs", "-q")
    assert done.returncode == 1
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 2
    assert "lacking.mcap" in lines[0]
    assert "broken.mcap" in lines[1]
