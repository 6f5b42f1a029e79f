"""From a camera's recorded calibration to a pinhole, and depth images resampled to it."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablemap.errors import RecordingError
from tablemap.geometry import Floats
from tablemap.recording.messages import CameraInfo

_POLYNOMIAL = ("plumb_bob", "rational_polynomial", "")
_FISHEYE = ("equidistant", "kannala_brandt", "kannala_brandt4", "fisheye")


@dataclass(frozen=True, eq=False)
class Rectification:
    """A pinhole ``k`` (3, 3), and for each of its pixels the recorded pixel's flat index.

    ``source`` is (height, width) int64, -1 where the recorded image has no such pixel; None where
    the image already is a pinhole's.
    """

    k: Floats
    source: NDArray[np.int64] | None

    def apply(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Resample a depth image by the nearest pixel: between two depths there is no surface."""
        if self.source is None:
            return depth
        resampled = depth.ravel()[np.maximum(self.source, 0)]
        resampled[self.source < 0] = np.nan
        return resampled


def is_rectified(topic: str) -> bool:
    """Tell by its topic's name whether an image was undistorted before it was recorded."""
    words = re.split(r"[^a-z0-9]+", topic.lower())
    return "rect" in words or "rectified" in words


def rectification(info: CameraInfo, *, width: int, height: int, topic: str) -> Rectification:
    """Return how images of ``width`` x ``height`` pixels on ``topic`` become a pinhole's.

    The rule: an image whose topic says ``rect`` is taken as it is, with the matrix of P. Any other
    is a raw one, with the matrix K and the distortion D; where D is zero it is taken as it is, else
    it is resampled to the pinhole of P (of K, where P is empty or belongs to a turned camera).
    A calibration for another size of the same image is scaled. Raises `RecordingError` where the
    calibration cannot be that of a camera.
    """
    scale = _scale(info, width, height)
    rectified = is_rectified(topic)
    has_projection = info.p[0, 0] > 0 and info.p[1, 1] > 0
    k = info.p[:, :3] if rectified and has_projection else info.k
    _check(k, width / scale, height / scale)
    if rectified or not np.any(np.nan_to_num(info.d)):
        return Rectification(_scaled(k, scale), None)
    if has_projection and np.allclose(info.r, np.eye(3), atol=1e-6):
        target = info.p[:, :3]
        _check(target, width / scale, height / scale)
    else:
        target = info.k
    source = _source_pixels(info, _scaled(info.k, scale), _scaled(target, scale), width, height)
    return Rectification(_scaled(target, scale), source)


def _scale(info: CameraInfo, width: int, height: int) -> float:
    if info.width <= 0 or info.height <= 0:
        return 1.0  # the size was left out
    across, down = width / info.width, height / info.height
    if abs(across - down) > 0.01 * max(across, down):
        raise RecordingError(
            f"The depth image has {width} x {height} pixels, its calibration is for {info.width} x "
            f"{info.height}, which is no enlargement of it; choose the depth camera's own "
            "calibration with --set topics.calibration=TOPIC."
        )
    return across


def _scaled(k: Floats, scale: float) -> Floats:
    scaled = np.array(k, dtype=np.float64)
    scaled[:2] *= scale
    scaled[:2, 2] += 0.5 * (scale - 1)  # pixel centres lie at whole numbers
    return scaled


def _check(k: Floats, width: float, height: float) -> None:
    fx, fy, cx, cy = k[0, 0], k[1, 1], k[0, 2], k[1, 2]
    if not np.all(np.isfinite(k)) or fx <= 0 or fy <= 0:
        raise RecordingError(
            f"The depth camera's calibration has the focal lengths {fx:g} and {fy:g} pixels, which "
            "no camera has; record a calibrated camera_info, or choose another with "
            "--set topics.calibration=TOPIC."
        )
    if not (0 < cx < width and 0 < cy < height):
        raise RecordingError(
            f"The depth camera's calibration has its principal point at ({cx:g}, {cy:g}) in an "
            f"image of {width:g} x {height:g} pixels, as some simulators leave it unset; record "
            "the true one, or choose another calibration with --set topics.calibration=TOPIC."
        )


def _source_pixels(
    info: CameraInfo, k: Floats, target: Floats, width: int, height: int
) -> NDArray[np.int64]:
    u, v = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    x, y = (u - target[0, 2]) / target[0, 0], (v - target[1, 2]) / target[1, 1]
    x, y = _distorted(x, y, info.d, info.distortion_model.lower())
    column = np.rint(k[0, 0] * x + k[0, 2])
    row = np.rint(k[1, 1] * y + k[1, 2])
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    source = np.full((height, width), -1, dtype=np.int64)
    source[inside] = (row[inside] * width + column[inside]).astype(np.int64)
    return source


def _distorted(x: Floats, y: Floats, d: Floats, model: str) -> tuple[Floats, Floats]:
    """Apply a lens's distortion to normalised image coordinates (the models of OpenCV)."""
    coefficients = np.zeros(12)
    coefficients[: min(len(d), 12)] = np.nan_to_num(d[:12])
    r2 = x * x + y * y
    if model in _FISHEYE:
        k1, k2, k3, k4 = coefficients[:4]
        r = np.sqrt(r2)
        t = np.arctan(r)
        t2 = t * t
        bent = t * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
        stretch = np.where(r > 1e-12, bent / np.maximum(r, 1e-12), 1.0)
        return x * stretch, y * stretch
    if model not in _POLYNOMIAL:
        raise RecordingError(
            f"The depth camera's distortion model {model!r} is not known; expected plumb_bob, "
            "rational_polynomial or equidistant. Record the rectified depth image."
        )
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = coefficients
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    bent_x = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2)
    bent_y = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4)
    return bent_x, bent_y
