"""Stereo: two cameras side by side, matched in windows, as RealSense, OAK and ZED cameras do.

Depth is f b / d, so that noise and steps of the disparity d grow with the square of the distance
(Keselman et al. 2017, "Intel RealSense Stereoscopic Depth Cameras": a tenth of a pixel or less). A
window with an edge in it takes the disparity of the nearer surface, which makes foreground things
wider. Surfaces without texture are not matched.
"""

from __future__ import annotations

import numpy as np

from tablemap.geometry import Bools, Floats
from tablemap.simulation.image_noise import blobs, window_noise
from tablemap.simulation.lens import Lens
from tablemap.simulation.view import Reading, View, hidden_from, in_front, look_beside

_DISPARITY_SIGMA = 0.08
_DISPARITY_STEP = 1 / 32
_RAGGED = 0.4  # pixels: how much the border of a widened thing wanders
_NEAREST = 0.3
_AROUND = np.array(
    [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [0.7, 0.7], [-0.7, 0.7], [0.7, -0.7], [-0.7, -0.7]]
)


def read(lens: Lens, view: View, rng: np.random.Generator) -> tuple[Floats, Bools]:
    """Return an image's depths (n,) in metres and a mask of pixels without a match."""
    settings = lens.settings
    reading = Reading.of(view, nearest=_NEAREST)
    noise = window_noise(lens, rng) if settings.noise or settings.fattening_px else None
    if noise is not None and len(view.edges):
        _fatten(lens, view, reading, noise)
    depth, missing = reading.depth, reading.missing
    if settings.dropouts:
        missing |= hidden_from(lens, depth, settings.baseline)
        missing |= _unmatched(lens, view, reading, rng)
    depth[missing] = 1.0
    if settings.noise:
        own = window_noise(lens, rng)[:, 0]
        focal_times_baseline = lens.k[0, 0] * settings.baseline
        disparity = focal_times_baseline / depth + settings.noise * _DISPARITY_SIGMA * own
        steps = np.maximum(np.rint(disparity / _DISPARITY_STEP), 1)
        depth = focal_times_baseline / (steps * _DISPARITY_STEP)
    return depth, missing


def _fatten(lens: Lens, view: View, reading: Reading, noise: Floats) -> None:
    """Give pixels near depth edges the nearest surface in the window round them."""
    where, settings = view.edges, lens.settings
    reach = settings.fattening_px + settings.noise * _RAGGED * noise[where, 0]
    reach = np.clip(reach, 0.0, 2.0)[:, None, None]
    beside = look_beside(lens, view, where, lens.pixels[where][:, None, :] + reach * _AROUND)
    nearest, near = in_front(beside.depth)
    front = np.where(near[:, 0], 0, beside.depth.argmin(axis=1))
    finite = np.where(np.isfinite(beside.depth), beside.depth, 0.0)
    value = np.sum(finite * near, axis=1) / np.maximum(near.sum(axis=1), 1)
    # A pixel whose own ray met the front keeps its own depth.
    value = np.where(near[:, 0], beside.depth[:, 0], value)
    value = np.where(np.isfinite(nearest), value, np.inf)
    reading.put(where, value, beside, front)
    reading.missing[where] = ~np.isfinite(value) | (value < _NEAREST)


def _unmatched(lens: Lens, view: View, reading: Reading, rng: np.random.Generator) -> Bools:
    """Draw pixels without a match: no texture, grazing, far, or seen by only one camera."""
    depth = reading.depth
    texture = view.of_material("texture", reading.parts)
    gloss = view.of_material("gloss", reading.parts)
    far = np.where(np.isfinite(depth), depth, 20.0)
    outside = lens.pixels[:, 0] < lens.k[0, 0] * lens.settings.baseline / far
    lost = 0.002 + 1 / (1 + np.exp((view.cosine - 0.1) / 0.02)) + 0.6 * view.behind_glass
    missing = outside | (rng.random(len(depth), dtype=np.float32) < lost)
    holes = np.maximum(gloss, lens.settings.holes * (1 - texture))
    if holes.any():
        missing |= blobs(lens, rng) < holes
    return np.asarray(missing)
