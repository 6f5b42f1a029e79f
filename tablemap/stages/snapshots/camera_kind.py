"""The kind of a depth camera, as its images show it: by the steps of depth, and by its noise.

A camera that triangulates measures a disparity: the noise of its depth, and the steps where they
are seen, grow with the square of the distance. The steps of structured light are eighths of a pixel
(Khoshelham and Elberink, Sensors 2012), those of stereo are finer. The noise of a time-of-flight
camera is less, grows about linearly, more where dark or slanted surfaces are the far ones, and its
steps are the millimetres of the encoding.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tablemap.config import DepthCamera
from tablemap.geometry import Floats
from tablemap.robust import mad_sigma
from tablemap.stages.snapshots.noise import LAG_PX, SLAB_M, value_steps
from tablemap.stages.snapshots.result import UNKNOWN_CAMERA, SeenCamera

_MOST_VIEWS = 6
_NEAREST, _FARTHEST = 0.8, 4.0  # metres
_FEWEST_SLABS, _LEAST_PIXELS = 5, 500
_FINE = 0.0015  # metres: a step of the encoding, and none of the camera
_COARSE = 0.008  # metres at two metres: eighths of a pixel at a projector's baseline
_GROWS, _SQUARE = 1.3, 1.5  # powers of the distance
_TIME_OF_FLIGHT = ((1.35, 0.006), (1.6, 0.0045))  # powers, and the most noise at two metres, metres


def looked_at(views: int) -> set[int]:
    """Return which of so many views are looked at: a few, evenly spread."""
    return set(np.linspace(0, views - 1, min(_MOST_VIEWS, views)).astype(int).tolist())


def seen_camera(depths: Sequence[NDArray[np.float32]]) -> SeenCamera:
    """Tell the kind of the camera by some of its single images (height, width), metres."""
    rows = [row for depth in depths for row in _by_range(depth)]
    if not rows:
        return UNKNOWN_CAMERA
    range_m, noise, step = np.array(rows).T
    distances = np.unique(range_m)
    if len(distances) < _FEWEST_SLABS:
        return UNKNOWN_CAMERA
    noises = np.array([np.median(noise[range_m == each]) for each in distances])
    steps = np.array([np.median(step[range_m == each]) for each in distances])
    shown = noises > 0  # coarse steps hide the noise
    if shown.sum() < _FEWEST_SLABS:
        return UNKNOWN_CAMERA
    power, at_one = np.polyfit(np.log(distances[shown]), np.log(noises[shown]), 1)
    at_two = float(np.interp(2.0, distances, steps))
    seen = SeenCamera(None, float(np.exp(at_one) * 2**power), float(power), at_two)
    return SeenCamera(_kind(seen, distances, steps), seen.noise, seen.power, seen.step)


def _kind(seen: SeenCamera, distances: Floats, steps: Floats) -> DepthCamera | None:
    if seen.step > _FINE:
        stepped = steps > 0
        if stepped.sum() < _FEWEST_SLABS:
            return None
        growth = float(np.polyfit(np.log(distances[stepped]), np.log(steps[stepped]), 1)[0])
        if growth <= _GROWS:
            return None
        return "structured_light" if seen.step > _COARSE else "stereo"
    if any(seen.power < power and seen.noise < most for power, most in _TIME_OF_FLIGHT):
        return "time_of_flight"
    return "stereo" if seen.power > _SQUARE else None


def _by_range(depth: NDArray[np.float32]) -> list[tuple[float, float, float]]:
    """Return (range, noise, step) in metres of each slab of range that many pixels show."""
    slab = np.where(np.isfinite(depth), depth / SLAB_M, 0).astype(np.int32)
    steps = value_steps(depth, int(slab.max()) + 1)
    rows = depth[::2]
    if depth.shape[1] <= 2 * LAG_PX:
        return []
    middle = rows[:, LAG_PX:-LAG_PX]
    bend = np.abs(rows[:, : -2 * LAG_PX] - 2 * middle + rows[:, 2 * LAG_PX :])
    smooth = bend < 0.05 * middle  # NaN compares false
    bends, slabs = bend[smooth], slab[::2, LAG_PX:-LAG_PX][smooth]
    found = []
    for k in range(int(_NEAREST / SLAB_M), min(int(_FARTHEST / SLAB_M), len(steps))):
        own = bends[slabs == k]
        if len(own) >= _LEAST_PIXELS:
            sigma = mad_sigma(own) / np.sqrt(6)
            found.append(((k + 0.5) * SLAB_M, float(sigma), float(steps[k])))
    return found
