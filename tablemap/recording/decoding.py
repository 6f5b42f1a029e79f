"""Recorded bytes -> messages: ROS 1, ROS 2 (CDR), Foxglove's protobuf, and its JSON.

The types are built from the schemas in the recording, so that older and newer versions of a message
are read correctly. If a schema's text is empty, the standard message of ROS is assumed.
"""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory
from rosbags.typesys import Stores, get_typestore

from tablemap.config import LimitsConfig
from tablemap.config.limits import MIB
from tablemap.recording.claims import (
    ClaimError,
    Counted,
    check_json,
    check_message,
    check_points,
    check_protobuf,
)
from tablemap.recording.clouds import depth_of_cloud
from tablemap.recording.messages import (
    CameraInfo,
    CloudImage,
    CompressedImage,
    Image,
    LaserScan,
    Pose,
    TransformStamped,
)
from tablemap.recording.packing import unpacked_message
from tablemap.recording.raw import LATEST_NS, Channel, RawMessage
from tablemap.recording.schemas import SchemaError, check_types, types_of_idl, types_of_msg
from tablemap.recording.tf.messages import Reader as DirectReader
from tablemap.recording.tf.messages import direct_reader

Message = Image | CompressedImage | CameraInfo | LaserScan | Pose | tuple[TransformStamped, ...]

IMAGE, COMPRESSED, CALIBRATION, LASER, POINTS, POSE, TRANSFORMS = (
    "image",
    "compressed image",
    "calibration",
    "laser scan",
    "point cloud",
    "pose",
    "transforms",
)

_KINDS = {
    "sensor_msgs/Image": IMAGE,
    "sensor_msgs/CompressedImage": COMPRESSED,
    "sensor_msgs/CameraInfo": CALIBRATION,
    "sensor_msgs/LaserScan": LASER,
    "sensor_msgs/PointCloud2": POINTS,
    "geometry_msgs/PoseStamped": POSE,
    "geometry_msgs/PoseWithCovarianceStamped": POSE,
    "nav_msgs/Odometry": POSE,
    "tf2_msgs/TFMessage": TRANSFORMS,
    "tf/tfMessage": TRANSFORMS,
    "foxglove/RawImage": IMAGE,
    "foxglove/CompressedImage": COMPRESSED,
    "foxglove/CameraCalibration": CALIBRATION,
    "foxglove/LaserScan": LASER,
    "foxglove/PointCloud": POINTS,
    "foxglove/PoseInFrame": POSE,
    "foxglove/FrameTransform": TRANSFORMS,
    "foxglove/FrameTransforms": TRANSFORMS,
}


_MOST_WORDS = 160  # most characters quoted from another program's error


class DecodingError(Exception):
    """A message that is not what its schema says; the text completes "it ..."."""


def schema_key(name: str) -> str:
    """Return a schema's name without the spelling of its system: ``sensor_msgs/Image``."""
    return name.replace("/msg/", "/").replace("foxglove.", "foxglove/")


def kind_of(channel: Channel) -> str | None:
    """Return the kind of a channel's messages, or None if processing does not need them."""
    key = schema_key(channel.schema_name)
    if key.startswith("foxglove_msgs/"):
        key = key.replace("foxglove_msgs/", "foxglove/")
    return _KINDS.get(key)


class Decoder:
    """Decodes the messages of one channel; everything that fails is a `DecodingError`."""

    def __init__(self, channel: Channel, limits: LimitsConfig | None = None) -> None:
        self._limits = limits or LimitsConfig()
        self._packed_bytes = self._unpacked_bytes = 0
        kind = kind_of(channel)
        if kind is None:
            raise DecodingError(f"has the schema {channel.schema_name!r}, which is not read")
        self.channel = channel
        self.kind = kind
        self._parse, self._peek, self._direct = _parser(channel, self._limits)
        self._is_static = channel.topic.rstrip("/").endswith("tf_static")
        self._convert = _converter(kind, is_static=self._is_static)
        self._may_be_packed = channel.message_encoding == "cdr"

    def decode(self, raw: RawMessage) -> Message:
        """Decode a message; a stamp of zero is replaced by the log time."""
        try:
            data = self._unpacked(raw)
            if self._direct is not None:
                # Messages that it cannot read (in another byte order) go to the general decoder.
                with suppress(struct.error, UnicodeDecodeError):
                    return self._direct(data, raw.log_time_ns, self._is_static)
            parsed = self._parse(data)
            check_points(parsed, self._limits)
            message = self._convert(parsed, raw.log_time_ns)
            check_message(message, self._limits)
        except DecodingError:
            raise
        except ClaimError as error:
            raise DecodingError(str(error)) from error
        # Parsers that are generated from a schema raise anything on bytes that do not fit it.
        except Exception as error:
            raise DecodingError(f"cannot be decoded ({_brief(error)})") from error
        return message

    @property
    def begins_with_header(self) -> bool:
        """Whether messages are ROS's, with a stamp at their very beginning."""
        return self._peek is not None

    def header(self, raw: RawMessage) -> tuple[int, str]:
        """Return the header's stamp and frame, if possible without decoding the rest."""
        if self._peek is not None:
            try:
                stamp_ns, frame_id = self._peek(self._unpacked(raw))
            except ValueError as error:
                raise DecodingError(f"cannot be decoded ({_brief(error)})") from error
            except (struct.error, IndexError) as error:
                raise DecodingError("is too short for its header") from error
            return stamp_ns or raw.log_time_ns, frame_id.lstrip("/")
        message = self.decode(raw)
        assert not isinstance(message, tuple)
        return message.stamp_ns, message.frame_id

    def _unpacked(self, raw: RawMessage) -> memoryview:
        if not self._may_be_packed:
            return raw.data
        data = unpacked_message(raw.data, self._limits)
        self._packed_bytes += len(raw.data)
        self._unpacked_bytes += len(data)
        if self._unpacked_bytes > max(
            self._limits.unpacked_mib * MIB, self._limits.expansion * self._packed_bytes
        ):
            raise DecodingError(
                f"is one of those that unpack to too much, {self._limits.over('unpacked_mib')}"
            )
        return data


Parse = Callable[[memoryview], Any]
Peek = Callable[[memoryview], tuple[int, str]]
Parser = tuple[Parse, Peek | None, DirectReader | None]


def _parser(channel: Channel, limits: LimitsConfig) -> Parser:
    """Return the parser of bytes, with fast readers for the stamp and for transforms."""
    return _schema_parser(
        channel.message_encoding,
        channel.schema_name,
        channel.schema_encoding,
        channel.schema_data,
        limits,
    )


@lru_cache(maxsize=256)
def _schema_parser(
    encoding: str, name: str, schema_encoding: str, schema_data: bytes, limits: LimitsConfig
) -> Parser:
    """Build the parser of a schema; recordings of one robot share theirs."""
    try:
        if len(schema_data) > limits.schema_kib * 1024:
            over = limits.over("schema_kib")
            raise SchemaError(f"has {len(schema_data) / 1024:.0f} KiB, {over}")
        if encoding in ("ros1", "cdr"):
            return _ros_parser(encoding, name, schema_encoding, schema_data.decode(), limits)
        if encoding == "protobuf":
            schema = Schema(1, schema_data, schema_encoding, name)
            decode = DecoderFactory().decoder_for(encoding, schema)
            if decode is not None:
                kind = decode(b"").DESCRIPTOR
                return (lambda data: decode(check_protobuf(data, kind, limits))), None, None
        if encoding == "json":
            return (lambda data: _parse_json(check_json(data, limits))), None, None
    except SchemaError as error:
        raise DecodingError(f"has a schema that {error}") from error
    # A schema may contain anything, and its parser may raise anything.
    except Exception as error:
        raise DecodingError(f"has a schema that cannot be parsed ({_brief(error)})") from error
    raise DecodingError(f"is encoded as {encoding!r}, which is not read")


def _brief(error: Exception) -> str:
    """Return an error's text in one short line, as some errors quote everything that they read."""
    words = " ".join(str(error).split()) or type(error).__name__
    return words if len(words) <= _MOST_WORDS else f"{words[:_MOST_WORDS]}..."


def _parse_json(text: bytes) -> Any:
    return json.loads(text, object_hook=lambda fields: SimpleNamespace(**fields))


def _ros_parser(
    encoding: str, schema_name: str, schema_encoding: str, text: str, limits: LimitsConfig
) -> Parser:
    name = schema_name if "/msg/" in schema_name else schema_name.replace("/", "/msg/")
    if not text.strip():
        store = get_typestore(Stores.ROS1_NOETIC if encoding == "ros1" else Stores.LATEST)
    else:
        store = get_typestore(Stores.EMPTY)
        is_idl = schema_encoding in ("ros2idl", "omgidl")
        types = types_of_idl(text, limits) if is_idl else types_of_msg(text, name, limits)
        check_types(store.fielddefs | types, name, limits, ros1=encoding == "ros1")
        store.register(types)
    left = [0]  # parts that the message at hand may still have
    made: dict[str, Any] = dict(store.types)
    for listed in check_types(store.fielddefs, name, limits, ros1=encoding == "ros1"):
        made[listed] = Counted(left, made[listed], limits)
    store.types = made
    fields = store.fielddefs[name][1]
    begins_with_header = bool(fields) and fields[0][1][1] == "std_msgs/msg/Header"
    direct: DirectReader | None = None
    if _KINDS.get(schema_key(schema_name)) == TRANSFORMS:
        direct = direct_reader(store.fielddefs, name, encoding=encoding)
    deserialize = store.deserialize_cdr if encoding == "cdr" else store.deserialize_ros1
    peek = _peek_cdr if encoding == "cdr" else _peek_ros1

    def parse(data: memoryview) -> Any:
        left[0] = limits.message_parts
        return deserialize(data, name)

    return parse, peek if begins_with_header else None, direct


def _peek_ros1(data: memoryview) -> tuple[int, str]:
    seconds, nanoseconds, length = struct.unpack_from("<III", data, 4)  # after the sequence number
    frame_id = bytes(data[16 : 16 + length]).decode()
    return int(seconds) * 1_000_000_000 + int(nanoseconds), frame_id


def _peek_cdr(data: memoryview) -> tuple[int, str]:
    order = "<" if data[1] == 1 else ">"
    seconds, nanoseconds, length = struct.unpack_from(order + "iII", data, 4)
    frame_id = bytes(data[16 : 16 + max(length - 1, 0)]).decode()
    return int(seconds) * 1_000_000_000 + int(nanoseconds), frame_id


# From the objects that parsers make to ours. Fields are ROS's or Foxglove's.

Convert = Callable[[Any, int], Message]


def _converter(kind: str, *, is_static: bool) -> Convert:
    if kind == TRANSFORMS:
        return lambda message, log_ns: _transforms(message, log_ns, is_static)
    return _CONVERTERS[kind]


def _image(message: Any, log_ns: int) -> Image:
    stamp_ns, frame_id = _header(message, log_ns)
    return Image(
        stamp_ns,
        frame_id,
        int(message.height),
        int(message.width),
        str(message.encoding),
        bool(getattr(message, "is_bigendian", False)),
        int(message.step),
        _bytes(message.data),
    )


def _compressed(message: Any, log_ns: int) -> CompressedImage:
    return CompressedImage(*_header(message, log_ns), str(message.format), _bytes(message.data))


def _calibration(message: Any, log_ns: int) -> CameraInfo:
    stamp_ns, frame_id = _header(message, log_ns)
    return CameraInfo(
        stamp_ns,
        frame_id,
        int(message.height),
        int(message.width),
        str(message.distortion_model),
        _floats(message, "D", None),
        _floats(message, "K", (3, 3)),
        _floats(message, "R", (3, 3)),
        _floats(message, "P", (3, 4)),
        *_window(message),
    )


def _window(message: Any) -> tuple[tuple[int, int], tuple[int, int, int, int] | None]:
    """Return binning and region of interest; zeros stand for one, and for all of the image."""
    across, down = (int(getattr(message, f"binning_{axis}", 0)) for axis in "xy")
    binning = max(across, 1), max(down, 1)
    roi = getattr(message, "roi", None)
    if roi is None:
        return binning, None
    left, top = int(roi.x_offset), int(roi.y_offset)
    width, height = int(roi.width), int(roi.height)
    is_all = not (width and height)
    return binning, None if is_all else (left, top, width, height)


def _laser(message: Any, log_ns: int) -> LaserScan:
    stamp_ns, frame_id = _header(message, log_ns)
    ranges = np.asarray(message.ranges, dtype=np.float32).copy()
    if hasattr(message, "start_angle"):
        turn = _yaw_of_pose(getattr(message, "pose", None))
        start, end = float(message.start_angle) + turn, float(message.end_angle) + turn
        step = (end - start) / max(len(ranges) - 1, 1)
        return LaserScan(stamp_ns, frame_id, start, end, step, 0.0, 0.0, 0.0, float("inf"), ranges)
    return LaserScan(
        stamp_ns,
        frame_id,
        float(message.angle_min),
        float(message.angle_max),
        float(message.angle_increment),
        float(message.time_increment),
        float(message.scan_time),
        float(message.range_min),
        float(message.range_max),
        ranges,
    )


def _cloud(message: Any, log_ns: int) -> CloudImage:
    stamp_ns, frame_id = _header(message, log_ns)
    data = _bytes(message.data)
    if hasattr(message, "point_stride"):  # Foxglove's
        if not _is_identity(getattr(message, "pose", None)):
            raise DecodingError("is a point cloud that lies apart from its frame's origin")
        fields = [(str(f.name), int(f.offset), int(f.type)) for f in message.fields]
        stride = max(int(message.point_stride), 1)
        count = len(data) // stride
        strides, width, is_bigendian = (count * stride, stride), None, False
    else:
        fields = [(str(f.name), int(f.offset), int(f.datatype)) for f in message.fields]
        width, count = int(message.width), int(message.width) * int(message.height)
        strides = int(message.row_step), int(message.point_step)
        is_bigendian = bool(message.is_bigendian)
    cloud = depth_of_cloud(
        fields, data, count=count, strides=strides, width=width, is_bigendian=is_bigendian
    )
    height, width = cloud.depth.shape
    return CloudImage(
        stamp_ns,
        f"{frame_id}_optical_axes" if cloud.is_body else frame_id,
        height,
        width,
        "32FC1",
        False,
        4 * width,
        cloud.depth.tobytes(),
        cloud.k,
        frame_id if cloud.is_body else None,
    )


def _pose(message: Any, log_ns: int) -> Pose:
    """Find the pose in its message, with or without a covariance."""
    stamp_ns, frame_id = _header(message, log_ns)
    pose, unknown = message.pose, float("nan")
    sigma = (unknown, unknown, unknown)
    if hasattr(pose, "covariance"):
        variances = np.array(pose.covariance, dtype=np.float64).reshape(6, 6)[[0, 1, 5], [0, 1, 5]]
        # A sender that does not know the covariance leaves it at zero.
        if np.all(np.isfinite(variances)) and np.all(variances >= 0) and variances.any():
            x, y, yaw = map(float, np.sqrt(variances))
            sigma = (x, y, yaw)
        pose = pose.pose
    child = str(getattr(message, "child_frame_id", "")).lstrip("/")
    return Pose(stamp_ns, frame_id, child, _xyz(pose.position), _xyzw(pose.orientation), sigma)


def _is_identity(pose: Any) -> bool:
    if pose is None or not (hasattr(pose, "position") and hasattr(pose, "orientation")):
        return True
    moved = [*_xyz(pose.position), *_xyzw(pose.orientation)[:3]]
    return max(map(abs, moved)) < 1e-9


def _yaw_of_pose(pose: Any) -> float:
    """Return the yaw of a scan's own pose in its frame; it must have no other part."""
    if pose is None or not (hasattr(pose, "position") and hasattr(pose, "orientation")):
        return 0.0
    place, turn = pose.position, pose.orientation
    x, y, z, w = (float(getattr(turn, name, 0.0)) for name in "xyzw")
    if any(abs(float(getattr(place, name, 0.0))) > 1e-9 for name in "xyz") or x or y:
        raise DecodingError("is a laser scan that lies apart from its frame's origin")
    return 2.0 * float(np.arctan2(z, w)) if (z or w) else 0.0


def _transforms(message: Any, log_ns: int, is_static: bool) -> tuple[TransformStamped, ...]:
    if hasattr(message, "parent_frame_id"):
        return (_frame_transform(message, log_ns, is_static),)
    transforms = message.transforms
    if len(transforms) and hasattr(transforms[0], "parent_frame_id"):
        return tuple(_frame_transform(each, log_ns, is_static) for each in transforms)
    return tuple(
        TransformStamped(
            *_header(each, log_ns),
            each.child_frame_id.lstrip("/"),
            _xyz(each.transform.translation),
            _xyzw(each.transform.rotation),
            is_static,
        )
        for each in transforms
    )


def _frame_transform(message: Any, log_ns: int, is_static: bool) -> TransformStamped:
    return TransformStamped(
        _time_ns(message.timestamp) or log_ns,
        message.parent_frame_id.lstrip("/"),
        message.child_frame_id.lstrip("/"),
        _xyz(message.translation),
        _xyzw(message.rotation),
        is_static,
    )


_CONVERTERS: dict[str, Convert] = {
    IMAGE: _image,
    COMPRESSED: _compressed,
    CALIBRATION: _calibration,
    LASER: _laser,
    POINTS: _cloud,
    POSE: _pose,
}


def _header(message: Any, log_ns: int) -> tuple[int, str]:
    """Return stamp and frame; a stamp of zero is replaced by the log time."""
    if hasattr(message, "header"):
        header = message.header
        return _time_ns(header.stamp) or log_ns, str(header.frame_id).lstrip("/")
    return _time_ns(message.timestamp) or log_ns, str(message.frame_id).lstrip("/")


def _time_ns(time: Any) -> int:
    """Return nanoseconds of a time in the form of ROS, protobuf or JSON."""
    if hasattr(time, "nanosec"):
        seconds, nanoseconds = int(time.sec), int(time.nanosec)
    elif hasattr(time, "nanos"):
        seconds, nanoseconds = int(time.seconds), int(time.nanos)
    else:
        seconds, nanoseconds = int(time.sec), int(time.nsec)
    stamp_ns = seconds * 1_000_000_000 + nanoseconds
    if not 0 <= stamp_ns <= LATEST_NS:
        raise ClaimError("has a time before 1970 or after the year 2262")
    return stamp_ns


def _bytes(data: Any) -> bytes:
    if isinstance(data, str):  # JSON
        return base64.b64decode(data)
    return data.tobytes() if isinstance(data, np.ndarray) else bytes(data)


def _floats(message: Any, name: str, shape: tuple[int, int] | None) -> np.ndarray[Any, Any]:
    """Return a calibration's array; its name is lower case in ROS 2, and R and P may be empty."""
    values = (
        getattr(message, name) if hasattr(message, name) else getattr(message, name.lower(), ())
    )
    array = np.array(values, dtype=np.float64)
    if shape is None:
        return array
    if array.size == 0 and name in "RP":
        return np.eye(3) if name == "R" else np.zeros(shape)
    return array.reshape(shape)


def _xyz(vector: Any) -> tuple[float, float, float]:
    return float(vector.x), float(vector.y), float(vector.z)


def _xyzw(quaternion: Any) -> tuple[float, float, float, float]:
    return float(quaternion.x), float(quaternion.y), float(quaternion.z), float(quaternion.w)
