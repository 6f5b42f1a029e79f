"""What the floor says of a depth camera before anything is modelled: its scale, bow and slope.

A robot's camera sees much floor, and TF says where that should be. A few images, thinned, are
enough to tell whether depth and calibration mean what they are taken for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats

THINNED_TO = 60  # rows of an image that are looked at
MOST_VIEWS = 6

_BELOW = 0.1  # a ray that sinks by less per metre meets the floor too far away
_BIN = 0.01  # of the logarithm of the ratio
_LOGS = (-3.0, 8.0)
_LEAST_SHARE = 0.08  # of all that lies below the horizon: less is no floor
_NEAR = 3.0  # metres, within which the floor is fitted
_BANDS = (0.06, 0.04, 0.03, 0.02, 0.02, 0.02)
_FEWEST = 100

HEIGHT_SIGMA = 0.012
"""Metres that the floor may lie off: the camera's height in TF and the depth's scale together."""
TILT_SIGMA = np.radians(0.4)
_HELD_HEIGHT_SIGMA = 0.03  # metres, for a camera that is held by hand
_HELD_TILT_SIGMA = np.radians(1.0)
_HELD_ROLL = np.radians(2.0)


@dataclass(frozen=True, eq=False)
class FloorView:
    """A thinned depth image: (n,) values as decoded, the (n, 3) rays of its pixels with z = 1.

    ``base_from_camera``: (4, 4), of the optical frame. ``step``: metres between depths.
    """

    values: Floats
    rays: Floats
    base_from_camera: Floats
    step: float


@dataclass(frozen=True)
class Ratio:
    """Depth as a share of that of the floor, where most of what lies below the horizon agrees.

    ``share`` is how much of it agrees to 1.5 %; both are zero where no floor was seen.
    """

    value: float
    share: float


@dataclass(frozen=True)
class Slope:
    """Where the floor lies, relative to z = 0 of the base, below the camera.

    - ``height``: metres
    - ``tilt``: radians by which it rises ahead of the camera
    - ``doubt``: chi squared of both, of 2 degrees of freedom
    - ``camera_height``: metres
    - ``pitch``: radians by which the camera looks down
    """

    height: float
    tilt: float
    doubt: float
    camera_height: float
    pitch: float


def thinned(depth: NDArray[np.float32], k: Floats, base_from_camera: Floats) -> FloorView:
    """Return every n-th pixel of a depth image of a pinhole."""
    stride = max(depth.shape[0] // THINNED_TO, 1)
    rows = np.arange(stride // 2, depth.shape[0], stride)
    columns = np.arange(stride // 2, depth.shape[1], stride)
    v, u = np.meshgrid(rows, columns, indexing="ij")
    values = depth[v, u].astype(np.float64).ravel()
    x, y = (u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1]
    rays = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    known = np.isfinite(values)
    apart = np.diff(np.unique(values[known]))
    step = float(np.median(apart)) if len(apart) else 0.0
    return FloorView(values[known], rays[known], base_from_camera, step)


def floor_ratio(views: Sequence[FloorView], *, along_ray: bool) -> Ratio:
    """Return the largest ratio at which much of what lies below the horizon agrees.

    Nothing is seen below the floor, so it is the farthest of all level surfaces.
    """
    shares = _shares(views, along_ray=along_ray)
    wide = np.flatnonzero(shares >= max(_LEAST_SHARE, shares.max() / 3))
    if len(wide) == 0:
        return Ratio(0.0, 0.0)
    best = int(wide[-1])
    while best > 0 and shares[best - 1] > shares[best]:
        best -= 1
    return Ratio(float(np.exp(_LOGS[0] + (best + 0.5) * _BIN)), float(shares[best]))


def floor_share(
    views: Sequence[FloorView], *, along_ray: bool, ratio: float, within: float
) -> float:
    """Return how much at most agrees on one ratio, of those within a share of a given one."""
    shares = _shares(views, along_ray=along_ray)
    middle = round((np.log(ratio) - _LOGS[0]) / _BIN - 0.5)
    half = round(within / _BIN)
    return float(shares[max(middle - half, 0) : middle + half + 1].max(initial=0.0))


def _shares(views: Sequence[FloorView], *, along_ray: bool) -> Floats:
    """Return how much of what lies below the horizon agrees to 1.5 %, by the ratio's logarithm."""
    logs = [np.zeros(0)]
    for view in views:
        height = view.base_from_camera[2, 3]
        if height <= 0:
            continue
        sinks = -view.rays @ view.base_from_camera[2, :3]
        below = sinks > _BELOW
        expected = height / sinks[below]
        if along_ray:
            expected = expected * np.linalg.norm(view.rays[below], axis=1)
        logs.append(np.log(np.maximum(view.values[below], 1e-9) / expected))
    found = np.concatenate(logs)
    low, high = _LOGS
    bins = np.histogram(found, bins=round((high - low) / _BIN), range=_LOGS)[0]
    if len(found) < _FEWEST:
        bins = np.zeros_like(bins)
    return np.convolve(bins, np.ones(3), "same") / max(len(found), 1)


def floor_slope(views: Sequence[FloorView]) -> Slope | None:
    """Fit a plane to what lies near z = 0 of the base; None where that is too little.

    Points are in the camera's heading, so that a head that turns takes its error with it.
    """
    points = [np.zeros((0, 3))]
    for view in views:
        mount = view.base_from_camera
        arms = (view.rays * view.values[:, None]) @ mount[:3, :3].T
        ahead = np.arctan2(mount[1, 2], mount[0, 2])
        x = np.cos(ahead) * arms[:, 0] + np.sin(ahead) * arms[:, 1]
        y = np.cos(ahead) * arms[:, 1] - np.sin(ahead) * arms[:, 0]
        points.append(np.column_stack([x, y, arms[:, 2] + mount[2, 3]]))
    near = np.concatenate(points)
    reach = np.hypot(near[:, 0], near[:, 1])
    near, reach = near[reach < _NEAR], reach[reach < _NEAR]
    if not views:
        return None
    mounts = np.array([view.base_from_camera for view in views])
    camera = float(np.mean(mounts[:, 2, 3]))
    chosen = np.abs(near[:, 2]) < 0.06 * camera + 0.02 * reach
    plane = np.zeros(3)
    for band in _BANDS:
        if int(chosen.sum()) < _FEWEST:
            return None
        rows = np.column_stack([np.ones(len(near)), near[:, :2]])
        plane = np.linalg.lstsq(rows[chosen], near[chosen, 2], rcond=None)[0]
        chosen = np.abs(near[:, 2] - rows @ plane) < band
    height, tilt = float(plane[0]), float(np.arctan(plane[1]))
    step = float(np.median([view.step for view in views]))
    held = float(np.std(np.arcsin(np.clip(mounts[:, 2, 0], -1, 1)))) > _HELD_ROLL
    height_sigma = np.hypot(_HELD_HEIGHT_SIGMA if held else HEIGHT_SIGMA, step / 2)
    tilt_sigma = np.hypot(_HELD_TILT_SIGMA if held else TILT_SIGMA, step / 2)
    doubt = (height / height_sigma) ** 2 + (tilt / tilt_sigma) ** 2
    pitch = float(np.arcsin(np.clip(-np.mean(mounts[:, 2, 2]), -1, 1)))
    return Slope(height, tilt, float(doubt), camera, pitch)
