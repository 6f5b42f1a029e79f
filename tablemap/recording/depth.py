"""Depth images of any encoding -> metres along the optical axis, NaN where nothing was measured.

``16UC1`` and ``mono16`` are millimetres, ``32FC1`` metres. ``compressedDepth`` puts twelve bytes
(an int32 and the float32 pair A, B) before a PNG or RVL image; for 32FC1 the values v stand for
A / (v - B), as in compressed_depth_image_transport.
"""

from __future__ import annotations

import io
import struct

import numpy as np
import PIL.Image
from numpy.typing import NDArray

from tablemap.recording.messages import CompressedImage, DecodingError, Image
from tablemap.recording.rvl import decode_rvl

_FARTHEST = 1e5  # no camera measures so far, even if the values are in millimetres by mistake
_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8\xff"
_HEADER = struct.Struct("<iff")
_RAW_TYPES = {"16uc1": "u2", "mono16": "u2", "32fc1": "f4"}


def depth_encoding(message: Image | CompressedImage) -> str | None:
    """Return ``16UC1`` or ``32FC1`` if an image may contain depth, None if it cannot."""
    if isinstance(message, Image):
        pixel = _RAW_TYPES.get(message.encoding.lower())
        return None if pixel is None else "16UC1" if pixel == "u2" else "32FC1"
    if is_jpeg(message):
        return None
    declared = message.format.lower()
    if "32fc1" in declared:
        return "32FC1"
    if "16uc1" in declared or "mono16" in declared:
        return "16UC1"
    data = bytes(message.data[:40])
    if "compresseddepth" in declared or "rvl" in declared or data[12:20] == _PNG:
        quantised = len(data) >= _HEADER.size and _HEADER.unpack_from(data)[1] != 0.0
        return "32FC1" if quantised else "16UC1"
    if data[:8] == _PNG and data[24:26] == b"\x10\x00":  # 16 bits, grey
        return "16UC1"
    return None


def is_jpeg(message: CompressedImage) -> bool:
    """Tell whether an image is a JPEG, which keeps eight bits of a picture and so no depth."""
    data = bytes(message.data[: _HEADER.size + len(_JPEG)])
    return data.startswith(_JPEG) or data[_HEADER.size :] == _JPEG


def is_lossless(message: Image | CompressedImage) -> bool:
    """Tell whether the values are exactly those of the camera."""
    return isinstance(message, Image) or depth_encoding(message) == "16UC1"


def decode_depth(message: Image | CompressedImage) -> NDArray[np.float32]:
    """Return (height, width) metres, NaN for 0, infinity and the largest 16-bit value.

    Raises `DecodingError` where the data is not what the message says.
    """
    encoding = depth_encoding(message)
    if encoding is None:
        kind = message.encoding if isinstance(message, Image) else message.format
        raise DecodingError(f"is an image of encoding {kind!r}, which is no depth")
    try:
        if isinstance(message, Image):
            return _in_metres(_raw_pixels(message))
        return _compressed_metres(message, encoding)
    except (ValueError, struct.error, OSError, SyntaxError, PIL.Image.DecompressionBombError) as e:
        raise DecodingError(f"is a depth image that cannot be decoded ({e})") from e


def _raw_pixels(message: Image) -> NDArray[np.uint16] | NDArray[np.float32]:
    pixel = np.dtype((">" if message.is_bigendian else "<") + _RAW_TYPES[message.encoding.lower()])
    height, width = message.height, message.width
    _check_size(width, height)
    step = message.step or width * pixel.itemsize
    if step < width * pixel.itemsize or len(message.data) < step * (height - 1) + (
        width * pixel.itemsize
    ):
        raise ValueError(f"{len(message.data)} bytes are too few for {width} x {height} pixels")
    rows = np.ndarray((height, width), pixel, message.data, strides=(step, pixel.itemsize))
    return rows.astype(pixel.newbyteorder("="))


def _compressed_metres(message: CompressedImage, encoding: str) -> NDArray[np.float32]:
    data = memoryview(message.data)
    if data[:8] == _PNG:
        return _in_metres(_png_pixels(data))
    _, a, b = _HEADER.unpack_from(data)
    body = data[_HEADER.size :]
    if body[:8] == _PNG:
        values = _png_pixels(body)
    else:
        columns, rows = struct.unpack_from("<II", body)
        _check_size(columns, rows)
        values = decode_rvl(body[8:], pixels=columns * rows).reshape(rows, columns)
    if encoding == "16UC1":
        return _in_metres(values)
    with np.errstate(divide="ignore"):
        metres = np.float32(a) / (values.astype(np.float32) - np.float32(b))
    metres[values == 0] = np.nan
    return _in_metres(metres)


def _png_pixels(data: memoryview) -> NDArray[np.uint16]:
    with PIL.Image.open(io.BytesIO(data), formats=("PNG",)) as picture:
        _check_size(*picture.size)
        pixels = np.asarray(picture)
    if pixels.ndim != 2:
        raise ValueError("the PNG has colours")
    return pixels.astype(np.uint16, copy=False)


def _check_size(width: int, height: int) -> None:
    if width <= 0 or height <= 0:
        raise ValueError(f"a size of {width} x {height} pixels")


def _in_metres(values: NDArray[np.uint16] | NDArray[np.float32]) -> NDArray[np.float32]:
    if values.dtype == np.uint16:
        metres = values.astype(np.float32) * np.float32(0.001)
        metres[(values == 0) | (values == 0xFFFF)] = np.nan
        return metres
    depth = np.asarray(values, dtype=np.float32)
    with np.errstate(invalid="ignore"):  # damaged pixels may be NaNs that signal
        depth[~((depth > 0) & (depth < _FARTHEST))] = np.nan
    return depth
