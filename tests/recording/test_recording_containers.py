"""Bags of ROS 1 and ROS 2, folders and several files give the same drive as an MCAP does."""

from __future__ import annotations

import contextlib
import itertools
import shutil
import sqlite3
import struct
from pathlib import Path

import pytest
import yaml
from mcap.writer import Writer
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from tablemap.config import LimitsConfig
from tablemap.errors import ProcessWarning, RecordingError
from tablemap.recording import inspect, open_recording
from tablemap.recording.bags.bag import Bag
from tests.making import messages as w
from tests.making.drives import Keep, check_drive, copy_to_bag, copy_to_bag2, seconds

Format = Rosbag1Writer.CompressionFormat


def drive(tmp_path: Path, *, version: int = 2) -> Path:
    """Write the drive as an MCAP that is to be copied."""
    path = tmp_path / "source.mcap"
    w.write_drive(path, version=version)
    return path


def codes(path: Path) -> list[str]:
    """Return the warnings' codes, after all images and scans were read."""
    with open_recording(path) as recording:
        list(recording.depth_frames())
        list(recording.scans())
        return [warning.code for warning in recording.warnings]


@pytest.mark.parametrize("compression", [None, Format.BZ2, Format.LZ4])
def test_bag_of_ros1(tmp_path: Path, compression: Format | None) -> None:
    """A bag of rosbags' writer is read, whatever its chunks are packed with."""
    path = tmp_path / "drive.bag"
    copy_to_bag(drive(tmp_path, version=1), path, compression=compression)
    info = inspect(path)
    assert (info.profile, info.missing, info.frames_sampled) == ("ros1", (), False)
    with open_recording(path) as recording:
        check_drive(recording)


@pytest.mark.parametrize(
    ("storage", "compression"),
    [
        (StoragePlugin.SQLITE3, CompressionMode.NONE),
        (StoragePlugin.SQLITE3, CompressionMode.FILE),
        (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, CompressionMode.NONE),
        (StoragePlugin.MCAP, CompressionMode.FILE),
        (StoragePlugin.MCAP, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, CompressionMode.STORAGE),
    ],
)
def test_folder_and_file_of_rosbag2(
    tmp_path: Path, storage: StoragePlugin, compression: CompressionMode
) -> None:
    """The folder, its metadata.yaml and its file alone all name the drive, however packed."""
    folder = tmp_path / "drive"
    file = copy_to_bag2(drive(tmp_path), folder, storage=storage, compression=compression)
    assert (file.suffix == ".zstd") == (compression is CompressionMode.FILE)
    for path in (folder, folder / "metadata.yaml", file):
        assert not inspect(path).missing
        with open_recording(path) as recording:
            check_drive(recording)


def split(tmp_path: Path, storage: StoragePlugin, *keeps: Keep) -> Path:
    """Write a folder of several files, as rosbag2 splits a drive."""
    source, folder = drive(tmp_path), tmp_path / "split"
    folder.mkdir()
    names = []
    for place, keep in enumerate(keeps):
        part = copy_to_bag2(source, tmp_path / f"part{place}", storage=storage, keep=keep)
        names.append(f"split_{place}{part.suffix}")
        shutil.copy(part, folder / names[-1])
    tree = yaml.safe_load((tmp_path / "part0" / "metadata.yaml").read_text())
    tree["rosbag2_bagfile_information"]["relative_file_paths"] = names
    (folder / "metadata.yaml").write_text(yaml.safe_dump(tree))
    return folder


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_split_folder_is_one_drive(tmp_path: Path, storage: StoragePlugin) -> None:
    """Three files, the last of which the metadata does not name any more."""
    folder = split(tmp_path, storage, seconds(0, 1.7), seconds(1.7, 3), seconds(3, 9))
    tree = yaml.safe_load((folder / "metadata.yaml").read_text())
    tree["rosbag2_bagfile_information"]["relative_file_paths"].pop()
    (folder / "metadata.yaml").write_text(yaml.safe_dump(tree))
    info = inspect(folder)
    assert {topic.name: topic.count for topic in info.topics}["/base_scan"] == 51
    with open_recording(folder) as recording:
        check_drive(recording)


def test_files_that_overlap_in_time_are_merged(tmp_path: Path) -> None:
    """Every second message is in the other file."""
    turns = itertools.cycle([True, False]), itertools.cycle([False, True])
    folder = split(tmp_path, StoragePlugin.MCAP, *((lambda _, t=t: next(t)) for t in turns))
    with open_recording(folder) as recording:
        check_drive(recording)
        log_times = [m.log_time_ns for m in recording.source.messages(recording.source.channels)]
        assert len(log_times) == 121
        assert log_times == sorted(log_times)


def test_part_that_is_gone_or_damaged_is_said(tmp_path: Path) -> None:
    """The other parts are read."""
    folder = split(tmp_path, StoragePlugin.MCAP, seconds(0, 1.7), seconds(1.7, 3), seconds(3, 9))
    (folder / "split_1.mcap").write_bytes(b"nothing of the kind")
    assert codes(folder) == ["recording.damaged"]
    (folder / "split_1.mcap").unlink()
    assert codes(folder) == ["recording.truncated"]


def test_folder_without_metadata(tmp_path: Path) -> None:
    """One recording in it is taken; of several it must be said which belong together."""
    folder = split(tmp_path, StoragePlugin.MCAP, seconds(0, 9))
    (folder / "metadata.yaml").unlink()
    with open_recording(folder) as recording:
        check_drive(recording)
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: [unclear")
    assert codes(folder) == ["recording.damaged"]
    shutil.copy(folder / "split_0.mcap", folder / "other.mcap")
    with pytest.raises(RecordingError, match="--together"):
        open_recording(folder)


def test_database_without_definitions_is_read_by_the_standard_ones(tmp_path: Path) -> None:
    """Databases of before ROS 2 Iron name their types alone."""
    import sqlite3

    file = copy_to_bag2(drive(tmp_path), tmp_path / "old", storage=StoragePlugin.SQLITE3)
    with sqlite3.connect(file) as database:
        database.execute("UPDATE schema SET schema_version = 3")
        database.execute("DROP TABLE message_definitions")
    with open_recording(file) as recording:
        check_drive(recording)


def test_damaged_chunk_of_a_bag_costs_that_chunk(tmp_path: Path) -> None:
    """What lies in other chunks is read, and the loss is said."""
    path = tmp_path / "drive.bag"
    copy_to_bag(drive(tmp_path, version=1), path, compression=Format.LZ4)
    assert codes(path) == []
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 200] = bytes(200)
    path.write_bytes(data)
    assert "recording.damaged" in codes(path)


def test_bag_without_index_says_what_to_do(tmp_path: Path) -> None:
    """A bag whose recorder was killed."""
    path = tmp_path / "drive.bag"
    copy_to_bag(drive(tmp_path, version=1), path)
    path.write_bytes(path.read_bytes()[:-3000])
    with pytest.raises(RecordingError, match=r"rosbag reindex.*drive\.bag"):
        open_recording(path)


def test_bomb_that_is_packed_with_zstd_is_refused(tmp_path: Path) -> None:
    """A few KiB that unpack to gigabytes never reach the disk as these."""
    import zstandard

    path = tmp_path / "bomb.mcap.zstd"
    packer = zstandard.ZstdCompressor(level=1).compressobj()
    path.write_bytes(b"".join(packer.compress(bytes(2**20)) for _ in range(200)) + packer.flush())
    with pytest.raises(RecordingError, match="unpacks to more"):
        open_recording(path)


IDL = """
module std_msgs { module msg { struct Header {
  builtin_interfaces::msg::Time stamp; string frame_id; }; }; };
"""


def test_idl_schemas_as_rosbag2_joins_them(tmp_path: Path) -> None:
    """Definitions in IDL, several in one text, give the same messages."""
    rule = "=" * 80 + "\n"
    header = (
        f"{rule}IDL: std_msgs/msg/Header\n{IDL}"
        f"{rule}IDL: builtin_interfaces/msg/Time\n"
        "module builtin_interfaces { module msg {\n"
        "  struct Time { int32 sec; uint32 nanosec; }; }; };\n"
    )
    scan = (
        f'{rule}IDL: sensor_msgs/msg/LaserScan\n#include "std_msgs/msg/Header.idl"\n'
        'module sensor_msgs { module msg {\n  @verbatim (language="comment", text="A scan.")\n'
        "  struct LaserScan { std_msgs::msg::Header header;\n"
        + "".join(
            f"    float {name};\n"
            for name in (
                *("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time"),
                *("range_min", "range_max"),
            )
        )
        + "    sequence<float> ranges; sequence<float> intensities; }; }; };\n"
    )
    source, path = drive(tmp_path), tmp_path / "idl.mcap"
    from mcap.reader import make_reader

    with source.open("rb") as file, path.open("wb") as target:
        writer = Writer(target)
        writer.start("ros2", "test")
        channels: dict[str, int] = {}
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None
            if channel.topic not in channels:
                is_scan = schema.name == "sensor_msgs/msg/LaserScan"
                number = writer.register_schema(
                    schema.name,
                    "ros2idl" if is_scan else schema.encoding,
                    (scan + header).encode() if is_scan else schema.data,
                )
                channels[channel.topic] = writer.register_channel(channel.topic, "cdr", number)
            writer.add_message(
                channels[channel.topic], message.log_time, message.data, message.log_time
            )
        writer.finish()
    with open_recording(path) as recording:
        assert recording.roles.laser is not None
        assert recording.roles.laser.channels[0].schema_encoding == "ros2idl"
        check_drive(recording)


def test_chunk_of_a_bag_that_unpacks_to_too_much_is_left_out(tmp_path: Path) -> None:
    """The rest is read, and the sentence names the limit; the file's own size is allowed."""
    path = tmp_path / "drive.bag"
    for compression in (Format.BZ2, Format.LZ4, None):
        path.unlink(missing_ok=True)
        writer = Rosbag1Writer(path)
        if compression is not None:
            writer.set_compression(compression)
        with writer:
            topic = writer.add_connection("/it", "std_msgs/msg/String", typestore=w.ROS1)
            writer.write(topic, 1, bytes(3 * 2**20))
            writer.write(topic, 2, b"x")
        for limits, said in (
            (LimitsConfig(chunk_mib=1), "over limits.chunk_mib = 1"),
            (
                LimitsConfig(chunk_mib=4, unpacked_mib=1, expansion=1),
                "over limits.unpacked_mib = 1",
            ),
        ):
            warnings: list[ProcessWarning] = []
            bag = Bag(path, ros1=True, warnings=warnings, limits=limits)
            found = [message.log_time_ns for message in bag.messages(bag.channels)]
            bag.close()
            if compression is None and limits.chunk_mib == 4:  # no more than the file holds
                assert (found, warnings) == ([1, 2], [])
                continue
            assert found == ([2] if limits.chunk_mib == 1 else [])
            assert said in warnings[0].message


@pytest.mark.parametrize("times", [1, 100])
def test_bag_that_names_a_chunk_again_is_refused(tmp_path: Path, times: int) -> None:
    """Its index would be read as often as it is named."""
    path = tmp_path / "drive.bag"
    copy_to_bag(drive(tmp_path, version=1), path)
    data = bytearray(path.read_bytes())
    at = data.index(b"chunk_count=") + len(b"chunk_count=")
    (chunks,) = struct.unpack_from("<I", data, at)
    struct.pack_into("<I", data, at, chunks + times)
    last = data.rindex(b"chunk_pos=")
    begin = data.rindex(b"op=\x06", 0, last) if b"op=\x06" in data[:last] else last
    record = data[data.rindex(struct.pack("<I", _header_bytes(data, begin)), 0, begin) :]
    path.write_bytes(bytes(data + record * times))
    with pytest.raises(RecordingError, match="names one chunk twice"):
        open_recording(path)


def _header_bytes(data: bytearray, within: int) -> int:
    """Return the length of the record's header that a place is in."""
    for begin in range(within - 4, 0, -1):
        (length,) = struct.unpack_from("<I", data, begin)
        (field,) = struct.unpack_from("<I", data, begin + 4)
        if 50 < length < 200 and field < length and b"=" in data[begin + 8 : begin + 8 + field]:
            return int(length)
    raise AssertionError


DATABASES = {
    "views": """
        ALTER TABLE messages RENAME TO other;
        CREATE VIEW messages AS SELECT * FROM other;
    """,
    "cells that are not stored": """
        ALTER TABLE messages RENAME TO other;
        CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,
            data BLOB GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL);
        INSERT INTO messages SELECT id, topic_id, timestamp FROM other;
    """,
    "merged profiles": "UPDATE topics SET offered_qos_profiles = '- &a {b: 1}\n- {<<: [*a, *a]}'",
    "profiles without end": "UPDATE topics SET offered_qos_profiles = zeroblob(5000000)",
    "profiles of brackets": "UPDATE topics SET offered_qos_profiles ="
    " replace(hex(zeroblob(50000)), '0', '[')",
    "topics without a name": "UPDATE topics SET name = x'ff'",
    "topics without a type": "UPDATE topics SET type = x'07'",
    "times that are words": "UPDATE messages SET timestamp = 'noon'",
    "times before all": "UPDATE messages SET timestamp = -timestamp",
    "times after all": "UPDATE messages SET timestamp = 9e99",
    "no tables": "DROP TABLE messages",
}


@pytest.mark.parametrize("name", DATABASES)
def test_database_that_is_not_what_it_seems_is_refused(tmp_path: Path, name: str) -> None:
    """In a sentence, before any of it is unfolded."""
    file = copy_to_bag2(drive(tmp_path), tmp_path / "bag", storage=StoragePlugin.SQLITE3)
    with contextlib.closing(sqlite3.connect(file)) as database:
        database.executescript(DATABASES[name])
    with pytest.raises(RecordingError, match="database of the bag cannot be read"):
        open_recording(file)


def test_message_of_a_database_that_is_no_bytes_is_left_out(tmp_path: Path) -> None:
    """SQLite holds anything anywhere; the loss is said."""
    file = copy_to_bag2(drive(tmp_path), tmp_path / "bag", storage=StoragePlugin.SQLITE3)
    with contextlib.closing(sqlite3.connect(file)) as database:
        database.execute(
            "UPDATE messages SET data = 'text' WHERE id = (SELECT max(id) FROM messages)"
        )
        database.commit()
    with open_recording(file) as recording:
        list(recording.depth_frames())
        list(recording.scans())
        assert {warning.code for warning in recording.warnings} == {"recording.damaged"}


PAIRS = list(itertools.pairwise("abcdefghijk"))
HOSTILE_YAML = {
    "laughs": "a: &a [x,x,x,x,x,x,x,x,x]\n"
    + "".join(f"{b}: &{b} [{','.join(['*' + a] * 9)}]\n" for a, b in PAIRS)
    + "rosbag2_bagfile_information: {relative_file_paths: *k}\n",
    "merges": "a: &a {x: 1}\n"
    + "".join(f"{b}: &{b} {{<<: [{','.join(['*' + a] * 9)}]}}\n" for a, b in PAIRS),
    "brackets": "[" * 100_000,
    "depth": "".join(" " * n + "a:\n" for n in range(1500)),
    "itself": "&a [*a]",
    "a long number": "rosbag2_bagfile_information: {relative_file_paths: {" + "9" * 500 + ": 1}}",
    "no list": "rosbag2_bagfile_information: {relative_file_paths: 7}",
    "no date": "rosbag2_bagfile_information: 2001-99-99",
    "a class": "!!python/object/apply:os.system [exit]",
    "names without number": "rosbag2_bagfile_information:\n  relative_file_paths:\n"
    + "".join(f"  - f{n}\n" for n in range(20_000)),
    "no letters": "\x00\ud7ff",
}


@pytest.mark.parametrize("name", HOSTILE_YAML)
def test_metadata_that_cannot_be_is_done_without(tmp_path: Path, name: str) -> None:
    """The folder's one file is read, and the loss is said."""
    copy_to_bag2(drive(tmp_path), tmp_path / "bag")
    (tmp_path / "bag" / "metadata.yaml").write_text(HOSTILE_YAML[name], encoding="utf-8")
    assert set(codes(tmp_path / "bag")) <= {"recording.damaged", "recording.truncated"}
    with open_recording(tmp_path / "bag") as recording:
        assert len(recording.depth_stamps()) == w.IMAGES
        assert recording.warnings
