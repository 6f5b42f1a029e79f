"""A fast reader for ROS's transform messages, as robots record thousands a second.

It is used only if the embedded schema has the layout that all versions of ROS share so far; the
general decoder takes five times as long.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from tablemap.recording.messages import TransformStamped

_LAYOUT: dict[str, list[tuple[str, str]]] = {
    "geometry_msgs/msg/TransformStamped": [
        ("header", "std_msgs/msg/Header"),
        ("child_frame_id", "string"),
        ("transform", "geometry_msgs/msg/Transform"),
    ],
    "geometry_msgs/msg/Transform": [
        ("translation", "geometry_msgs/msg/Vector3"),
        ("rotation", "geometry_msgs/msg/Quaternion"),
    ],
    "geometry_msgs/msg/Vector3": [(axis, "float64") for axis in "xyz"],
    "geometry_msgs/msg/Quaternion": [(axis, "float64") for axis in "xyzw"],
}
_POSE = struct.Struct("<7d")
_WORD = struct.Struct("<I")
_LONGEST_NAME = 256  # bytes; longer ones are left to the general decoder, and to its limits

Reader = Callable[[memoryview, int, bool], tuple[TransformStamped, ...]]


def direct_reader(fielddefs: dict[str, Any], name: str, *, encoding: str) -> Reader | None:
    """Return a fast reader for a schema's messages, None if its layout is another.

    ``fielddefs`` are rosbags' definitions of the embedded types. The reader takes the bytes, the
    time for stamps of zero, and whether the transforms are static; it raises struct.error on bytes
    that are too short.
    """
    header = [("stamp", "builtin_interfaces/msg/Time"), ("frame_id", "string")]
    if encoding == "ros1":
        header.insert(0, ("seq", "uint32"))
    if _fields(fielddefs, "std_msgs/msg/Header") != header or any(
        _fields(fielddefs, each) != fields for each, fields in _LAYOUT.items()
    ):
        return None
    own = fielddefs[name][1]
    if len(own) != 1 or own[0][1][1][0][1] != "geometry_msgs/msg/TransformStamped":
        return None
    return _read_ros1 if encoding == "ros1" else _read_cdr


def _fields(fielddefs: dict[str, Any], name: str) -> list[tuple[str, str]] | None:
    if name not in fielddefs:
        return None
    return [
        (field, kind[1] if isinstance(kind[1], str) else str(kind[1][0]))
        for field, kind in fielddefs[name][1]
    ]


def _read_ros1(data: memoryview, log_ns: int, is_static: bool) -> tuple[TransformStamped, ...]:
    (count,) = _WORD.unpack_from(data)
    at = 4
    transforms = []
    for _ in range(count):
        seconds, nanoseconds, length = struct.unpack_from("<III", data, at + 4)
        at += 16
        parent = _text(data, at, length)
        at += length
        (length,) = _WORD.unpack_from(data, at)
        child = _text(data, at + 4, length)
        at += 4 + length
        pose = _POSE.unpack_from(data, at)
        at += 56
        stamp_ns = seconds * 1_000_000_000 + nanoseconds or log_ns
        transforms.append(TransformStamped(stamp_ns, parent, child, pose[:3], pose[3:], is_static))
    _end(data, at)
    return tuple(transforms)


def _read_cdr(data: memoryview, log_ns: int, is_static: bool) -> tuple[TransformStamped, ...]:
    if bytes(data[:2]) != b"\0\1":
        raise struct.error("not little-endian CDR")
    body = data[4:]  # alignment counts from the end of the encapsulation
    (count,) = _WORD.unpack_from(body)
    at = 4
    transforms = []
    for _ in range(count):
        at += -at % 4
        seconds, nanoseconds, length = struct.unpack_from("<iII", body, at)
        at += 12
        parent = _text(body, at, max(length - 1, 0))
        at += length
        at += -at % 4
        (length,) = _WORD.unpack_from(body, at)
        child = _text(body, at + 4, max(length - 1, 0))
        at += 4 + length
        at += -at % 8
        pose = _POSE.unpack_from(body, at)
        at += 56
        stamp_ns = seconds * 1_000_000_000 + nanoseconds or log_ns
        transforms.append(TransformStamped(stamp_ns, parent, child, pose[:3], pose[3:], is_static))
    _end(body, at)
    return tuple(transforms)


def _text(data: memoryview, at: int, length: int) -> str:
    if not 0 <= length <= min(len(data) - at, _LONGEST_NAME):
        raise struct.error("a frame's name is longer than its message, or than is usual")
    return bytes(data[at : at + length]).decode().lstrip("/")


def _end(data: memoryview, at: int) -> None:
    # CDR may pad a message; anything more is another message than the schema's.
    if len(data) - at > 3:
        raise struct.error("the message is longer than its transforms")
