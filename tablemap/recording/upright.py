"""Images of a camera that is mounted on its side or upside down, turned upright.

Everything after the reading may then take rows for levels and columns for bearings.
"""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import PIL.Image
from numpy.typing import NDArray

from tablemap.geometry import Floats
from tablemap.recording.colour import colour_pixels
from tablemap.recording.messages import CompressedImage, Image

_LEAST_UP = 0.3  # of the vertical lies in the image: one that looks straight down has no upright


def quarter_turns(base_from_cameras: Floats) -> int:
    """Return by how many quarter turns, counter-clockwise, images (n, 4, 4) must be turned.

    It is the same for a whole recording: what most of its images ask for.
    """
    across, down = base_from_cameras[:, 2, 0], base_from_cameras[:, 2, 1]
    clear = np.hypot(across, down) > _LEAST_UP
    if not clear.any():
        return 0
    asked = np.rint(np.arctan2(across[clear], -down[clear]) / (np.pi / 2)).astype(np.int64) % 4
    return int(np.bincount(asked, minlength=4).argmax())


def turned_image(depth: NDArray[np.float32], turns: int) -> NDArray[np.float32]:
    """Turn an image (height, width) counter-clockwise."""
    return np.ascontiguousarray(np.rot90(depth, turns))


def turned_pinhole(k: Floats, width: int, height: int, turns: int) -> Floats:
    """Return the pinhole (3, 3) of an image of a width and height after its turns."""
    for _ in range(turns % 4):
        k = np.array(
            [[k[1, 1], 0.0, k[1, 2]], [0.0, k[0, 0], width - 1 - k[0, 2]], [0.0, 0.0, 1.0]]
        )
        width, height = height, width
    return k


def turned_mounting(base_from_camera: Floats, turns: int) -> Floats:
    """Return the pose (4, 4) of the optical frame of an image after its turns."""
    quarter = np.array(
        [[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    )
    return np.asarray(base_from_camera @ np.linalg.matrix_power(quarter, turns % 4))


def depth_message(message: Image | CompressedImage, depth: NDArray[np.float32]) -> Image:
    """Return a message with a turned image (height, width) in metres in place of its own."""
    height, width = depth.shape
    return Image(
        message.stamp_ns,
        message.frame_id,
        height,
        width,
        "32FC1",
        False,
        4 * width,
        np.ascontiguousarray(depth, dtype="<f4").tobytes(),
    )


def turned_colour(message: Image | CompressedImage, turns: int) -> Image | CompressedImage:
    """Turn a colour image; one that cannot be read comes back as it is."""
    pixels = colour_pixels(message)
    if pixels is None:
        return message
    pixels = np.ascontiguousarray(np.rot90(pixels, turns))
    if isinstance(message, CompressedImage):
        buffer = io.BytesIO()
        PIL.Image.fromarray(pixels).save(buffer, format="JPEG", quality=90)
        return replace(message, format="jpeg", data=buffer.getvalue())
    height, width = pixels.shape[:2]
    return replace(
        message,
        height=height,
        width=width,
        encoding="mono8" if pixels.ndim == 2 else "rgb8",
        step=pixels.size // height,
        data=pixels.tobytes(),
    )
