"""Point clouds of cameras -> depth images: an organised cloud is an image that was unprojected.

The pinhole of that image follows from the cloud's rows and columns, as every point fulfils
u = fx x/z + cx and v = fy y/z + cy up to a rounding error.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats, Ints

_FLOATS = {7: "f4", 8: "f8"}  # PointField's and Foxglove's numbers agree
_PIXELS_OFF = 0.2  # pixels, largest distance of a camera's point from its pixel
_FEWEST = 50  # points for a fit
_FITTED = 4000  # points that are enough for it
_SMALLEST = 8  # rows and columns of an image


@dataclass(frozen=True, eq=False)
class CloudDepth:
    """The depth image from which a cloud was made.

    - ``depth``: (height, width) float32, metres along the optical axis, NaN where missing
    - ``k``: (3, 3), the pinhole
    - ``is_body``: whether the cloud's x axis points forward, as in a body's frame, not its z axis
    """

    depth: NDArray[np.float32]
    k: Floats
    is_body: bool


def depth_of_cloud(
    fields: Iterable[tuple[str, int, int]],
    data: bytes | memoryview,
    *,
    count: int,
    strides: tuple[int, int],
    width: int | None,
    is_bigendian: bool,
) -> CloudDepth:
    """Return the depth image of an organised cloud.

    ``fields`` are (name, offset, type), ``count`` is the number of points, and ``strides`` are the
    bytes of a row and of a point. If ``width`` is None, the rows follow each other without gaps,
    and their length is searched. Raises `ValueError` if the cloud is not from a camera.
    """
    if width is not None and (width < _SMALLEST or count < _SMALLEST * width):
        raise ValueError("a point cloud without rows and columns, from which no image can be told")
    columns = width or count
    if columns <= 0:
        raise ValueError("a point cloud without points")
    with np.errstate(invalid="ignore"):  # damaged points may be NaNs that signal
        x, y, z = _coordinates(fields, data, (count // columns, columns), strides, is_bigendian)
    widths = [columns] if width else _divisors(count)
    # Optical axes first: right, down, forward. Then a body's: forward, left, up.
    for is_body, right, down, forward in ((False, x, y, z), (True, -y, -z, x)):
        for each in widths:
            shape = (-1, each)
            k = _pinhole(right.reshape(shape), down.reshape(shape), forward.reshape(shape))
            if k is not None:
                depth = forward.reshape(shape).astype(np.float32)
                depth[~(np.isfinite(depth) & (depth > 0))] = np.nan
                return CloudDepth(depth, k, is_body)
    raise ValueError("a point cloud that is no camera's: its points lie on no pinhole's pixels")


def _coordinates(
    fields: Iterable[tuple[str, int, int]],
    data: bytes | memoryview,
    shape: tuple[int, int],
    strides: tuple[int, int],
    is_bigendian: bool,
) -> tuple[Floats, Floats, Floats]:
    places = {name: (offset, kind) for name, offset, kind in fields}
    found = []
    for name in "xyz":
        offset, kind = places.get(name, (0, 0))
        if kind not in _FLOATS:
            raise ValueError(f"a point cloud without the coordinate {name} as a number")
        pixel = np.dtype((">" if is_bigendian else "<") + _FLOATS[kind])
        end = offset + strides[0] * (shape[0] - 1) + strides[1] * (shape[1] - 1) + pixel.itemsize
        if min(offset, *strides) < 0 or end > len(data):
            raise ValueError(f"{len(data)} bytes are too few for {shape[0] * shape[1]} points")
        found.append(np.ndarray(shape, pixel, data, offset, strides).astype(np.float64))
    return found[0], found[1], found[2]


def _divisors(count: int) -> Sequence[int]:
    """Return the lengths that the rows of an image of so many pixels may have."""
    possible = np.arange(_SMALLEST, count // _SMALLEST + 1)
    return [int(each) for each in possible[count % possible == 0]] if len(possible) else []


def _pinhole(right: Floats, down: Floats, forward: Floats) -> Floats | None:
    """Return the pinhole that puts the points (height, width) on their pixels; None without one.

    A few points rule out most wrong widths and axes; only the others are tried on more points.
    """
    k: Floats | None = None
    for most in (2 * _FEWEST, _FITTED):
        step = max(1, int(np.sqrt(forward.size / most)))
        rows, columns = np.meshgrid(
            np.arange(step // 2, forward.shape[0], step),
            np.arange(step // 2, forward.shape[1], step),
            indexing="ij",
        )
        z = forward[rows, columns]
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = right[rows, columns] / z, down[rows, columns] / z
        sound = np.isfinite(a) & np.isfinite(b) & (z > 0)
        if np.count_nonzero(sound) < _FEWEST // 2:
            continue
        across, along = _line(a[sound], columns[sound]), _line(b[sound], rows[sound])
        if across is None or along is None:
            return None
        k = np.array([[across[0], 0.0, across[1]], [0.0, along[0], along[1]], [0.0, 0.0, 1.0]])
    return k


def _line(tangents: Floats, pixels: Ints) -> tuple[float, float] | None:
    """Return focal length and centre in pixels = focal tangents + centre; None if this fails."""
    if np.ptp(tangents) == 0 or np.ptp(pixels) == 0:
        return None
    focal, centre = np.polyfit(tangents, pixels, 1)
    off = np.abs(focal * tangents + centre - pixels)
    return (float(focal), float(centre)) if focal > 0 and off.max() <= _PIXELS_OFF else None
