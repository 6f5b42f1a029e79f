"""Colour images as pixels."""

from __future__ import annotations

import io

import numpy as np
import PIL.Image
from numpy.typing import NDArray

from tablemap.recording.messages import CompressedImage, Image

_CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono8": 1, "8UC1": 1, "8UC3": 3}


def colour_pixels(message: Image | CompressedImage) -> NDArray[np.uint8] | None:
    """Return the pixels (height, width, 3) in red, green and blue, or (height, width) in grey.

    Returns None for an encoding that has no colour, or data that is not what the message says.
    """
    if isinstance(message, CompressedImage):
        try:
            with PIL.Image.open(io.BytesIO(message.data)) as picture:
                return np.asarray(picture.convert("RGB"))
        except (OSError, ValueError, SyntaxError, PIL.Image.DecompressionBombError):
            return None
    channels = _CHANNELS.get(message.encoding)
    if channels is None or len(message.data) < message.height * message.step:
        return None
    rows = np.frombuffer(message.data, dtype=np.uint8, count=message.height * message.step)
    used = message.width * channels
    if message.step < used:
        return None
    pixels = rows.reshape(message.height, message.step)[:, :used]
    pixels = pixels.reshape(message.height, message.width, channels)
    if message.encoding.startswith("bgr") or message.encoding == "8UC3":
        pixels = pixels[..., [2, 1, 0]]
    return pixels[..., 0] if channels == 1 else pixels[..., :3]
