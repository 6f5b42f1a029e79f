"""Time of flight: the phase of modulated light, pixel by pixel, as an Azure Kinect measures it.

Noise by range follows Tölgyessy, Dekan, Chovanec and Hubinský (2021), "Evaluation of the Azure
Kinect and Its Comparison to Kinect V1 and Kinect V2": a millimetre at 1 m, two to three at 3 m. A
pixel that sees two surfaces mixes their light, so that its depth lies between them (a flying
pixel). Light that bounces off another surface adds to the direct light and makes corners read too
far: multi-path interference, with one bounce as in Fuchs (2010), "Multipath Interference
Compensation in Time-of-Flight Camera Images".
"""

from __future__ import annotations

import numpy as np

from tablemap.geometry import Bools, Floats, Ints
from tablemap.simulation.image_noise import blobs
from tablemap.simulation.lens import Lens
from tablemap.simulation.view import Reading, View, in_front, look_beside

_NEAREST = 0.25
_RADIANS_PER_METRE = 2 * np.pi * 100e6 / 299_792_458  # of phase, at 100 MHz
_FOOTPRINT = np.array([[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.0, 0.0], [0.0, 0.0]])
"""Places at which a pixel gathers light, pixels: optics blur a little beyond its square."""
_RECEIVERS, _SENDERS = 16, 32  # pixels between places that receive and that send multi-path light


def read(
    lens: Lens, view: View, rng: np.random.Generator, *, multipath: Floats | None
) -> tuple[Floats, Bools]:
    """Return an image's depths (n,) in metres and a mask of pixels without a measurement."""
    settings = lens.settings
    reading = Reading.of(view, nearest=_NEAREST)
    if settings.noise and len(view.edges):
        _mix_edges(lens, view, reading, rng)
    depth, missing = reading.depth, reading.missing
    depth[missing] = 1.0
    if multipath is not None:
        depth += multipath
    reflectance = view.of_material("reflectance", reading.parts)
    light = np.maximum(reflectance, 0.02) * np.maximum(reading.cosine, 0.02)
    if settings.dropouts:
        missing |= _unmeasured(lens, view, reading, light, rng)
    if settings.noise:
        sigma = np.minimum(0.0008 + 0.0003 * depth**2 / np.sqrt(light), 0.1)
        depth += settings.noise * sigma * rng.standard_normal(len(depth), dtype=np.float32)
        np.maximum(depth, 0.1, out=depth)
    return depth, missing


def multipath_of(lens: Lens, view: View) -> Floats:
    """Return the metres (n,) by which each pixel reads too far, from light with one bounce.

    A patch that the camera's light meets reflects it, like a matt surface, to every place that it
    faces. This light has a longer way; its phasor adds to that of the direct light. Only surfaces
    in the image are lit and reflect light. Occlusion between two places is ignored.
    """
    to, sent = _patches(lens, view, _RECEIVERS), _patches(lens, view, _SENDERS)
    way = sent.places - to.places[:, None]
    squared = np.sum(way**2, axis=2)
    length = np.sqrt(np.maximum(squared, 1e-6))
    leaving = np.maximum(-np.sum(way * sent.normals, axis=2), 0) / length
    arriving = np.maximum(np.einsum("ijk,ik->ij", way, to.normals), 0) / length
    # The share of a patch's light that a place gets: the form factor of a disc.
    share = leaving * arriving * sent.areas / (np.pi * squared + sent.areas)
    strength = lens.settings.multipath * sent.reflectances * sent.light * share
    strength /= to.light[:, None]
    detour = (sent.distances + length - to.distances[:, None]) / 2
    phasor = 1 + np.sum(strength * np.exp(2j * _RADIANS_PER_METRE * detour), axis=1)
    further = np.angle(phasor) / (2 * _RADIANS_PER_METRE)
    rays = np.linalg.norm(lens.rays, axis=1)
    return np.asarray(_spread(lens, view, to.pixels, further) / rays)


class _Patches:
    """Patches of the seen surfaces, one every few pixels.

    pixels: (m,) indices
    places, normals: (m, 3), in the map, normals towards the camera
    distances: (m,) metres from the camera
    areas: (m,) square metres
    light: (m,) irradiance by the camera's light, 1 at 1 m and normal incidence
    """

    def __init__(self, lens: Lens, view: View, pixels: Ints, step: int) -> None:
        rays = lens.rays[pixels] @ view.map_from_camera[:3, :3].T
        length = np.linalg.norm(rays, axis=1)
        depth, cosine = view.depth[pixels], np.maximum(view.cosine[pixels], 0.05)
        self.pixels = pixels
        self.places = view.map_from_camera[:3, 3] + rays * depth[:, None]
        normals = view.normals[pixels]
        self.normals = normals * -np.sign(np.sum(normals * rays, axis=1, keepdims=True))
        self.distances = depth * length
        solid_angle = step**2 / (lens.k[0, 0] * lens.k[1, 1] * length**3)
        self.areas = solid_angle * self.distances**2 / cosine
        self.light = cosine / self.distances**2
        self.reflectances = view.of_material("reflectance", view.parts[pixels])


def _patches(lens: Lens, view: View, step: int) -> _Patches:
    grid = np.arange(lens.height * lens.width).reshape(lens.height, lens.width)
    pixels = grid[step // 2 :: step, step // 2 :: step].ravel()
    return _Patches(lens, view, pixels[np.isfinite(view.depth[pixels])], step)


def _spread(lens: Lens, view: View, pixels: Ints, values: Floats) -> Floats:
    """Interpolate values (m,) of pixels (m,) to all pixels (n,) of the same surface."""
    rows, columns = (
        np.arange(_RECEIVERS // 2, size, _RECEIVERS) for size in (lens.height, lens.width)
    )
    held = np.zeros(lens.height * lens.width)
    held[pixels] = values
    known = np.zeros(len(held), dtype=bool)
    known[pixels] = True
    v, u = lens.pixels[:, 1], lens.pixels[:, 0]
    top = np.clip((v - rows[0]) / _RECEIVERS, 0, len(rows) - 1)
    left = np.clip((u - columns[0]) / _RECEIVERS, 0, len(columns) - 1)
    total, weights = np.zeros(len(held)), np.zeros(len(held))
    for down in (0, 1):
        for across in (0, 1):
            i = np.minimum(top.astype(int) + down, len(rows) - 1)
            j = np.minimum(left.astype(int) + across, len(columns) - 1)
            near = rows[i] * lens.width + columns[j]
            weight = (1 - np.abs(top - i)) * (1 - np.abs(left - j))
            same = known[near] & (view.parts[near] == view.parts)
            same &= np.sum(view.normals[near] * view.normals, axis=1) > 0.9
            weight = np.where(same, np.maximum(weight, 1e-6), 0.0)
            total += weight * held[near]
            weights += weight
    return total / np.maximum(weights, 1e-9)


def _mix_edges(lens: Lens, view: View, reading: Reading, rng: np.random.Generator) -> None:
    """Replace the pixels near depth edges: mixed, of the larger part, or lost."""
    where = view.edges
    places = lens.pixels[where][:, None, :] + lens.settings.noise * _FOOTPRINT
    beside = look_beside(lens, view, where, places)
    finite = np.isfinite(beside.depth)
    read = np.where(finite, beside.depth, 0.0)
    brightness = np.where(finite, view.of_material("reflectance", beside.parts), 0.0)
    brightness *= np.maximum(beside.cosine, 0.02) / np.maximum(read, 0.1) ** 2
    brightness = np.maximum(brightness, 1e-9)
    _, near = in_front(beside.depth)
    share = near.mean(axis=1)
    split = share < 1
    of_front = (share >= 0.5)[:, None] == near
    larger = np.sum(read * of_front, axis=1) / np.maximum((of_front & finite).sum(axis=1), 1)
    between = np.sum(read * brightness, axis=1) / np.sum(brightness, axis=1)
    chance = rng.random((2, len(where)))
    mixed = split & finite.all(axis=1) & (chance[0] < lens.settings.flying)
    value, chosen = np.where(mixed, between, larger), of_front.argmax(axis=1)
    reading.put(where, value, beside, chosen)
    reading.missing[where] = ~(value >= _NEAREST) | ~finite[np.arange(len(where)), chosen]
    if lens.settings.dropouts:
        reading.missing[where] |= split & ~mixed & (chance[1] < 0.5)


def _unmeasured(
    lens: Lens, view: View, reading: Reading, light: Floats, rng: np.random.Generator
) -> Bools:
    """Draw pixels with too little returned light; outside of the lit cone there is none."""
    depth = reading.depth
    gloss = view.of_material("gloss", reading.parts)
    lost = 0.0005 + np.clip(1.2 - light / depth**2 / 0.006, 0.0, 1.0) + 0.6 * view.behind_glass
    missing = rng.random(len(depth), dtype=np.float32) < lost
    if gloss.any():
        missing |= blobs(lens, rng) < gloss
    if lens.settings.lit_deg:
        missing |= np.hypot(*lens.rays[:, :2].T) > np.tan(np.deg2rad(lens.settings.lit_deg))
    return np.asarray(missing)
