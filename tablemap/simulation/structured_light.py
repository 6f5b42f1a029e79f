"""Structured light: a projector beside the camera, its pattern matched in small windows.

Noise by range and angle follows Nguyen, Izadi and Lovell (2012), "Modeling Kinect Sensor Noise for
Improved 3D Reconstruction and Tracking"; disparity steps, shadows and mixed pixels are those of the
PrimeSense principle.
"""

from __future__ import annotations

import numpy as np

from tablemap.geometry import Bools, Floats
from tablemap.simulation.image_noise import blobs, window_noise
from tablemap.simulation.lens import Lens
from tablemap.simulation.view import Reading, View, hidden_from, in_front, look_beside

_DISPARITY_STEP = 0.125
_NEAREST = 0.4
_SUBPIXELS = np.array([[-0.25, -0.25], [0.25, -0.25], [-0.25, 0.25], [0.25, 0.25]])


def read(lens: Lens, view: View, rng: np.random.Generator) -> tuple[Floats, Bools]:
    """Return an image's depths (n,) in metres and a mask of pixels without a measurement."""
    noise = lens.settings.noise
    reading = Reading.of(view, nearest=_NEAREST)
    if noise and len(view.edges):
        _blur_edges(lens, view, reading, rng)
    depth, missing = reading.depth, reading.missing
    if lens.settings.dropouts:
        missing |= hidden_from(lens, depth, lens.settings.baseline)
        missing |= _unmeasured(lens, view, reading, rng)
    depth[missing] = 1.0
    if noise:
        angle = np.minimum(np.arccos(np.clip(reading.cosine, 0.0, 1.0)), np.deg2rad(82))
        slanted = (angle / (np.pi / 2 - angle)) ** 2
        sigma = 0.0012 + 0.0019 * (depth - 0.4) ** 2 + 0.0001 / np.sqrt(depth) * slanted
        depth += noise * sigma * rng.standard_normal(len(depth), dtype=np.float32)
        np.maximum(depth, 0.1, out=depth)
        focal_times_baseline = lens.k[0, 0] * lens.settings.baseline
        steps = np.rint(focal_times_baseline / depth / _DISPARITY_STEP)
        depth = focal_times_baseline / (np.maximum(steps, 1) * _DISPARITY_STEP)
    return depth, missing


def _blur_edges(lens: Lens, view: View, reading: Reading, rng: np.random.Generator) -> None:
    """Replace the pixels near depth edges: displaced sideways, mixed, or lost."""
    where = view.edges
    angle = np.minimum(np.arccos(np.clip(reading.cosine[where], 0.0, 1.0)), np.deg2rad(80))
    lateral = lens.settings.noise * (0.8 + 0.035 * angle / (np.pi / 2 - angle))
    shift = window_noise(lens, rng)[where] * (lateral * lens.width / 640)[:, None]
    beside = look_beside(lens, view, where, (lens.pixels[where] + shift)[:, None, :] + _SUBPIXELS)
    front, back = beside.depth.argmin(axis=1), beside.depth.argmax(axis=1)
    farthest = beside.depth[np.arange(len(where)), back]
    nearest, near = in_front(beside.depth)
    share = near.mean(axis=1)
    split = share < 1
    finite = np.where(np.isfinite(beside.depth), beside.depth, 0.0)
    value = np.sum(finite * near, axis=1) / np.maximum(near.sum(axis=1), 1)
    value[~np.isfinite(nearest)] = np.inf
    chance = rng.random((3, len(where)))
    goes_back = split & (chance[0] > share)
    mixed = split & (chance[1] < 0.3) & np.isfinite(farthest)
    value = np.where(goes_back, farthest, value)
    mix = chance[2, mixed]
    value[mixed] = mix * nearest[mixed] + (1 - mix) * farthest[mixed]
    reading.put(where, value, beside, np.where(goes_back, back, front))
    reading.missing[where] = ~np.isfinite(value) | (value < _NEAREST)
    if lens.settings.dropouts:
        reading.missing[where] |= split & (rng.random(len(where)) < 0.35)


def _unmeasured(lens: Lens, view: View, reading: Reading, rng: np.random.Generator) -> Bools:
    """Draw pixels with too little returned light: grazing, dark, far, glossy, behind glass."""
    depth, cosine = reading.depth, reading.cosine
    reflectance = view.of_material("reflectance", reading.parts)
    gloss = view.of_material("gloss", reading.parts)
    angle_deg = np.rad2deg(np.arccos(np.clip(cosine, 0.0, 1.0)))
    far = np.where(np.isfinite(depth), depth, 10.0)
    light = reflectance * cosine / far**2
    lost = 0.001 + 1 / (1 + np.exp((82.0 - angle_deg) / 1.5))
    lost += 1 / (1 + np.exp((far - 5.0) / -0.35))
    lost += np.clip(1 - light / 0.018, 0.0, 0.95) * (reflectance < 0.2)
    lost += 0.6 * view.behind_glass
    missing = rng.random(len(depth), dtype=np.float32) < lost
    if gloss.any():
        missing |= blobs(lens, rng) < gloss
    return np.asarray(missing)
