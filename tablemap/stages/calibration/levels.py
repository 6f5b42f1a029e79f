"""Samples of the level surfaces in all views: the floor, and the top if it is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tablemap.config import CalibrationConfig
from tablemap.geometry import Bools, Floats, Ints
from tablemap.masks import shrunk
from tablemap.stages.calibration.field import REFERENCE_M, image_coordinates, terms
from tablemap.stages.snapshots import Snapshot, turned_left
from tablemap.stages.snapshots.normals import upward_share
from tablemap.stages.snapshots.rounding import FINE, Rounding

STRIDE_PX = 2
BLOCK_PX = 32  # errors of neighbouring pixels are correlated: a block of this side counts once
MOST_FLOOR, MOST_TOP = 24_000, 16_000
LEAST_UPWARD = np.cos(np.deg2rad(25.0))
UNEVEN_M = 0.002  # floors are flat to about this
TOP_UNEVEN_M = 0.001
RIM_PX = 9  # side faces and mixed pixels are no part of the top


@dataclass(frozen=True, eq=False)
class LevelSamples:
    """Samples of level surfaces, sorted by view.

    arms: (n, 3), from the camera, metres, in base axes that turn with the head
    depth: (n,), along the optical axis, metres
    terms: (k, n), the terms of the depth field at the samples' pixels
    steep: (n,), drop of the ray for a metre of depth
    camera_z: (n,), height of the camera as recorded, metres
    sigma: (n,), of a sample's height, metres
    weight: (n,), 1 / sigma^2, divided among the samples of a block
    view: (n,), place of the view among the snapshots
    is_top: (n,), on the top, not on the floor
    place: (n, 2), of samples of the top: metres from its middle, in the map
    bulge: (n,), of samples of the top: the shape of a sag, with mean 0
    turns: (views,), radians that the axes turned with the head, all 0 if it does not turn
    headings: (views,), radians of these axes in the map
    pixels: how many pixels the floor's samples stand for
    top_start: metres, the height of the top as first seen
    rounding: how the depth was rounded to coarse steps
    """

    arms: Floats
    depth: Floats
    terms: Floats
    steep: Floats
    camera_z: Floats
    sigma: Floats
    weight: Floats
    view: Ints
    is_top: Bools
    place: Floats
    bulge: Floats
    turns: Floats
    headings: Floats
    pixels: int
    top_start: float
    rounding: Rounding

    @property
    def views(self) -> int:
        """How many views there are."""
        return len(self.turns)

    @property
    def parts(self) -> Sequence[slice]:
        """The samples of each view."""
        ends = np.searchsorted(self.view, np.arange(self.views + 1))
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    @property
    def beyond(self) -> Floats:
        """Depth minus the field's reference depth, metres."""
        return self.depth - REFERENCE_M

    def beyond_at(self, reach: Floats) -> Floats:
        """Return `beyond` for rays that are ``reach`` times as long."""
        return self.depth * reach - REFERENCE_M

    @property
    def rounded(self) -> Floats:
        """The drop (n,) of the ray for a metre of rounding error at the reference distance."""
        return self.rounded_at(np.ones_like(self.depth))

    def rounded_at(self, reach: Floats) -> Floats:
        """Return `rounded` for rays that are ``reach`` times as long."""
        return self.steep * self.rounding.share(self.depth * reach)

    def only(self, chosen: Bools) -> LevelSamples:
        """Return some (n,) of the samples, of the same views."""
        each = ("arms", "depth", "steep", "camera_z", "sigma", "weight", "view", "is_top", "place")
        parts = {name: getattr(self, name)[chosen] for name in (*each, "bulge")}
        return replace(self, terms=self.terms[:, chosen], **parts)

    def in_base_axes(self) -> LevelSamples:
        """Return the same samples in axes that do not turn with the head."""
        arms = turned(self.arms, self.turns[self.view])
        headings = self.headings - self.turns
        return replace(self, arms=arms, turns=np.zeros_like(self.turns), headings=headings)


def turned(arms: Floats, angles: Floats) -> Floats:
    """Turn (n, 3) arms about the vertical by (n,) radians."""
    c, s = np.cos(angles), np.sin(angles)
    x, y, z = arms.T
    return np.column_stack([c * x - s * y, s * x + c * y, z])


@dataclass(frozen=True, eq=False)
class SeenTop:
    """The top as a segmentation found it, for the adjustment.

    height: metres above the floor
    masks: by snapshot index, (height, width) of the pixels on the top
    """

    height: float
    masks: dict[int, Bools]


def collect(
    snapshots: tuple[Snapshot, ...],
    config: CalibrationConfig,
    *,
    corrected: tuple[Snapshot, ...] | None = None,
    top: SeenTop | None = None,
    rounding: Rounding = FINE,
) -> LevelSamples | None:
    """Gather the pixels of floor and top of every view, with the recorded depth.

    Level pixels near z = 0 are floor. If ``corrected`` snapshots are given, they decide about this,
    within a narrower band. Returns None if there is neither floor nor top.
    """
    parts: list[_ViewSamples] = []
    thin = max(1, round(np.sqrt(len(snapshots) * 12_000 / MOST_FLOOR)))
    pixels = 0
    for view, snapshot in enumerate(snapshots):
        depth = snapshot.depth[::STRIDE_PX, ::STRIDE_PX]
        if min(depth.shape) < 32:
            continue
        arms = arms_of(snapshot)
        noise = snapshot.noise.sigma(depth)
        step = snapshot.noise.coarse_step
        floor = _floor(arms, snapshot, None if corrected is None else corrected[view], step, config)
        pixels += int(floor.sum()) * STRIDE_PX**2
        chosen = np.zeros_like(floor)
        chosen[::thin, ::thin] = floor[::thin, ::thin]
        parts.append(_part(view, snapshot, arms, depth, noise, chosen, thin, UNEVEN_M))
        if top is not None and snapshot.index in top.masks:
            mask = shrunk(top.masks[snapshot.index], RIM_PX, outside=False)
            mask = mask[::STRIDE_PX, ::STRIDE_PX] & np.isfinite(depth)
            every = max(1, int(np.sqrt(mask.sum() * len(snapshots) / MOST_TOP)))
            chosen = np.zeros_like(mask)
            chosen[::every, ::every] = mask[::every, ::every]
            parts.append(
                _part(view, snapshot, arms, depth, noise, chosen, every, TOP_UNEVEN_M, is_top=True)
            )
    parts = [part for part in parts if len(part.depth)]
    if not parts:
        return None
    return _together(parts, snapshots, pixels, rounding, top)


def arms_of(snapshot: Snapshot) -> NDArray[np.float32]:
    """Return (rows, columns, 3) from the camera to every `STRIDE_PX`-th pixel, in base axes."""
    depth = snapshot.depth[::STRIDE_PX, ::STRIDE_PX]
    arms: NDArray[np.float32] = (
        snapshot.camera.rays[::STRIDE_PX, ::STRIDE_PX] * depth[..., None]
    ) @ snapshot.base_from_camera[:3, :3].T.astype(np.float32)
    return arms


@dataclass(frozen=True, eq=False)
class _ViewSamples:
    """The samples of one surface in one view, with the fields of `LevelSamples`."""

    arms: Floats
    depth: Floats
    terms: Floats
    steep: Floats
    sigma: Floats
    weight: Floats
    view: Ints
    is_top: Bools
    place: Floats


def _floor(
    arms: NDArray[np.float32],
    snapshot: Snapshot,
    corrected: Snapshot | None,
    step: float,
    config: CalibrationConfig,
) -> Bools:
    """Return the level pixels near the floor."""
    distance = np.hypot(arms[..., 0], arms[..., 1])
    if corrected is None:
        z = arms[..., 2] + np.float32(snapshot.base_from_camera[2, 3])
        band = config.floor_band + config.floor_slope * distance
    else:
        z = _heights(corrected)
        band = _NARROW_BAND * (config.floor_band + config.floor_slope * distance)
    with np.errstate(invalid="ignore"):
        near: Bools = np.abs(z) < band
        if near.any():
            near &= upward_share(arms, 9 if step > 0 else 4) > LEAST_UPWARD
    return near


_NARROW_BAND = 0.4


def parabola(squared: Floats, *, over: Floats, most: float = np.inf) -> Floats:
    """Return the shape of a sag of one at squared distances (n,) from the top's middle.

    Its mean is 0 ``over`` those of the top, and 98 percent of these see a fall of less than one
    from the middle. Beyond ``most`` of that distance it falls no further.
    """
    reach = max(float(np.percentile(over, 98)), 1e-6)
    result: Floats = (over.mean() - np.minimum(squared, most * reach)) / reach
    return result


def _heights(snapshot: Snapshot) -> NDArray[np.float32]:
    rays = snapshot.camera.rays[::STRIDE_PX, ::STRIDE_PX]
    fall = rays @ snapshot.base_from_camera[2, :3].astype(np.float32)
    depth = snapshot.depth[::STRIDE_PX, ::STRIDE_PX]
    return np.asarray(depth * fall + np.float32(snapshot.base_from_camera[2, 3]))


def _part(
    view: int,
    snapshot: Snapshot,
    arms: NDArray[np.float32],
    depth: NDArray[np.float32],
    noise: NDArray[np.float32],
    chosen: Bools,
    every: int,
    uneven: float,
    *,
    is_top: bool = False,
) -> _ViewSamples:
    u, v = image_coordinates(snapshot.camera)
    rows, columns = np.nonzero(chosen)
    here = arms[chosen].astype(np.float64)
    far = depth[chosen].astype(np.float64)
    steep = here[:, 2] / np.maximum(far, 0.05)
    sigma = np.hypot(noise[chosen].astype(np.float64) * np.abs(steep), uneven)
    share = min(1.0, (STRIDE_PX * every / BLOCK_PX) ** 2)
    in_base = here[:, :2] + snapshot.base_from_camera[:2, 3]
    return _ViewSamples(
        arms=here,
        depth=far,
        terms=terms(u[columns * STRIDE_PX], v[rows * STRIDE_PX]),
        steep=steep,
        sigma=sigma,
        weight=share / sigma**2,
        view=np.full(len(far), view, dtype=np.int64),
        is_top=np.full(len(far), is_top),
        place=snapshot.map_from_base.apply(in_base) if is_top else np.zeros((len(far), 2)),
    )


def _together(
    parts: list[_ViewSamples],
    snapshots: tuple[Snapshot, ...],
    pixels: int,
    rounding: Rounding,
    top: SeenTop | None,
) -> LevelSamples:
    view = np.concatenate([part.view for part in parts])
    is_top = np.concatenate([part.is_top for part in parts])
    arms = np.concatenate([part.arms for part in parts])
    place = np.concatenate([part.place for part in parts])
    bulge = np.zeros(len(view))
    if is_top.any():
        place[is_top] -= np.median(place[is_top], axis=0)
        squared = np.sum(place[is_top] ** 2, axis=1)
        bulge[is_top] = parabola(squared, over=squared)
    turns = turned_left(np.stack([snapshot.base_from_camera for snapshot in snapshots]))
    if turns.any():
        arms = turned(arms, -turns[view])
    return LevelSamples(
        arms=arms,
        depth=np.concatenate([part.depth for part in parts]),
        terms=np.concatenate([part.terms for part in parts], axis=1),
        steep=np.concatenate([part.steep for part in parts]),
        camera_z=np.array([s.base_from_camera[2, 3] for s in snapshots])[view],
        sigma=np.concatenate([part.sigma for part in parts]),
        weight=np.concatenate([part.weight for part in parts]),
        view=view,
        is_top=is_top,
        place=place,
        bulge=bulge,
        turns=turns,
        headings=np.array([snapshot.map_from_base.yaw for snapshot in snapshots]) + turns,
        pixels=pixels,
        top_start=0.0 if top is None else top.height,
        rounding=rounding,
    )
