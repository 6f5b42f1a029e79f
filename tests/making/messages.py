"""Writes small recordings with other people's writers: a robot that drives 1 m along x.

Six depth images of a tilted plane, one a second, with calibration, laser and the usual frames.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

START_NS = 1_700_000_000_000_000_000
SECOND = 1_000_000_000
IMAGES = 6
WIDTH, HEIGHT = 80, 60
K = [70.0, 0.0, 39.5, 0.0, 70.0, 29.5, 0.0, 0.0, 1.0]
CAMERA_HEIGHT = 1.1
CAMERA, LASER = "head_rgbd_sensor_rgb_frame", "base_range_sensor_link"
PREFIX = "/head_rgbd_sensor/depth_registered"

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
ROS1.register(
    get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage")
)


def plane() -> np.ndarray[Any, Any]:
    """Return (height, width) float32 metres: 1 to 2 m, with a missing corner, in whole mm."""
    depth = np.linspace(1.0, 2.0, HEIGHT)[:, None] + np.linspace(0, 0.2, WIDTH)[None, :]
    depth = np.round(depth, 3).astype(np.float32)
    depth[:5, :7] = np.nan
    return depth


def millimetres() -> np.ndarray[Any, Any]:
    """Return the plane in whole millimetres, 0 where it is missing."""
    return np.nan_to_num(np.round(plane() * 1000)).astype(np.uint16)


def cloud() -> np.ndarray[Any, Any]:
    """Return the plane as (height, width, 3) float32 points in the optical frame."""
    depth = plane().astype(float)
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    points = [(u - K[2]) / K[0] * depth, (v - K[5]) / K[4] * depth, depth]
    return np.stack(points, axis=-1).astype(np.float32)


def png(values: np.ndarray[Any, Any]) -> bytes:
    """Encode as PNG."""
    buffer = io.BytesIO()
    PIL.Image.fromarray(values).save(buffer, "PNG")
    return buffer.getvalue()


def rvl(values: np.ndarray[Any, Any]) -> bytes:
    """Encode as Wilson's reference code does, a nibble at a time."""
    nibbles: list[int] = []

    def put(value: int) -> None:
        while True:
            nibble, value = value & 7, value >> 3
            nibbles.append(nibble | (8 if value else 0))
            if not value:
                return

    flat, at, previous = values.ravel().tolist(), 0, 0
    while at < len(flat):
        zeros = at
        while at < len(flat) and flat[at] == 0:
            at += 1
        put(at - zeros)
        run = at
        while at < len(flat) and flat[at] != 0:
            at += 1
        put(at - run)
        for value in flat[run:at]:
            delta = value - previous
            put((delta << 1) ^ (delta >> 31))
            previous = value
    nibbles += [0] * (-len(nibbles) % 8)
    words = [
        sum(nibble << (28 - 4 * place) for place, nibble in enumerate(nibbles[start : start + 8]))
        for start in range(0, len(nibbles), 8)
    ]
    return struct.pack(f"<{len(words)}I", *words)


class RosRecorder:
    """Writes ROS messages, serialised by rosbags, with mcap's writer."""

    def __init__(self, target: Path | io.BytesIO, *, version: int = 2, **options: Any) -> None:
        self.version = version
        self.store = ROS1 if version == 1 else ROS2
        options.setdefault("compression", CompressionType.ZSTD)
        options.setdefault("chunk_size", 20_000)
        self.writer = Writer(str(target) if isinstance(target, Path) else target, **options)
        self.writer.start(f"ros{version}", "test")
        self.channels: dict[str, int] = {}

    def type(self, name: str) -> Any:
        """Return a message class of the ROS version."""
        return self.store.types[name]

    def header(self, stamp_ns: int, frame: str) -> Any:
        """Return a header."""
        time = self.type("builtin_interfaces/msg/Time")(
            sec=stamp_ns // SECOND, nanosec=stamp_ns % SECOND
        )
        sequence = {"seq": 0} if self.version == 1 else {}
        return self.type("std_msgs/msg/Header")(stamp=time, frame_id=frame, **sequence)

    def write(self, topic: str, name: str, message: Any, log_ns: int) -> None:
        """Write a message, with its channel and schema if they are new."""
        if topic not in self.channels:
            text, _ = self.store.generate_msgdef(name, ros_version=self.version)
            ros1 = self.version == 1
            schema = self.writer.register_schema(
                name.replace("/msg/", "/") if ros1 else name,
                "ros1msg" if ros1 else "ros2msg",
                text.encode(),
            )
            self.channels[topic] = self.writer.register_channel(
                topic, "ros1" if ros1 else "cdr", schema
            )
        serialise = self.store.serialize_ros1 if self.version == 1 else self.store.serialize_cdr
        self.writer.add_message(
            self.channels[topic], log_ns, bytes(serialise(message, name)), log_ns
        )

    def image(
        self,
        topic: str,
        stamp_ns: int,
        values: np.ndarray[Any, Any],
        encoding: str,
        *,
        frame: str = CAMERA,
        is_bigendian: bool = False,
        padding: int = 0,
        log_ns: int | None = None,
    ) -> None:
        """Write a raw image, its rows padded by so many bytes."""
        rows = values.astype(values.dtype.newbyteorder(">" if is_bigendian else "<"))
        raw = np.frombuffer(rows.tobytes(), np.uint8).reshape(len(values), -1)
        raw = np.pad(raw, ((0, 0), (0, padding)), constant_values=17)
        message = self.type("sensor_msgs/msg/Image")(
            header=self.header(stamp_ns, frame),
            height=values.shape[0],
            width=values.shape[1],
            encoding=encoding,
            is_bigendian=int(is_bigendian),
            step=raw.shape[1],
            data=raw.ravel(),
        )
        self.write(topic, "sensor_msgs/msg/Image", message, log_ns or stamp_ns)

    def points(
        self,
        topic: str,
        stamp_ns: int,
        cloud: np.ndarray[Any, Any],
        *,
        frame: str = CAMERA,
        is_bigendian: bool = False,
        padding: int = 0,
    ) -> None:
        """Write a (height, width, 3) cloud, each point beside a colour, rows padded by bytes."""
        order = ">" if is_bigendian else "<"
        layout = np.dtype({"names": ["colour", *"xyz"], "formats": ["u4", *[f"{order}f4"] * 3]})
        points = np.zeros(cloud.shape[:2], layout)
        for axis, name in enumerate("xyz"):
            points[name] = cloud[..., axis]
        raw = np.frombuffer(points.tobytes(), np.uint8).reshape(len(points), -1)
        raw = np.pad(raw, ((0, 0), (0, padding)), constant_values=17)
        field = self.type("sensor_msgs/msg/PointField")
        names = enumerate(("rgb", *"xyz"))
        message = self.type("sensor_msgs/msg/PointCloud2")(
            header=self.header(stamp_ns, frame),
            height=points.shape[0],
            width=points.shape[1],
            fields=[field(name=n, offset=4 * i, datatype=7, count=1) for i, n in names],
            is_bigendian=is_bigendian,
            point_step=layout.itemsize,
            row_step=raw.shape[1],
            data=raw.ravel(),
            is_dense=False,
        )
        self.write(topic, "sensor_msgs/msg/PointCloud2", message, stamp_ns)

    def compressed(
        self, topic: str, stamp_ns: int, data: bytes, format: str, *, frame: str = CAMERA
    ) -> None:
        """Write an encoded image."""
        message = self.type("sensor_msgs/msg/CompressedImage")(
            header=self.header(stamp_ns, frame),
            format=format,
            data=np.frombuffer(data, np.uint8),
        )
        self.write(topic, "sensor_msgs/msg/CompressedImage", message, stamp_ns)

    def camera_info(
        self,
        topic: str,
        stamp_ns: int,
        *,
        k: list[float] = K,
        p: list[float] | None = None,
        d: tuple[float, ...] = (),
        size: tuple[int, int] = (WIDTH, HEIGHT),
        frame: str = CAMERA,
        model: str = "plumb_bob",
    ) -> None:
        """Write a calibration."""
        roi = self.type("sensor_msgs/msg/RegionOfInterest")(
            x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        arrays = {
            "d": np.array(d, float),
            "k": np.array(k, float),
            "r": np.eye(3).ravel(),
            "p": np.array(p or [*k[:3], 0, *k[3:6], 0, *k[6:], 0], float),
        }
        if self.version == 1:
            arrays = {name.upper(): values for name, values in arrays.items()}
        message = self.type("sensor_msgs/msg/CameraInfo")(
            header=self.header(stamp_ns, frame),
            height=size[1],
            width=size[0],
            distortion_model=model,
            binning_x=0,
            binning_y=0,
            roi=roi,
            **arrays,
        )
        self.write(topic, "sensor_msgs/msg/CameraInfo", message, stamp_ns)

    def scan(
        self, topic: str, stamp_ns: int, *, frame: str = LASER, beams: int = 31, **fields: Any
    ) -> None:
        """Write a scan of ranges from 1 to 2 m, or of other fields."""
        usual = {
            "angle_min": -1.5,
            "angle_max": 1.5,
            "angle_increment": 0.1,
            "time_increment": 0.0,
            "scan_time": 0.1,
            "range_min": 0.05,
            "range_max": 60.0,
            "ranges": np.linspace(1, 2, beams).astype(np.float32),
            "intensities": np.zeros(0, np.float32),
        }
        message = self.type("sensor_msgs/msg/LaserScan")(
            header=self.header(stamp_ns, frame), **(usual | fields)
        )
        self.write(topic, "sensor_msgs/msg/LaserScan", message, stamp_ns)

    def transforms(
        self,
        stamp_ns: int,
        edges: list[tuple[str, str, tuple[float, ...], tuple[float, ...]]],
        *,
        topic: str = "/tf",
    ) -> None:
        """Write (parent, child, place, quaternion) edges."""
        get = self.type
        stamped = [
            get("geometry_msgs/msg/TransformStamped")(
                header=self.header(stamp_ns, parent),
                child_frame_id=child,
                transform=get("geometry_msgs/msg/Transform")(
                    translation=get("geometry_msgs/msg/Vector3")(*place),
                    rotation=get("geometry_msgs/msg/Quaternion")(*turn),
                ),
            )
            for parent, child, place, turn in edges
        ]
        message = get("tf2_msgs/msg/TFMessage")(transforms=stamped)
        self.write(topic, "tf2_msgs/msg/TFMessage", message, stamp_ns)

    def finish(self) -> None:
        """End the file."""
        self.writer.finish()


LEVEL = (0.0, 0.0, 0.0, 1.0)
OPTICAL = (-0.5, 0.5, -0.5, 0.5)  # z forward, x right
STATIC_EDGES = [
    ("base_footprint", "base_link", (0.0, 0.0, 0.0), LEVEL),
    ("base_link", CAMERA, (0.1, 0.0, CAMERA_HEIGHT), OPTICAL),
    ("base_link", LASER, (0.17, 0.0, 0.18), LEVEL),
]


def drive_edges(stamp_ns: int) -> list[tuple[str, str, tuple[float, ...], tuple[float, ...]]]:
    """Return map -> odom -> base_footprint: 0.2 m/s along the odometry's x, a shift of 1, 2."""
    along = 0.2 * (stamp_ns - START_NS) / SECOND
    slip = 0.001 * (stamp_ns - START_NS) / SECOND
    return [
        ("map", "odom", (1.0 + slip, 2.0, 0.0), LEVEL),
        ("odom", "base_footprint", (along, 0.0, 0.0), LEVEL),
    ]


def raw_depth(recorder: RosRecorder, stamp_ns: int) -> None:
    """Write the plane as the camera gives it."""
    recorder.image(f"{PREFIX}/image_rect_raw", stamp_ns, millimetres(), "16UC1")


def write_drive(
    target: Path | io.BytesIO,
    *,
    version: int = 2,
    depth: Callable[[RosRecorder, int], None] | None = raw_depth,
    calibration: Callable[[RosRecorder, int], None] | None = None,
    transforms: bool = True,
    scan_fields: dict[str, Any] | None = None,
    **options: Any,
) -> None:
    """Write the drive; any of its parts can be replaced or left out."""
    recorder = RosRecorder(target, version=version, **options)
    if transforms:
        recorder.transforms(START_NS, STATIC_EDGES, topic="/tf_static")
    for tick in range(10 * (IMAGES - 1) + 1):
        stamp_ns = START_NS + tick * SECOND // 10
        if transforms:
            recorder.transforms(stamp_ns, drive_edges(stamp_ns))
        recorder.scan("/base_scan", stamp_ns, **(scan_fields or {}))
        if tick % 10 == 0:
            if calibration is not None:
                calibration(recorder, stamp_ns)
            else:
                recorder.camera_info(f"{PREFIX}/camera_info", stamp_ns)
            if depth is not None:
                depth(recorder, stamp_ns)
            colour = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
            recorder.image("/head_rgbd_sensor/rgb/image_rect_color", stamp_ns, colour, "rgb8")
    recorder.finish()
