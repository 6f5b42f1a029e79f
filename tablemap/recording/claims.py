"""Check of a message's claimed size against the limits, before it costs memory or time.

A list of a million empty messages takes two bytes each in a recording, and a hundred in memory.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from google.protobuf.descriptor_pb2 import FieldDescriptorProto as Field

from tablemap.config import LimitsConfig
from tablemap.recording.messages import CompressedImage, Image, LaserScan

_PNG = b"\x89PNG\r\n\x1a\n"
_DEPTH_HEADER = 12  # bytes that compressedDepth puts before its image
_VARINT, _FIXED64, _BYTES, _GROUP, _GROUP_END, _FIXED32 = range(6)
_FIXED_SIZES = {
    **dict.fromkeys((Field.TYPE_DOUBLE, Field.TYPE_FIXED64, Field.TYPE_SFIXED64), 8),
    **dict.fromkeys((Field.TYPE_FLOAT, Field.TYPE_FIXED32, Field.TYPE_SFIXED32), 4),
}
_NEVER_PACKED = (Field.TYPE_STRING, Field.TYPE_BYTES)


class ClaimError(Exception):
    """A message that claims more than the limits allow; the text completes "it ..."."""


class Counted:
    """Makes objects of a type for lists; counts those of all types in a message against a limit."""

    def __init__(self, left: list[int], make: Callable[..., Any], limits: LimitsConfig) -> None:
        self._left, self._make, self._limits = left, make, limits

    def __call__(self, *values: Any) -> Any:
        """Make one."""
        self._left[0] -= 1
        if self._left[0] < 0:
            raise ClaimError(f"has too many parts, {self._limits.over('message_parts')}")
        return self._make(*values)


def check_json(data: memoryview, limits: LimitsConfig) -> bytes:
    """Return the text of a JSON message.

    Raises `ClaimError` where it has too many values.
    """
    text = bytes(data)
    if len(text) > limits.message_parts:
        parts = sum(map(text.count, (b",", b"[", b"{")))
        if parts > limits.message_parts:
            raise ClaimError(f"has {parts} parts, {limits.over('message_parts')}")
    return text


def check_protobuf(data: memoryview, descriptor: Any, limits: LimitsConfig) -> bytes:
    """Return the bytes of a protobuf message.

    Raises `ClaimError` where it has too many fields, or elements of lists.
    """
    message = bytes(data)
    if len(message) > limits.message_parts:  # an element of a packed list may take a byte
        _count_fields(message, descriptor, limits)
    return message


def _count_fields(message: bytes, descriptor: Any, limits: LimitsConfig) -> None:
    """Count the fields of a message and of its parts; stop at bytes that are no message."""
    count = 0
    waiting = [(0, len(message), descriptor)]
    while waiting:
        at, end, kind = waiting.pop()
        fields = {} if kind is None else kind.fields_by_number
        while at < end:
            count += 1
            tag, at = _varint(message, at, end)
            wire = tag & 7
            if wire == _VARINT:
                _, at = _varint(message, at, end)
            elif wire == _FIXED64:
                at += 8
            elif wire == _FIXED32:
                at += 4
            elif wire == _BYTES:
                length, at = _varint(message, at, end)
                field = fields.get(tag >> 3)
                if field is not None and field.message_type is not None:
                    waiting.append((at, min(at + length, end), field.message_type))
                elif field is not None and field.type not in _NEVER_PACKED:
                    count += _packed(message, at, min(at + length, end), field.type)
                at += length
            elif wire not in (_GROUP, _GROUP_END):
                return  # the parser will say what is wrong
            if count > limits.message_parts:
                raise ClaimError(f"has {count} parts or more, {limits.over('message_parts')}")


def _packed(message: bytes, at: int, end: int, kind: int) -> int:
    """Return how many numbers a packed list has; each of varying length ends in a low byte."""
    if size := _FIXED_SIZES.get(kind):
        return (end - at) // size
    return int(np.count_nonzero(np.frombuffer(message, np.uint8)[at:end] < 0x80))


def _varint(data: bytes, at: int, end: int) -> tuple[int, int]:
    value = shift = 0
    while at < end and shift < 70:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at += 1
        if byte < 0x80:
            break
        shift += 7
    return value, at


def check_message(message: Any, limits: LimitsConfig) -> None:
    """Raise `ClaimError` if a message has more parts than allowed, or makes no sense."""
    if isinstance(message, tuple):
        for transform in message:
            _check_name(max(transform.parent_frame, transform.child_frame, key=len), limits)
        return
    _check_name(message.frame_id, limits)
    if isinstance(message, Image):
        _check_pixels(message.width, message.height, limits)
    elif isinstance(message, CompressedImage):
        size = declared_size(message)
        if size is not None:
            _check_pixels(*size, limits)
    elif isinstance(message, LaserScan):
        if len(message.ranges) > limits.beams:
            raise ClaimError(f"has {len(message.ranges)} beams, {limits.over('beams')}")
        angles = message.angle_min, message.angle_max, message.angle_increment
        if not all(map(math.isfinite, angles)):
            raise ClaimError("is a laser scan whose angles are no numbers")


def check_points(message: Any, limits: LimitsConfig) -> None:
    """Raise `ClaimError` where a parsed point cloud has more points than an image may have."""
    if hasattr(message, "point_step"):
        count = int(message.width) * int(message.height)
    elif hasattr(message, "point_stride"):
        count = len(message.data) // max(int(message.point_stride), 1)
    else:
        return
    if count > limits.pixels:
        raise ClaimError(f"is a cloud of {count} points, {limits.over('pixels')}")


def declared_size(message: CompressedImage) -> tuple[int, int] | None:
    """Return the declared width and height of a PNG or RVL image; None for others."""
    data = message.data
    for skipped in (0, _DEPTH_HEADER):
        if bytes(data[skipped : skipped + len(_PNG)]) == _PNG:
            head = bytes(data[skipped + 16 : skipped + 24])
            return struct.unpack(">II", head) if len(head) == 8 else None
    if "rvl" in message.format.lower() or "compresseddepth" in message.format.lower():
        head = bytes(data[_DEPTH_HEADER : _DEPTH_HEADER + 8])
        return struct.unpack("<II", head) if len(head) == 8 else None
    return None


def _check_name(name: str, limits: LimitsConfig) -> None:
    if len(name) > limits.name_bytes:
        raise ClaimError(f"has a frame of {len(name)} letters, {limits.over('name_bytes')}")


def _check_pixels(width: int, height: int, limits: LimitsConfig) -> None:
    if width * height > limits.pixels:
        raise ClaimError(f"is an image of {width} x {height} pixels, {limits.over('pixels')}")
