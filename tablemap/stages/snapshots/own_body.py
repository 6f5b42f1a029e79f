"""Parts of the robot in its camera's view, such as its hand: left out of the depth images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import ndimage

from tablemap.errors import ProcessWarning
from tablemap.geometry import Bools, Floats, Ints, transform
from tablemap.stages.snapshots.result import Snapshot

_LEAST_VIEWS = 4
_REACH = 1.5  # metres from the camera: no arm reaches farther
_ABOVE_FLOOR = 0.1  # metres: the floor, too, keeps its depth while the robot drives
_CONSTANT, _CONSTANT_SHARE = 0.006, 0.8  # metres of scatter; share of the images
_AWAY = 0.5  # metres between the places of two views that are compared
_AT, _BEYOND = 0.06, 0.12  # metres along a ray: the localisation errs by centimetres
_MOST_VIEWS, _MOST_PIXELS = 12, 4000  # compared: more say the same
_CONTRADICTED = 3.0  # times as many views must see through a place as see something there
_LEAST_SHARE = 0.001  # of the image: less may be chance
_BORDER = 3  # pixels beside it: there depth is mixed from the robot and what is behind


def without_own_body(
    snapshots: Sequence[Snapshot],
) -> tuple[list[Snapshot], tuple[ProcessWarning, ...]]:
    """Remove the pixels that show the robot itself, and say how many and where.

    Such pixels keep their depth while the robot drives, and other views see through the places
    where they would be. The top of a round table may keep its depth, too: the other views see it.
    """
    mask = own_body(snapshots)
    if mask is None:
        return list(snapshots), ()
    own = np.float32(np.nan)
    cleared = [
        replace(one, depth=np.where(mask, own, one.depth), recorded_noise=None) for one in snapshots
    ]
    rows, columns = np.nonzero(mask)
    depth = float(np.nanmedian(np.stack([one.depth[mask] for one in snapshots])))
    message = (
        f"{100 * mask.mean():.1f} % of the depth image ({len(rows)} pixels, columns "
        f"{columns.min()} to {columns.max()}, rows {rows.min()} to {rows.max()}) shows the robot "
        f"itself, {depth:.2f} m from the camera in all views; these pixels were left out"
    )
    return cleared, (ProcessWarning("snapshots.own_body", "snapshots", message),)


def own_body(snapshots: Sequence[Snapshot]) -> Bools | None:
    """Return the pixels (height, width) that show the robot, None if there are none."""
    if len(snapshots) < _LEAST_VIEWS or any(
        one.depth.shape != snapshots[0].depth.shape for one in snapshots
    ):
        return None
    chosen = np.unique(np.linspace(0, len(snapshots) - 1, _MOST_VIEWS).round().astype(int))
    views = [snapshots[i] for i in chosen]
    steady = _steady(snapshots)
    steady[steady] = _above_floor(views, steady)
    parts, count = ndimage.label(steady, structure=np.ones((3, 3)))
    sizes = np.bincount(parts.ravel(), minlength=count + 1)
    large = np.flatnonzero(sizes >= max(1.0, _LEAST_SHARE * steady.size))
    large = large[large > 0]
    if not len(large):
        return None
    pixels = np.argwhere(np.isin(parts, large))
    pixels = pixels[:: max(1, len(pixels) // _MOST_PIXELS)]
    through, there = _looks(views, pixels, steady)
    part = parts[pixels[:, 0], pixels[:, 1]]
    passes = np.bincount(part, weights=through, minlength=count + 1)
    hits = np.bincount(part, weights=there, minlength=count + 1)
    looked = np.bincount(part, minlength=count + 1)
    own = [k for k in large if passes[k] > max(looked[k], _CONTRADICTED * hits[k])]
    if not own:
        return None
    return np.asarray(ndimage.binary_dilation(np.isin(parts, own), iterations=_BORDER))


def _steady(snapshots: Sequence[Snapshot]) -> Bools:
    """Return the near pixels whose depth is the same in nearly all images."""
    count = np.zeros(snapshots[0].depth.shape)
    total, squares = count.copy(), count.copy()
    for one in snapshots:
        depth = np.fmax(one.depth, 0.0, dtype=np.float64)
        count += depth > 0
        total += depth
        squares += depth**2
    mean = total / np.maximum(count, 1)
    scatter = np.sqrt(np.maximum(squares / np.maximum(count, 1) - mean**2, 0.0))
    enough = count >= max(_LEAST_VIEWS, _CONSTANT_SHARE * len(snapshots))
    steady: Bools = enough & (scatter < _CONSTANT) & (mean < _REACH)
    return steady


def _above_floor(views: list[Snapshot], pixels: Bools) -> Bools:
    """Return which of some pixels, a mask (height, width), show no floor in any of the views."""
    high = np.ones(int(pixels.sum()), dtype=bool)
    for one in views:
        with np.errstate(invalid="ignore"):
            high &= ~(one.points_of(pixels)[:, 2] + one.base_z < _ABOVE_FLOOR)
    return high


def _looks(views: list[Snapshot], pixels: Ints, steady: Bools) -> tuple[Floats, Floats]:
    """Return how often other views saw through the places of pixels (n, 2), and saw them there."""
    through, there = np.zeros(len(pixels)), np.zeros(len(pixels))
    rows, columns = pixels.T
    # What the robot's own body hides says nothing.
    bare = [replace(view, depth=np.where(steady, np.nan, view.depth)) for view in views]
    for one in views:
        rays = one.camera.rays[rows, columns]
        seen = transform(one.base_from_camera, rays * one.depth[rows, columns, None])
        places = one.map_from_base.apply(seen)
        for other in bare:
            apart = other.map_from_base.translation - one.map_from_base.translation
            if np.hypot(*apart) < _AWAY:
                continue
            away, depth = other.depth_at(other.map_from_base.inverse().apply(places))
            with np.errstate(invalid="ignore"):
                through += depth - away > _BEYOND
                there += np.abs(depth - away) < _AT
    return through, there
