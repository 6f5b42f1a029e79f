"""Recorded images for the viewer: encoded ones are passed on, others are encoded without loss."""

from __future__ import annotations

import io

import numpy as np
import PIL.Image
import rerun as rr
from numpy.typing import NDArray

from tablemap.recording.colour import colour_pixels
from tablemap.recording.messages import CompressedImage, Image

PNG = b"\x89PNG\r\n\x1a\n"
JPEG = b"\xff\xd8\xff"
COMPRESSED_DEPTH_HEADER = 12
MILLIMETRES = 1000.0


def depth_archetype(
    message: Image | CompressedImage, depth: NDArray[np.float32]
) -> rr.EncodedDepthImage:
    """Return a depth image for the viewer, in millimetres.

    A recorded 16-bit PNG is passed on without its ROS header; anything else is ``depth`` (height,
    width) in metres, written as a 16-bit PNG.
    """
    blob = _recorded_png(message)
    if blob is None:
        blob = encode_depth(depth)
    return rr.EncodedDepthImage(
        blob, media_type="image/png", meter=MILLIMETRES, colormap=rr.components.Colormap.Viridis
    )


def is_recorded_png(message: Image | CompressedImage) -> bool:
    """Tell whether a depth image is passed on as it was recorded."""
    return _recorded_png(message) is not None


def _recorded_png(message: Image | CompressedImage) -> bytes | None:
    if not isinstance(message, CompressedImage) or message.format.strip().startswith("32FC1"):
        return None
    data = bytes(message.data)
    for skipped in (COMPRESSED_DEPTH_HEADER, 0):
        if data[skipped : skipped + len(PNG)] == PNG:
            return data[skipped:]
    return None


def encode_depth(depth: NDArray[np.float32]) -> bytes:
    """Encode (height, width) metres as a 16-bit PNG in millimetres, 0 where depth is missing."""
    millimetres = np.nan_to_num(depth * MILLIMETRES, nan=0.0, posinf=0.0, neginf=0.0)
    pixels = np.clip(np.rint(millimetres), 0, 65535).astype(np.uint16)
    buffer = io.BytesIO()
    PIL.Image.fromarray(pixels).save(buffer, format="PNG", compress_level=3)
    return buffer.getvalue()


def colour_size(message: Image | CompressedImage) -> tuple[int, int] | None:
    """Return a colour image's width and height; None if its header cannot be read."""
    if isinstance(message, Image):
        return message.width, message.height
    try:
        with PIL.Image.open(io.BytesIO(message.data)) as image:
            return image.size
    except (OSError, ValueError):
        return None


def colour_archetype(message: Image | CompressedImage) -> rr.EncodedImage | None:
    """Return a colour image for the viewer, or None if the viewer cannot show its encoding."""
    if isinstance(message, CompressedImage):
        data = bytes(message.data)
        if data.startswith(JPEG):
            return rr.EncodedImage(contents=data, media_type="image/jpeg")
        if data.startswith(PNG):
            return rr.EncodedImage(contents=data, media_type="image/png")
        return None
    jpeg = as_jpeg(message)
    return None if jpeg is None else rr.EncodedImage(contents=jpeg, media_type="image/jpeg")


def as_jpeg(message: Image) -> bytes | None:
    """Return a raw colour image as a JPEG, or None if the viewer cannot show its encoding."""
    pixels = colour_pixels(message)
    if pixels is None:
        return None
    buffer = io.BytesIO()
    PIL.Image.fromarray(np.ascontiguousarray(pixels)).save(buffer, format="JPEG", quality=85)
    return buffer.getvalue()
