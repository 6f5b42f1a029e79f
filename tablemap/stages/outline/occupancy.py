"""Which pixels are top, which rays passed its plane, and which pixels are unknown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter, uniform_filter

from tablemap.config import OutlineConfig
from tablemap.geometry import Bools, Floats
from tablemap.masks import crowded, grown, opened
from tablemap.stages.outline.plane import ViewPlane, axial_noise, inner_part
from tablemap.stages.outline.shadows import Gaps, Shadow, find_gaps
from tablemap.stages.segmentation import Label
from tablemap.stages.snapshots import Snapshot

Floats32 = NDArray[np.float32]

MARGIN_PX = 28
"""Pixels kept round the top: edge points look at these surroundings."""


@dataclass(frozen=True, eq=False)
class Classes:
    """What the pixels of a view's window show, before shadows are known.

    The window is cut round the top; all images are (rows, columns) of it.

    - ``origin``: the window's row and column in the image
    - ``depth``: metres, NaN where nothing was measured
    - ``height``: metres above the top beside it, NaN without depth
    - ``fall``: the height that a ray loses per metre of depth, negative
    - ``tau``: metres, the tolerance within which a pixel passes for top
    - ``top``, ``below``, ``front``, ``known``: what each pixel shows: the top, what is lower, what
      is higher; and whether it has depth
    - ``border``: left, top, right and bottom window coordinates of the outermost pixels with depth
    - ``normal``, ``offset``: the top's plane in the camera, as `ViewPlane.in_camera` gives it
    - ``gaps``: the missing pixels to the left and to the right of the top
    - ``smooth_top``: the smoothed top
    """

    origin: tuple[int, int]
    depth: Floats32
    height: Floats32
    fall: Floats32
    tau: Floats32
    top: Bools
    below: Bools
    front: Bools
    known: Bools
    border: tuple[float, float, float, float]
    normal: Floats
    offset: float
    gaps: tuple[Gaps, Gaps]
    smooth_top: Floats32


@dataclass(frozen=True, eq=False)
class Occupancy(Classes):
    """A view's window with its shadows, which are counted as below.

    - ``missing``: pixels without depth that lie in no shadow
    - ``bridged``: pixels in the sensor's shadow
    - ``share``: smoothed share of top among what is known to be top or below, NaN where too little
      is known
    """

    missing: Bools
    bridged: Bools
    share: Floats32


def classify(
    snapshot: Snapshot,
    labels: NDArray[np.uint8],
    plane: ViewPlane,
    *,
    config: OutlineConfig,
    widens: bool = False,
) -> Classes | None:
    """Classify the pixels round the labelled top as top, below, front or unknown.

    ``widens`` tells that the camera's depth widens what stands before a background. Returns None if
    no pixel is labelled as top.
    """
    window = _window(labels)
    if window is None:
        return None
    rows, columns = window
    depth = snapshot.depth[rows, columns]
    label = labels[rows, columns]
    normal, offset = plane.in_camera(snapshot.base_from_camera)
    fall = snapshot.camera.rays[rows, columns] @ normal.astype(np.float32)
    known = np.isfinite(depth) & (depth > 0)
    height = np.where(known, depth * fall + np.float32(offset), np.float32(np.nan))

    tau = _tolerance(fall, offset, plane.noise, config)
    near_core = grown(label == Label.TOP, 11)
    with np.errstate(invalid="ignore"):
        height -= _bend(height, (label == Label.TOP) & (np.abs(height) <= tau))
        level = np.abs(height) <= tau
        front = height > tau
        below = height < -tau
    top = level & near_core & (label != Label.OTHER_TOP)
    front |= known & (label == Label.OTHER_TOP)
    below &= ~front
    # Single flying pixels are no occluders.
    front &= crowded(front, 4)
    if widens:
        widened = _widened(front, top, depth, plane.noise)
        top |= widened
        front &= ~widened

    smooth_top = _smooth(top, config)
    below &= ~_mixed(depth, height, fall, below, smooth_top, snapshot, rows, columns, config)
    return Classes(
        origin=(rows.start, columns.start),
        depth=depth,
        height=height,
        fall=fall,
        tau=tau,
        top=top,
        below=below,
        front=front,
        known=known,
        border=_border(snapshot.depth, rows, columns),
        normal=normal,
        offset=offset,
        gaps=find_gaps(depth, top, below, front, known, snapshot.camera.fx),
        smooth_top=smooth_top,
    )


def occupancy(classes: Classes, shadow: Shadow | None, *, config: OutlineConfig) -> Occupancy:
    """Tell missing pixels in the sensor's shadow from others, and smooth the top."""
    shape = classes.depth.shape
    bridged = np.zeros(shape, dtype=bool) if shadow is None else shadow.cast_on(classes.gaps, shape)
    smooth_top, share = _filled(classes, bridged, config)
    seen = {**vars(classes), "below": classes.below | bridged, "smooth_top": smooth_top}
    return Occupancy(
        **seen,
        missing=~classes.known & ~bridged,
        bridged=bridged,
        share=share,
    )


def _window(labels: NDArray[np.uint8]) -> tuple[slice, slice] | None:
    """Return the rows and columns of the top with a margin."""
    top = labels == Label.TOP
    rows, columns = np.flatnonzero(top.any(axis=1)), np.flatnonzero(top.any(axis=0))
    if len(rows) == 0:
        return None
    height, width = labels.shape
    return (
        slice(max(rows[0] - MARGIN_PX, 0), min(rows[-1] + MARGIN_PX + 1, height)),
        slice(max(columns[0] - MARGIN_PX, 0), min(columns[-1] + MARGIN_PX + 1, width)),
    )


def _bend(height: Floats32, top: Bools) -> Floats32:
    """Return the top's own departure from its plane, smoothed and carried on beyond its rim.

    Depth errs by a little else in each part of the image: by the rest of a bend, or by light that
    came from a wall. What passes for top must be level with the top beside it, or the side face
    gains or loses a strip.
    """
    inner = inner_part(top)
    inner &= np.isfinite(height)
    weight = _wide(inner.astype(np.float32))
    total = _wide(np.where(inner, height, np.float32(0)))
    bend = np.zeros_like(height)
    np.divide(total, weight, out=bend, where=weight > _LEAST_WEIGHT)
    return np.clip(bend, -_MOST_BEND_M, _MOST_BEND_M)


def _wide(image: Floats32) -> Floats32:
    """Smooth by three boxes: nearly a Gaussian of 12 pixels, in a third of its time."""
    for _ in range(3):
        image = uniform_filter(image, _BEND_PX)
    return image


_BEND_PX = 24  # wide against noise, narrow against bends
_LEAST_WEIGHT = 1e-3
_MOST_BEND_M = 0.004  # more is no bend, but a thing on the top


def _widened(front: Bools, top: Bools, depth: Floats32, noise: float) -> Bools:
    """Find the pixels beyond the top's far edge that took their depth from the top.

    Stereo compares windows: what stands before a background gets wider by some pixels, which have
    the depth of the nearest part of the window. On a top seen from above they are nearer than its
    plane there. They are told from things on the top by their narrow band.
    """
    band = front & ~opened(front, _WIDEST_PX + 2)
    if not band.any():
        return band
    size = 2 * _WIDEST_PX + 1
    nearest = minimum_filter(np.where(top, depth, np.float32(np.inf)), size)
    farthest = maximum_filter(np.where(top, depth, np.float32(-np.inf)), size)
    own = depth[band]
    allowance = 3 * np.float32(noise) * axial_noise(own)
    band[band] = (own > nearest[band] - allowance) & (own < farthest[band] + allowance)
    return band


_WIDEST_PX = 3


def _tolerance(fall: Floats32, offset: float, noise: float, config: OutlineConfig) -> Floats32:
    """Return, for each pixel, the largest distance from the plane that still counts as top."""
    steep = np.minimum(fall, np.float32(-1e-3))
    on_plane = np.minimum(-np.float32(offset) / steep, np.float32(8.0))
    sigma = np.float32(noise) * axial_noise(on_plane) * -steep
    tolerance: Floats32 = np.clip(
        config.tolerance_sigmas * sigma, config.tolerance_min, config.tolerance_max
    ).astype(np.float32)
    return tolerance


def _mixed(
    depth: Floats32,
    height: Floats32,
    fall: Floats32,
    below: Bools,
    smooth_top: Floats32,
    snapshot: Snapshot,
    rows: slice,
    columns: slice,
    config: OutlineConfig,
) -> Bools:
    """Find mixed pixels: they saw both the top's edge and the surface behind it.

    A visible side face lies between the two as well, and is kept.
    """
    mixed = np.zeros(depth.shape, dtype=bool)
    v, u = np.nonzero(below & (smooth_top > 0.01))
    if len(v) == 0:
        return mixed
    reach = np.arange(-config.mixed_px, config.mixed_px + 1)
    dv, du = (grid.ravel() for grid in np.meshgrid(reach, reach, indexing="ij"))
    around = depth[
        np.clip(v[:, None] + dv, 0, depth.shape[0] - 1),
        np.clip(u[:, None] + du, 0, depth.shape[1] - 1),
    ]
    around = np.where(np.isfinite(around), around, 0)
    own = depth[v, u]
    deeper = around.max(axis=1) - own > config.mixed_jump + 6 * axial_noise(own)

    # The image direction of "down": towards the nadir's vanishing point.
    nadir = -snapshot.base_from_camera[2, :3]
    ray = snapshot.camera.rays[rows, columns][v, u]
    down = nadir[:2] - ray[:, :2] * nadir[2]
    outward = -_gradient(smooth_top, v, u)
    faces_camera = np.sum(outward * down, axis=1) > 0
    face = faces_camera & (height[v, u] > -config.face_depth)
    hanging = deeper & ~face
    mixed[v[hanging], u[hanging]] = True
    return mixed


def _gradient(image: Floats32, v: NDArray[np.intp], u: NDArray[np.intp]) -> Floats:
    """Return (n, 2) the image's gradient (column, row) at whole pixels."""
    bottom, right = image.shape[0] - 1, image.shape[1] - 1
    across = image[v, np.minimum(u + 1, right)] - image[v, np.maximum(u - 1, 0)]
    along = image[np.minimum(v + 1, bottom), u] - image[np.maximum(v - 1, 0), u]
    return np.column_stack([across, along]).astype(np.float64)


def _smooth(image: NDArray[np.generic], config: OutlineConfig) -> Floats32:
    result: Floats32 = gaussian_filter(image.astype(np.float32), config.smoothing_px, truncate=3.0)
    return result


def _filled(classes: Classes, shadowed: Bools, config: OutlineConfig) -> tuple[Floats32, Floats32]:
    """Return the smoothed top, and its share among the pixels known to be top or below.

    A missing pixel that may be in the shadow is evidence for below: below, it is certainly missing;
    on the top, only a dropout makes it missing. Other missing pixels say nothing.
    """
    smooth_top, smooth_below = classes.smooth_top, _smooth(classes.below, config)
    if shadowed.any():
        known_top, part = smooth_top, _smooth(shadowed, config)
        known = smooth_top + smooth_below + part
        share = np.divide(smooth_top, known, out=np.zeros_like(known), where=known > 0.05)
        rim = (share > 0.5) & (share < 0.95) & ~shadowed
        dropout = np.float32(np.clip((~classes.known)[rim].mean() if rim.any() else 0.1, 0.02, 0.5))
        chance = np.zeros_like(known)
        for _ in range(2):
            prior = share[shadowed] * dropout
            chance[shadowed] = prior / (prior + 1 - share[shadowed] + 1e-6)
            smooth_top = known_top + _smooth(chance, config)
            np.divide(smooth_top, known, out=share, where=known > 0.05)
        smooth_below = known - smooth_top
    weight = smooth_top + smooth_below
    share = np.full(shadowed.shape, np.nan, dtype=np.float32)
    np.divide(smooth_top, weight, out=share, where=weight > 0.12)
    return smooth_top, share


def _border(
    depth: NDArray[np.float32], rows: slice, columns: slice
) -> tuple[float, float, float, float]:
    """Return the window coordinates (left, top, right, bottom) of the ends of the depth image."""
    known = np.isfinite(depth[::4, ::4]) & (depth[::4, ::4] > 0)
    v = np.flatnonzero(np.isfinite(depth).any(axis=1))
    u = np.flatnonzero(np.isfinite(depth).any(axis=0))
    if not known.any() or len(v) == 0 or len(u) == 0:
        return 0.0, 0.0, 0.0, 0.0
    return (
        float(u[0] - columns.start),
        float(v[0] - rows.start),
        float(u[-1] - columns.start),
        float(v[-1] - rows.start),
    )
