"""The kind of a depth camera, as its images show it: by the steps of depth, and by its noise.

A camera that triangulates measures a disparity, in whole steps of a pixel's part: eighths for
structured light (Khoshelham and Elberink, Sensors 2012), finer ones for stereo. The inverse of its
depth is a comb, of the same pitch at all distances; where the depth image bends, only its place
differs from one part of the image to the next. So the comb's frequency is looked for in blocks.
Without a comb the noise tells: that of a triangulation grows with the square of the distance, that
of a time-of-flight camera is less, and grows about linearly, more where dark or slanted surfaces
are the far ones. A driver that averages over neighbours lowers any camera's noise and hides its
comb; neighbours then share their noise, which does not tell time of flight. Where little light
comes back, the noise of time of flight grows with the square of the distance, too; but no stereo
camera has neighbouring pixels with independent noise (see `matching`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from tablemap.config import DepthCamera
from tablemap.robust import mad_sigma, medians
from tablemap.stages.snapshots.matching import matching_window
from tablemap.stages.snapshots.noise import LAG_PX, SLAB_M, value_steps
from tablemap.stages.snapshots.result import UNKNOWN_CAMERA, SeenCamera

_MOST_VIEWS = 6
_NEAREST, _FARTHEST = 0.8, 4.0  # metres
_FEWEST_SLABS, _LEAST_PIXELS = 5, 500
_FINE = 0.0015  # metres: a step of the encoding, and none of the camera
_COARSE = 0.008  # metres at two metres: eighths of a pixel at a projector's baseline
_SQUARE = 1.5  # power of the distance
_TRIANGULATED = 0.6  # least power; less is a filter's noise, not that of matching windows
_SMOOTHED = 0.7  # noise between next pixels as a share of all: .47 for a mean of three pixels
_INDEPENDENT, _MOST_ALONE = 0.9, 0.008  # the same share, and metres of noise at two metres
_TIME_OF_FLIGHT = ((1.35, 0.006), (1.6, 0.0045))  # powers, and the most noise at two metres, metres


def looked_at(views: int) -> set[int]:
    """Return which of so many views are looked at: a few, evenly spread."""
    return set(np.linspace(0, views - 1, min(_MOST_VIEWS, views)).astype(int).tolist())


def seen_camera(depths: Sequence[NDArray[np.float32]]) -> SeenCamera:
    """Tell the kind of the camera by some of its single images (height, width), metres."""
    rows = [row for depth in depths for row in _by_range(depth)]
    if not rows:
        return UNKNOWN_CAMERA
    range_m, noise, step, rough = np.array(rows).T
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
    comb = _comb(depths)
    seen = SeenCamera(
        None,
        float(np.exp(at_one) * 2**power),
        float(power),
        at_two if comb is None else comb,
        window=matching_window(depths) if power > _TRIANGULATED else 0.0,
    )
    roughness = float(np.median(rough))
    return replace(seen, kind=_kind(seen, has_comb=comb is not None, roughness=roughness))


def _kind(seen: SeenCamera, *, has_comb: bool, roughness: float) -> DepthCamera | None:
    if has_comb:
        return "structured_light" if seen.step > _COARSE else "stereo"
    if seen.step > _FINE:
        return None
    little = any(seen.power < power and seen.noise < most for power, most in _TIME_OF_FLIGHT)
    if little and roughness >= _SMOOTHED:
        return "time_of_flight"
    if seen.power > _SQUARE:
        # No stereo camera measures each pixel by itself.
        is_alone = roughness > _INDEPENDENT and seen.noise < _MOST_ALONE
        return "time_of_flight" if is_alone else "stereo"
    return None


def _comb(depths: Sequence[NDArray[np.float32]]) -> float | None:
    """Return the step in metres at two metres of depths that are whole steps of a disparity.

    Each block of pixels is a sum of unit phasors, at every frequency that the inverse depth may
    repeat with; the mean length of these sums has a peak at the comb's. None without a clear one.
    """
    blocks = [block for depth in depths for block in _blocks(depth)]
    if not blocks:
        return None
    chosen = np.unique(np.linspace(0, len(blocks) - 1, _MOST_BLOCKS).astype(np.int64))
    length = np.zeros(len(_FREQUENCIES))
    for k in chosen:
        turns = np.outer(_FREQUENCIES, 1 / blocks[k])
        angles = (2 * np.pi * (turns - np.floor(turns))).astype(np.float32)
        sums = np.cos(angles).mean(axis=1), np.sin(angles).mean(axis=1)
        length += np.hypot(*sums) / len(chosen)
    usual = ndimage.median_filter(length, _WINDOW, mode="nearest")
    peak = int(np.argmax(length - usual))
    return 4.0 / float(_FREQUENCIES[peak]) if length[peak] - usual[peak] > _CLEAR else None


def _blocks(depth: NDArray[np.float32]) -> Iterator[NDArray[np.float32]]:
    """Yield the depths (n,) of blocks of pixels that show one surface."""
    down, across = (size // _BLOCK_PX for size in depth.shape)
    half = _BLOCK_PX // 2
    thin = depth[: down * _BLOCK_PX : 2, : across * _BLOCK_PX : 2]
    blocks = thin.reshape(down, half, across, half).swapaxes(1, 2).reshape(-1, half**2)
    counts = np.isfinite(blocks).sum(axis=1)
    middles = medians(blocks, counts)[:, None]
    alike = np.abs(blocks - middles) < _ONE_SURFACE * middles
    full = np.minimum(counts, alike.sum(axis=1)) > _FILLED * half**2
    near = (middles[:, 0] > _COMB_NEAREST) & (middles[:, 0] < _COMB_FARTHEST)
    for block, same in zip(blocks[full & near], alike[full & near], strict=True):
        yield block[same]


_FREQUENCIES = np.arange(120.0, 1300.0, 4.0)  # of the inverse depth, 1 / (1 / metre)
_BLOCK_PX, _MOST_BLOCKS, _WINDOW = 24, 32, 81
_FILLED, _ONE_SURFACE = 0.7, 0.1  # shares of a block, and of its distance
_COMB_NEAREST, _COMB_FARTHEST = 1.0, 3.0  # metres: nearer, the millimetres of the encoding hide it
_CLEAR = 0.3  # combs have .5 to .9; cameras without one .15 at most


def _by_range(depth: NDArray[np.float32]) -> list[tuple[float, float, float, float]]:
    """Return (range, noise, step, roughness) of each slab of range that many pixels show.

    Metres; the roughness is the noise between next pixels as a share of the noise.
    """
    slab = np.where(np.isfinite(depth), depth / SLAB_M, 0).astype(np.int32)
    steps = value_steps(depth, int(slab.max()) + 1)
    rows = depth[::2]
    if depth.shape[1] <= 2 * LAG_PX:
        return []
    middle = rows[:, LAG_PX:-LAG_PX]
    bend = np.abs(rows[:, : -2 * LAG_PX] - 2 * middle + rows[:, 2 * LAG_PX :])
    smooth = bend < 0.05 * middle  # NaN compares false
    bends, slabs = bend[smooth], slab[::2, LAG_PX:-LAG_PX][smooth]
    left, right = rows[:, LAG_PX - 1 : -LAG_PX - 1], rows[:, LAG_PX + 1 : 1 - LAG_PX]
    next_bends = (left - 2 * middle + right)[smooth]
    found = []
    for k in range(int(_NEAREST / SLAB_M), min(int(_FARTHEST / SLAB_M), len(steps))):
        own = bends[slabs == k]
        if len(own) >= _LEAST_PIXELS:
            sigma = mad_sigma(own) / np.sqrt(6)
            near = next_bends[(slabs == k) & np.isfinite(next_bends)]
            rough = mad_sigma(near) / np.sqrt(6) / sigma if sigma > 0 and len(near) else 1.0
            found.append(((k + 0.5) * SLAB_M, float(sigma), float(steps[k]), float(rough)))
    return found
