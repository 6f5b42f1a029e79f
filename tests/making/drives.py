"""The drive of `tests.making.messages`: checked as it is read, and copied into other containers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys.store import Typestore

from tablemap.recording import Recording
from tests.making import messages as w


def check_drive(recording: Recording, *, depth_tolerance: float = 1e-6) -> None:
    """Check images, calibration, scans, poses and frames against what was written."""
    names = recording.names
    assert (names.fixed, names.odom, names.base) == ("map", "odom", "base_footprint")
    assert (names.camera, names.laser) == (w.CAMERA, w.LASER)
    frames = list(recording.depth_frames())
    assert [f.stamp_ns for f in frames] == [w.START_NS + i * w.SECOND for i in range(w.IMAGES)]
    assert np.array_equal(recording.depth_stamps(), [f.stamp_ns for f in frames])
    for frame in frames:
        assert frame.depth.dtype == np.float32
        assert np.array_equal(np.isnan(frame.depth), np.isnan(w.plane()))
        assert np.nanmax(np.abs(frame.depth - w.plane())) < depth_tolerance
        assert np.allclose(frame.k, np.reshape(w.K, (3, 3)))
        # The optical axis points along the base's x, 1.1 m above it.
        assert np.allclose(frame.base_from_camera[:3, 2], [1, 0, 0], atol=1e-9)
        assert np.allclose(frame.base_from_camera[:3, 3], [0.1, 0, w.CAMERA_HEIGHT])
    middle = w.START_NS + int(2.25 * w.SECOND)
    pose = recording.fixed_from_base(middle)
    assert pose is not None
    assert np.allclose(pose[:3, 3], [1.0 + 0.45 + 0.00225, 2.0, 0.0], atol=1e-9)
    wheels = recording.odom_from_base(middle)
    assert wheels is not None
    assert np.allclose(wheels[:3, 3], [0.45, 0, 0], atol=1e-9)
    assert recording.fixed_from_base(w.START_NS - w.SECOND) is None
    assert np.allclose(recording.base_from_laser(middle)[:3, 3], [0.17, 0, 0.18])
    scans = list(recording.scans())
    assert len(scans) == len(recording.scan_stamps()) == 51
    assert np.allclose(scans[7].ranges, np.linspace(1, 2, 31))
    assert np.allclose(scans[7].angles, np.linspace(-1.5, 1.5, 31), atol=1e-6)
    part = list(recording.scans(w.START_NS + w.SECOND, w.START_NS + 2 * w.SECOND))
    assert len(part) == 11
    assert recording.warnings == []


Keep = Callable[[int], bool]


def seconds(first: float, last: float) -> Keep:
    """Return what keeps a part of the drive."""
    return lambda time_ns: first <= (time_ns - w.START_NS) / w.SECOND < last


def _copy(
    writer: Rosbag1Writer | Rosbag2Writer,
    source: Path,
    typestore: Typestore,
    keep: Keep = lambda _: True,
) -> None:
    connections: dict[str, Any] = {}
    for topic, name, time_ns, data in _messages(source):
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, name, typestore=typestore)
        if keep(time_ns):
            writer.write(connections[topic], time_ns, data)


def copy_to_bag(
    source: Path, bag: Path, *, compression: Rosbag1Writer.CompressionFormat | None = None
) -> None:
    """Copy an MCAP of ROS 1 messages into a bag, by rosbags' writer."""
    writer = Rosbag1Writer(bag)
    writer.chunk_threshold = 20_000
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        _copy(writer, source, w.ROS1)


def copy_to_bag2(
    source: Path,
    folder: Path,
    *,
    storage: StoragePlugin = StoragePlugin.MCAP,
    compression: CompressionMode = CompressionMode.NONE,
    keep: Keep = lambda _: True,
) -> Path:
    """Copy an MCAP of ROS 2 messages into a folder of rosbag2, by rosbags' writer.

    ``keep`` tells by its log time whether a message is taken. Returns the file in the folder.
    """
    writer = Rosbag2Writer(folder, version=9, storage_plugin=storage)
    if compression is not CompressionMode.NONE:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        _copy(writer, source, w.ROS2, keep)
    (file,) = (each for each in folder.iterdir() if each.name != "metadata.yaml")
    return file


def _messages(source: Path) -> Iterator[tuple[str, str, int, bytes]]:
    """Yield topic, type, log time and bytes."""
    with source.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None
            name = schema.name if "/msg/" in schema.name else schema.name.replace("/", "/msg/")
            yield channel.topic, name, message.log_time, message.data
