"""Parsed objects -> messages; the fields are ROS's or Foxglove's."""

from __future__ import annotations

import base64
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablemap.recording.claims import ClaimError
from tablemap.recording.clouds import depth_of_cloud
from tablemap.recording.kinds import CALIBRATION, COMPRESSED, IMAGE, LASER, POINTS, POSE, TRANSFORMS
from tablemap.recording.messages import (
    CameraInfo,
    CloudImage,
    CompressedImage,
    DecodingError,
    Image,
    LaserScan,
    Message,
    Pose,
    TransformStamped,
)
from tablemap.recording.raw import LATEST_NS

Convert = Callable[[Any, int], Message]


def converter(kind: str, *, is_static: bool) -> Convert:
    """Return what makes a kind's message of a parsed object and its log time."""
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
    ranges = _ranges(message)
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


def _ranges(message: Any) -> NDArray[np.float32]:
    """Return a scan's ranges (n,); of several echoes of a beam the first, of none infinity."""
    if not len(message.ranges) or not hasattr(message.ranges[0], "echoes"):
        ranges = np.array(message.ranges, dtype=np.float32)
    else:
        echoes = [beam.echoes for beam in message.ranges]
        ranges = np.array([each[0] if len(each) else np.inf for each in echoes], dtype=np.float32)
    ranges[np.isnan(ranges)] = np.nan  # damaged ones may be NaNs that signal, and warn when used
    return ranges


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
