"""Every encoding of depth, and every writer's file, gives the same metres, scans and poses."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import foxglove
import numpy as np
import pytest
from foxglove import channels as fc
from foxglove import messages as fm
from mcap.reader import make_reader
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer

from tablemap.errors import RecordingError
from tablemap.recording import inspect, open_recording
from tablemap.recording.decoding import Decoder
from tablemap.recording.mcap.container import Container
from tablemap.recording.messages import DecodingError
from tests.making import messages as w
from tests.making.drives import check_drive
from tests.making.protobuf import laser_scan, png_image, point_cloud, raw_image


def encoded(name: str) -> Callable[[w.RosRecorder, int], None]:
    """Return what writes the plane in an encoding."""
    mm, metres = w.millimetres(), w.plane()
    raw, packed = f"{w.PREFIX}/image_rect", f"{w.PREFIX}/image_rect/compressedDepth"
    nothing = struct.pack("<iff", 0, 0.0, 0.0)
    size = struct.pack("<II", w.WIDTH, w.HEIGHT)
    a, b = 100.0 * 101, 1 - 100.0 * 101 / 10.0
    inverse = np.where(np.isnan(metres), 0, np.round(a / metres + b)).astype(np.uint16)
    quantised = struct.pack("<iff", 0, a, b)
    return {
        "16UC1": lambda r, t: r.image(raw, t, mm, "16UC1"),
        "mono16": lambda r, t: r.image(raw, t, mm, "mono16"),
        "padded": lambda r, t: r.image(raw, t, mm, "16UC1", padding=6),
        "big endian": lambda r, t: r.image(raw, t, mm, "16UC1", is_bigendian=True),
        "32FC1": lambda r, t: r.image(raw, t, metres, "32FC1"),
        "32FC1 with zeros": lambda r, t: r.image(raw, t, np.nan_to_num(metres), "32FC1"),
        "32FC1 big endian": lambda r, t: r.image(raw, t, metres, "32FC1", is_bigendian=True),
        "png": lambda r, t: r.compressed(packed, t, nothing + w.png(mm), "16UC1; compressedDepth"),
        "png named": lambda r, t: r.compressed(
            packed, t, nothing + w.png(mm), "16UC1; compressedDepth png"
        ),
        "plain png": lambda r, t: r.compressed(f"{raw}/compressed", t, w.png(mm), "png"),
        "rvl": lambda r, t: r.compressed(
            packed, t, nothing + size + w.rvl(mm), "16UC1; compressedDepth rvl"
        ),
        "inverse png": lambda r, t: r.compressed(
            packed, t, quantised + w.png(inverse), "32FC1; compressedDepth"
        ),
        "inverse rvl": lambda r, t: r.compressed(
            packed, t, quantised + size + w.rvl(inverse), "32FC1; compressedDepth rvl"
        ),
    }[name]


RVL_FORMATS = (
    *("16UC1; compressedDepth rvl", "16UC1; compressedDepth", "16UC1;compressedDepth RVL"),
    *("mono16; compressedDepth rvl", "compressedDepth rvl", "compressedDepth", "16UC1; rvl", "rvl"),
)


@pytest.mark.parametrize("format", RVL_FORMATS)
@pytest.mark.parametrize("quantised", [False, True])
def test_rvl_is_told_by_its_bytes_however_the_format_is_spelled(
    tmp_path: Path, format: str, quantised: bool
) -> None:
    """Transports and their versions differ in what they call it; a few leave the type out."""
    a, b = 100.0 * 101, 1 - 100.0 * 101 / 10.0
    inverse = np.where(np.isnan(w.plane()), 0, np.round(a / w.plane() + b)).astype(np.uint16)
    header = struct.pack("<iffII", 0, a * quantised, b * quantised, w.WIDTH, w.HEIGHT)
    data = header + w.rvl(inverse if quantised else w.millimetres())
    for old in ("16UC1", "mono16") if quantised else ():
        format = format.replace(old, "32FC1")
    path = tmp_path / "drive.mcap"
    w.write_drive(path, depth=lambda r, t: r.compressed(f"{w.PREFIX}/image/rvl", t, data, format))
    with open_recording(path) as recording:
        check_drive(recording, depth_tolerance=1e-3 if quantised else 1e-6)


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("name", ["image_rect", "image_rect_raw", "image_rectified"])
def test_rectified_image_has_the_matrix_of_p(tmp_path: Path, version: int, name: str) -> None:
    """K and D are those of the lens, which the rectified image has no more."""
    lens = [81.0, 0, 44.0, 0, 83.0, 27.0, 0, 0, 1]
    pinhole = [*w.K[:3], -3.5, *w.K[3:6], 0, *w.K[6:], 0]  # of a stereo pair's right camera
    path = tmp_path / "drive.mcap"
    w.write_drive(
        path,
        version=version,
        calibration=lambda r, t: r.camera_info(
            f"{w.PREFIX}/camera_info", t, k=lens, p=pinhole, d=(-0.2, 0.05, 0.0, 0.0, 0.0)
        ),
        depth=lambda r, t: r.image(f"{w.PREFIX}/{name}", t, w.millimetres(), "16UC1"),
    )
    with open_recording(path) as recording:
        check_drive(recording)


OPTICAL_FROM_BODY = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
UNCALIBRATED: dict[str, Any] = {"calibration": lambda recorder, stamp_ns: None}


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("options", [{}, {"padding": 8}, {"is_bigendian": True}])
def test_organised_cloud_alone_is_an_image(
    tmp_path: Path, version: int, options: dict[str, Any]
) -> None:
    """The points give the pinhole that they were made with, so that no calibration is needed."""
    path = tmp_path / "drive.mcap"
    w.write_drive(
        path,
        version=version,
        depth=lambda r, t: r.points("/camera/depth_registered/points", t, w.cloud(), **options),
        **UNCALIBRATED,
    )
    assert not inspect(path).missing
    with open_recording(path) as recording:
        check_drive(recording)


def test_cloud_in_a_body_frame_looks_along_its_x_axis(tmp_path: Path) -> None:
    """Some drivers publish points forward, left and up, in the camera's link."""
    path = tmp_path / "drive.mcap"
    body = w.cloud() @ OPTICAL_FROM_BODY.astype(np.float32)

    def depth(recorder: w.RosRecorder, stamp_ns: int) -> None:
        mount = [("base_link", "camera_link", (0.1, 0.0, w.CAMERA_HEIGHT), w.LEVEL)]
        recorder.transforms(stamp_ns, mount, topic="/tf_static")
        recorder.points("/camera/points", stamp_ns, body, frame="camera_link")

    w.write_drive(path, depth=depth, **UNCALIBRATED)
    assert not inspect(path).missing
    with open_recording(path) as recording:
        assert recording.names.camera == "camera_link_optical_axes"
        frame = next(recording.depth_frames())
        assert np.nanmax(np.abs(frame.depth - w.plane())) < 1e-6
        assert np.allclose(frame.base_from_camera[:3, 2], [1, 0, 0], atol=1e-9)
        assert np.allclose(frame.base_from_camera[:3, 3], [0.1, 0, w.CAMERA_HEIGHT])


def test_image_goes_before_the_cloud_that_was_made_of_it(tmp_path: Path) -> None:
    """Both are recorded: the image is taken, as it was without the cloud, and nothing is said."""
    path = tmp_path / "drive.mcap"

    def depth(recorder: w.RosRecorder, stamp_ns: int) -> None:
        recorder.points(f"{w.PREFIX}/points", stamp_ns, w.cloud())
        w.raw_depth(recorder, stamp_ns)

    w.write_drive(path, depth=depth)
    with open_recording(path) as recording:
        assert recording.roles.depth is not None
        assert recording.roles.depth.name == f"{w.PREFIX}/image_rect_raw"
        check_drive(recording)


@pytest.mark.parametrize("kind", ["turned", "unorganised", "lidar"])
def test_cloud_that_is_no_cameras_is_refused(tmp_path: Path, kind: str) -> None:
    """Points in another frame than the camera's, without rows, or of a turning lidar."""
    path = tmp_path / "drive.mcap"
    cloud = w.cloud()
    if kind == "turned":
        cloud = cloud @ np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]], np.float32) + 0.2
    elif kind == "unorganised":
        cloud = cloud.reshape(1, -1, 3)
    else:
        azimuth, elevation = np.meshgrid(np.linspace(-3, 3, 512), np.linspace(-0.3, 0.3, 16))
        ray = [np.cos(azimuth), np.sin(azimuth), np.tan(elevation)]
        cloud = 3.0 * np.stack(ray, axis=-1).astype(np.float32)
    w.write_drive(path, depth=lambda r, t: r.points("/points", t, cloud), **UNCALIBRATED)
    with pytest.raises(RecordingError, match=r"/points cannot be decoded \(a point cloud"):
        open_recording(path)


ENCODINGS = (
    *("16UC1", "mono16", "padded", "big endian", "32FC1", "32FC1 with zeros", "32FC1 big endian"),
    *("png", "png named", "plain png", "rvl", "inverse png", "inverse rvl"),
)


@pytest.mark.parametrize("name", ENCODINGS)
def test_depth_encodings_give_the_same_metres(tmp_path: Path, name: str) -> None:
    """Inverse depth is quantised, to under a millimetre here; all others are exact."""
    path = tmp_path / "drive.mcap"
    w.write_drive(path, depth=encoded(name))
    with open_recording(path) as recording:
        check_drive(recording, depth_tolerance=1e-3 if "inverse" in name else 1e-6)


@pytest.mark.parametrize("name", ["16UC1", "32FC1", "png"])
def test_ros1(tmp_path: Path, name: str) -> None:
    """ROS 1 messages are read like those of ROS 2."""
    path = tmp_path / "drive.mcap"
    w.write_drive(path, version=1, depth=encoded(name))
    with open_recording(path) as recording:
        assert recording.source.profile == "ros1"
        check_drive(recording)


def test_rosbag2_writer(tmp_path: Path) -> None:
    """An MCAP of another writer (rosbags' own, with its layout and schemas) is read."""
    source = io.BytesIO()
    w.write_drive(source)
    source.seek(0)
    bag = tmp_path / "bag"
    with Rosbag2Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections: dict[str, Any] = {}
        for schema, channel, message in make_reader(source).iter_messages():
            assert schema is not None
            if channel.topic not in connections:
                connections[channel.topic] = writer.add_connection(
                    channel.topic, schema.name, typestore=w.ROS2
                )
            writer.write(connections[channel.topic], message.log_time, message.data)
    (path,) = bag.glob("*.mcap")
    with open_recording(path) as recording:
        check_drive(recording)


def _foxglove_drive(path: Path, *, form: str) -> None:
    context = foxglove.Context()
    image = fc.RawImageChannel("/camera/depth/image", context=context)
    encoded = fc.CompressedImageChannel("/camera/depth/image", context=context)
    points = fc.PointCloudChannel("/camera/depth/points", context=context)
    calibration = fc.CameraCalibrationChannel("/camera/depth/calibration", context=context)
    scan = fc.LaserScanChannel("/scan", context=context)
    tree = fc.FrameTransformsChannel("/tf", context=context)
    single = fc.FrameTransformChannel("/mount", context=context)

    def transform(stamp: fm.Timestamp, edge: Any) -> fm.FrameTransform:
        parent, child, place, turn = edge
        return fm.FrameTransform(
            timestamp=stamp,
            parent_frame_id=parent,
            child_frame_id=child,
            translation=fm.Vector3(x=place[0], y=place[1], z=place[2]),
            rotation=fm.Quaternion(x=turn[0], y=turn[1], z=turn[2], w=turn[3]),
        )

    with foxglove.open_mcap(path, context=context):
        for tick in range(51):
            now = w.START_NS + tick * w.SECOND // 10
            stamp = fm.Timestamp(sec=now // w.SECOND, nsec=now % w.SECOND)
            if tick == 0:
                for edge in w.STATIC_EDGES:
                    single.log(transform(stamp, edge), log_time=now)
            edges = [transform(stamp, edge) for edge in w.drive_edges(now)]
            tree.log(fm.FrameTransforms(transforms=edges), log_time=now)
            scan.log(laser_scan(stamp), log_time=now)
            if tick % 10:
                continue
            calibration.log(
                fm.CameraCalibration(
                    timestamp=stamp,
                    frame_id=w.CAMERA,
                    width=w.WIDTH,
                    height=w.HEIGHT,
                    distortion_model="plumb_bob",
                    K=w.K,
                ),
                log_time=now,
            )
            if form == "png":
                encoded.log(png_image(stamp), log_time=now)
            elif form == "cloud":
                points.log(point_cloud(stamp), log_time=now)
            else:
                image.log(raw_image(stamp), log_time=now)


@pytest.mark.parametrize("form", ["raw", "png", "cloud"])
def test_foxglove_protobuf(tmp_path: Path, form: str) -> None:
    """Foxglove's own writer and messages are read, as raw image, as PNG and as organised points."""
    path = tmp_path / "drive.mcap"
    _foxglove_drive(path, form=form)
    assert not inspect(path).missing
    with open_recording(path) as recording:
        check_drive(recording)


def test_colour_near_finds_the_nearest_image_within_the_tolerance(tmp_path: Path) -> None:
    """A stamp 50 ms off gets the image, one 300 ms off gets none."""
    path = tmp_path / "drive.mcap"
    w.write_drive(path)
    with open_recording(path) as recording:
        near, far = w.START_NS + 2 * w.SECOND + 50_000_000, w.START_NS + int(3.3 * w.SECOND)
        found = recording.colour_near(np.array([near, far]))
        assert set(found) == {near}
        assert found[near].stamp_ns == w.START_NS + 2 * w.SECOND


def test_header_stamp_of_zero_is_replaced_by_the_log_time(tmp_path: Path) -> None:
    """Where a driver left the stamp at zero, the time of logging counts."""
    path = tmp_path / "drive.mcap"
    w.write_drive(
        path,
        depth=lambda r, t: r.image(
            f"{w.PREFIX}/image_rect_raw", 0, w.millimetres(), "16UC1", log_ns=t
        ),
    )
    with open_recording(path) as recording:
        check_drive(recording)


def test_given_stamps_alone_are_read(tmp_path: Path) -> None:
    """Asked for two images, the reader yields those two, in order, whatever the order asked in."""
    path = tmp_path / "drive.mcap"
    w.write_drive(path)
    with open_recording(path) as recording:
        stamps = recording.depth_stamps()
        asked = np.array([stamps[4], stamps[1], stamps[1] + 5])
        assert [f.stamp_ns for f in recording.depth_frames(asked)] == [stamps[1], stamps[4]]


@pytest.mark.parametrize("version", [1, 2])
def test_direct_transforms_are_those_of_the_general_decoder(version: int) -> None:
    """Names of every length (alignment), static and moving, big-endian: the same transforms."""
    buffer = io.BytesIO()
    recorder = w.RosRecorder(buffer, version=version)
    rng = np.random.default_rng(3)
    for count in range(12):
        edges = [
            ("/p" * (i + 1), "c" * (count + i), tuple(rng.normal(size=3)), (0.0, 0.0, 0.6, 0.8))
            for i in range(count)
        ]
        recorder.transforms(w.START_NS + count, edges)
    recorder.finish()
    container = Container(buffer)
    direct, general = Decoder(container.channels[1]), Decoder(container.channels[1])
    assert direct._direct is not None
    general._direct = None
    for raw in container.messages([1]):
        assert direct.decode(raw) == general.decode(raw)
    if version == 2:
        message = w.ROS2.deserialize_cdr(raw.data, "tf2_msgs/msg/TFMessage")
        swapped = w.ROS2.serialize_cdr(message, "tf2_msgs/msg/TFMessage", little_endian=False)
        assert direct.decode(raw._replace(data=swapped)) == general.decode(raw)
    with pytest.raises(DecodingError):
        direct.decode(raw._replace(data=raw.data[:50]))
