"""A converted recording is whole, holds what processing needs, and says what the original said."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from tablemap.config import TopicsConfig
from tablemap.errors import RecordingError
from tablemap.recording import convert, inspect, open_recording
from tablemap.recording.carried import carried_warnings
from tablemap.recording.sources import open_source
from tests.making import hostile
from tests.making import messages as w
from tests.making.command import tablemap
from tests.making.drives import check_drive, copy_to_bag, copy_to_bag2, seconds


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """The drive, with an infrared camera that nothing needs."""
    path = tmp_path / "source.mcap"

    def depth(recorder: w.RosRecorder, stamp_ns: int) -> None:
        w.raw_depth(recorder, stamp_ns)
        recorder.image("/head_rgbd_sensor/ir/image_raw", stamp_ns, w.millimetres(), "mono16")

    w.write_drive(path, depth=depth)
    return path


def ros1_bag(tmp_path: Path) -> Path:
    """Return the drive as a bag of ROS 1."""
    w.write_drive(tmp_path / "ros1.mcap", version=1)
    copy_to_bag(tmp_path / "ros1.mcap", tmp_path / "drive.bag")
    return tmp_path / "drive.bag"


@pytest.mark.parametrize("form", ["mcap", "bag", "packed database", "files"])
def test_copy_of_every_form_is_a_whole_mcap_of_the_drive(
    tmp_path: Path, source: Path, form: str
) -> None:
    """By mcap's own reader: indexed chunks in zstd, checksums, complete schemas; no other topic."""
    given: Path | list[Path] = source
    if form == "bag":
        given = ros1_bag(tmp_path)
    elif form == "packed database":
        given = tmp_path / "bag"
        packed = {"storage": StoragePlugin.SQLITE3, "compression": CompressionMode.MESSAGE}
        copy_to_bag2(source, given, **packed)  # type: ignore[arg-type]
    elif form == "files":
        parts = (seconds(0, 2.3), seconds(2.3, 9))
        given = [copy_to_bag2(source, tmp_path / f"b{i}", keep=k) for i, k in enumerate(parts)]
    done = convert(given, tmp_path / "out" / "copy.mcap")
    assert done.warnings == ()
    with open_recording(done.path) as recording:
        check_drive(recording)
        assert len(recording.colour_near(recording.depth_stamps())) == w.IMAGES
    with done.path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}
        assert all(chunk.message_index_offsets for chunk in summary.chunk_indexes)
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            assert schema.data
            assert channel.message_encoding == "json" or message.data[:4] != b"\x28\xb5\x2f\xfd"
    assert not any("/ir/" in topic for topic in done.topics)
    assert done.topics["/base_scan"] == 51


def test_colour_can_be_left_out_and_a_part_taken(tmp_path: Path, source: Path) -> None:
    """As with process, the static transforms and calibrations of all of the drive go along."""
    topics = TopicsConfig(start="1.5", end="3.2")
    done = convert(source, tmp_path / "copy.mcap", topics=topics, colour=False)
    assert not any("color" in topic for topic in done.topics)
    with open_recording(done.path) as recording:
        assert len(list(recording.depth_frames())) == 2
        assert recording.colour_near(recording.depth_stamps()) == {}


def test_what_is_said_of_the_original_is_said_of_the_copy(tmp_path: Path) -> None:
    """A choice between cameras, of which the copy has one, and a file that was cut short."""
    source = tmp_path / "source.mcap"

    def two_cameras(recorder: w.RosRecorder, stamp_ns: int) -> None:
        w.raw_depth(recorder, stamp_ns)
        image = (stamp_ns, w.millimetres(), "16UC1")
        recorder.image("/hand_camera/depth/image", *image, frame="hand_frame")
        recorder.camera_info("/hand_camera/depth/camera_info", stamp_ns, frame="hand_frame")

    w.write_drive(source, depth=two_cameras)
    source.write_bytes(source.read_bytes()[:-5000])
    copies = [tmp_path / "copy.mcap", tmp_path / "copy of the copy.mcap"]
    convert(source, copies[0])
    convert(copies[0], copies[1])
    with open_recording(source) as recording:
        said = recording.warnings
        frames = len(list(recording.depth_frames()))
    assert {each.code for each in said} == {"recording.truncated", "recording.topic_choice"}
    for copy in copies:
        with open_recording(copy) as recording:
            assert recording.warnings == said
            assert len(list(recording.depth_frames())) == frames
        assert list(inspect(copy).warnings) == said


def test_a_recording_is_never_written_over_itself(tmp_path: Path, source: Path) -> None:
    """Nor is anything left of a recording that cannot be processed."""
    before = source.read_bytes()
    with pytest.raises(RecordingError, match="another file"):
        convert(source, source)
    assert source.read_bytes() == before
    w.write_drive(tmp_path / "no_depth.mcap", depth=None)
    with pytest.raises(RecordingError, match="No topic with depth"):
        convert(tmp_path / "no_depth.mcap", tmp_path / "copy.mcap")
    assert not list(tmp_path.glob("*copy*"))


def test_command_prints_what_was_written(tmp_path: Path, source: Path) -> None:
    """As JSON for scripts."""
    output = tmp_path / "copy.mcap"
    done = tablemap("convert", source, "--output", output, "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["output"] == str(output)
    assert document["size_bytes"] == output.stat().st_size
    assert document["topics"]["/tf"] == 51


def claimed(**changed: object) -> bytes:
    """Return what a copy says of its original, in part changed."""
    usual = {"code": "legs.no_laser", "stage": "", "message": "x", "stamp_ns": None}
    return json.dumps({"warnings": [usual | changed]}).encode()


@pytest.mark.parametrize(
    "said",
    [
        b"[" * 100_000,
        b'{"warnings": [{}]}',
        b'{"warnings": [[]]}',
        b'{"warnings": ' + b"9" * 5000 + b"}",
        b" " * 2**21 + b'{"warnings": []}',
        b"\xff",
        b"null",
        claimed(code=[]),
        claimed(stamp_ns=float("inf")),
        claimed(message=1),
    ],
    ids=range(10),
)
def test_what_is_said_of_an_original_may_be_anything(tmp_path: Path, said: bytes) -> None:
    """A file that claims to be a copy is read as others are, and the damage is said."""
    path = tmp_path / "copy.mcap"
    hostile.one_topic(path, "tablemap.Converted", "jsonschema", b"{}", "json", said)
    (warning,) = carried_warnings(open_source(path, warnings=[]))
    assert "before the conversion cannot be read" in warning.message
