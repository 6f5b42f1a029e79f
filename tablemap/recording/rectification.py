"""From a camera's recorded calibration to a pinhole, and depth images resampled to it."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablemap.errors import RecordingError
from tablemap.geometry import Floats, Ints
from tablemap.recording.messages import CameraInfo

_POLYNOMIAL = ("plumb_bob", "rational_polynomial", "")
PLAUSIBLE_STRETCH = (0.4, 2.0)
"""Largest plausible stretch: distance of a corner from the middle by lens over that by pinhole."""
_FISHEYE = ("equidistant", "kannala_brandt", "kannala_brandt4", "fisheye")


@dataclass(frozen=True, eq=False)
class Rectification:
    """A pinhole ``k`` (3, 3), and for each of its pixels the recorded pixel's flat index.

    ``source`` is (height, width) int64, -1 where the recorded image has no such pixel; None where
    the image already is a pinhole's.
    """

    k: Floats
    source: Ints | None

    def apply(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Resample a depth image by nearest pixels, as there is no surface between two depths."""
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
    """Return the rectification of images of ``width`` x ``height`` pixels on ``topic``.

    An image whose topic contains ``rect`` is taken as it is, with the matrix of P. Any other image
    is raw, with the matrix K and the distortion D. If D is zero, the raw image is taken as it is.
    Otherwise it is resampled to the pinhole of P, or of K if P is empty or belongs to a turned
    camera. A calibration for another size of the same image is scaled; one for a window of it is
    moved. Raises `RecordingError` if the calibration cannot be that of a camera.
    """
    window = fitting_window(info, width, height)
    rectified = is_rectified(topic)
    k = used_matrix(info, rectified=rectified)
    _check(k, *window.size)
    if rectified or not np.any(np.nan_to_num(info.d)):
        return Rectification(window.seen(k), None)
    if _has_projection(info) and np.allclose(info.r, np.eye(3), atol=1e-6):
        target = info.p[:, :3]
        _check(target, *window.size)
    else:
        target = info.k
    source = _source_pixels(info, window.seen(info.k), window.seen(target), width, height)
    return Rectification(window.seen(target), source)


def used_matrix(info: CameraInfo, *, rectified: bool) -> Floats:
    """Return the camera matrix (3, 3) of images: P's of rectified ones, else K."""
    return info.p[:, :3] if rectified and _has_projection(info) else info.k


def flaw(info: CameraInfo, *, rectified: bool) -> str | None:
    """Return why this is no camera's calibration, as the end of a sentence; None if it is one.

    Distortion coefficients are not those of a lens if they make the image fold over itself, or
    stretch it by more than `PLAUSIBLE_STRETCH`. For ``rectified`` images they do not matter.
    """
    k = used_matrix(info, rectified=rectified)
    if not np.all(np.isfinite(k)) or k[0, 0] <= 0 or k[1, 1] <= 0:
        return f"has the focal lengths {k[0, 0]:g} and {k[1, 1]:g} pixels"
    model = info.distortion_model.lower()
    if rectified or not np.any(np.nan_to_num(info.d)) or model not in (*_POLYNOMIAL, *_FISHEYE):
        return None
    width, height = info.width or 2 * k[0, 2], info.height or 2 * k[1, 2]
    share = np.linspace(0.02, 1.0, 50)
    corners = np.array([(0, 0), (width, 0), (0, height), (width, height)], dtype=np.float64)
    x = share[:, None] * (corners[:, 0] - info.k[0, 2]) / info.k[0, 0]
    y = share[:, None] * (corners[:, 1] - info.k[1, 2]) / info.k[1, 1]
    with np.errstate(all="ignore"):
        bent = np.hypot(*_distorted(x, y, info.d, model))
        stretch = bent / np.hypot(x, y)
    steady = np.all(np.diff(bent, axis=0) > 0)
    low, high = PLAUSIBLE_STRETCH
    if steady and np.all((stretch > low) & (stretch < high)):
        return None
    shown = ", ".join(f"{value:.4g}" for value in info.d[:8])
    return f"has distortion coefficients that no lens has (D = {shown})"


def _has_projection(info: CameraInfo) -> bool:
    return bool(info.p[0, 0] > 0 and info.p[1, 1] > 0)


@dataclass(frozen=True)
class PixelWindow:
    """The part of a calibrated image of a ``size``, and its scale, that another image shows."""

    size: tuple[int, int]
    left: float = 0.0
    top: float = 0.0
    across: float = 1.0
    down: float = 1.0

    def seen(self, k: Floats) -> Floats:
        """Return the camera matrix (3, 3) for the window."""
        seen = np.array(k, dtype=np.float64)
        seen[:2, 2] -= self.left, self.top
        seen[0] *= self.across
        seen[1] *= self.down
        # Pixel centres lie at whole numbers.
        seen[:2, 2] += 0.5 * (self.across - 1), 0.5 * (self.down - 1)
        return seen


def fitting_window(info: CameraInfo, width: int, height: int) -> PixelWindow:
    """Return the part of the calibrated image that an image of ``width`` x ``height`` pixels shows.

    Region of interest and binning count if the image has their size, as defined in
    sensor_msgs/CameraInfo. But some drivers also set them for an image of all pixels, or state the
    window's size instead of the sensor's. Of all interpretations that fit, the one with the
    principal point nearest to the middle is taken. Raises `RecordingError` if none fits.
    """
    size = (info.width, info.height)
    if min(size) <= 0:
        return PixelWindow((width, height))  # the size was left out
    regions = [(0, 0, *size)] if info.roi is None else [info.roi, (0, 0, *size)]
    exact = [
        PixelWindow(size, float(left), float(top), 1 / across, 1 / down)
        for left, top, wide, high in regions
        for across, down in dict.fromkeys(((1, 1), info.binning))
        if abs(wide / across - width) < 1 and abs(high / down - height) < 1
    ]
    if info.binning != (1, 1) and (width, height) == size:
        by_x, by_y = info.binning
        sensor = (width * by_x, height * by_y)
        exact.append(PixelWindow(sensor, 0.0, 0.0, 1 / by_x, 1 / by_y))
    if exact:
        return min(exact, key=lambda window: _off_centre(window.seen(info.k), width, height))
    for region in regions:
        scale, other = width / region[2], height / region[3]
        if abs(scale - other) <= 0.01 * max(scale, other):
            return PixelWindow(size, float(region[0]), float(region[1]), scale, scale)
    shown = f", of which it shows {info.roi[2]} x {info.roi[3]}" if info.roi is not None else ""
    raise RecordingError(
        f"The depth image has {width} x {height} pixels, its calibration is for {info.width} x "
        f"{info.height}{shown}, which is no enlargement of it; choose the depth camera's own "
        "calibration with --set topics.calibration=TOPIC."
    )


def _off_centre(k: Floats, width: int, height: int) -> float:
    """Return the distance of the principal point from the middle, as a share of the image."""
    return float(np.hypot(k[0, 2] / width - 0.5, k[1, 2] / height - 0.5))


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


def _source_pixels(info: CameraInfo, k: Floats, target: Floats, width: int, height: int) -> Ints:
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
