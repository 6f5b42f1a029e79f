"""Sub-pixel points along the end of the top, the cause of each, and their place on the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter
from scipy.spatial import cKDTree

from tablemap.config import OutlineConfig
from tablemap.geometry import Bools, Floats
from tablemap.masks import counted
from tablemap.stages.outline.occupancy import Occupancy
from tablemap.stages.outline.plane import ViewPlane, axial_noise
from tablemap.stages.outline.result import EdgeKind
from tablemap.stages.snapshots import Snapshot


@dataclass(frozen=True, eq=False)
class Contour:
    """Edge points in the image.

    - ``place``: (n, 2) column and row in the window
    - ``outward``: (n, 2) unit vectors in the image
    - ``kind``: (n,) of `EdgeKind`
    - ``gap``: (n,), number of unknown pixels next to the point, or more where the edge is torn
    - ``hole``: (n,), pixels of missing depth from the end outward to a lower surface; NaN where the
      end is none, where something else follows, or the sensor's shadow
    - ``facing``: (n,), cosine between ``outward`` and the image's downward direction; above 0 the
      side face is towards the camera
    """

    place: Floats
    outward: Floats
    kind: NDArray[np.uint8]
    gap: Floats
    hole: Floats
    facing: Floats

    @property
    def is_face(self) -> Bools:
        """Whether the side face is towards the camera (n,)."""
        face: Bools = self.facing > 0
        return face


def trace(seen: Occupancy, snapshot: Snapshot, *, config: OutlineConfig) -> Contour:
    """Find the end of the top, to a fraction of a pixel if a lower surface begins there."""
    place = _crossings(seen.share, config.thinning_px)
    step, steep = _outward(seen.share, place)
    place, step = place[steep], step[steep]
    kind, gap, real = _judge(seen, snapshot, place, step, config)
    place, step, kind, gap = place[real], step[real], kind[real], gap[real]

    other_place, other_step, other_kind = _unknown_ends(seen, config)
    place = np.concatenate([place, other_place])
    step = np.concatenate([step, other_step])
    kind = np.concatenate([kind, other_kind])
    gap = np.concatenate([gap, np.zeros(len(other_place))])
    hole = _holes(seen, place, step, kind)
    facing = np.sum(step * _down(seen, snapshot, place), axis=1)
    gap = np.where(_is_torn(place, kind, facing), np.maximum(gap, _TORN_GAP_PX), gap)
    return Contour(place, step, kind, gap, hole, facing)


def _holes(seen: Occupancy, place: Floats, step: Floats, kind: NDArray[np.uint8]) -> Floats:
    """Return how many pixels without depth follow each end, NaN where they do not tell."""
    hole = np.full(len(place), np.nan)
    ends = np.flatnonzero(np.isin(kind, (EdgeKind.TABLE, EdgeKind.MISSING)))
    missing = _sample(seen.missing, place[ends], step[ends], _HOLE_PX)
    below = _sample(seen.below & ~seen.bridged, place[ends], step[ends], _HOLE_PX)
    other = _sample(seen.front | seen.bridged, place[ends], step[ends], _HOLE_PX)
    first = np.where(below.any(axis=1), below.argmax(axis=1), len(_HOLE_PX))
    ahead = np.arange(len(_HOLE_PX)) < first[:, None]
    told = (first < len(_HOLE_PX)) & ~(other & ahead).any(axis=1)
    hole[ends[told]] = (missing & ahead)[told].sum(axis=1)
    return hole


_HOLE_PX = np.arange(0.5, 64.0)


def _is_torn(place: Floats, kind: NDArray[np.uint8], facing: Floats) -> Bools:
    """Tell which far ends are left over of an edge that mostly lacks depth.

    Before a bright background, the matching windows at the edge of a dark top are torn between the
    two. Most of them have no depth. Where one has, the background may have won: such an end lies
    pixels inside of the edge.
    """
    lost = kind == EdgeKind.MISSING
    ends = np.flatnonzero((facing <= 0) & (lost | (kind == EdgeKind.TABLE)))
    torn = np.zeros(len(place), dtype=bool)
    lost = lost[ends]
    if not lost.any():
        return torn
    first, second = cKDTree(place[ends]).query_pairs(_TORN_PX, output_type="ndarray").T
    first, second = np.concatenate([first, second]), np.concatenate([second, first])
    around = np.maximum(np.bincount(first, minlength=len(ends)), 1)
    gone, least = lost, _TORN_SHARE
    while True:
        share = np.bincount(first, weights=gone[second], minlength=len(ends)) / around
        more = gone | (share > least)
        if (more == gone).all():
            break
        # What is torn counts as lost for the ends beside it; half of the ends beside the last torn
        # one are whole, so that this does not run along the edge.
        gone, least = more, _TORN_AROUND
    torn[ends] = gone & ~lost
    return torn


_TORN_PX = 24.0
_TORN_GAP_PX = 14.0  # makes a sigma of four pixels: half of a matching window
_TORN_SHARE = 0.4  # of the ends round one that are missing; at edges that were seen, 0 to .3
_TORN_AROUND = 0.65


def _down(seen: Occupancy, snapshot: Snapshot, place: Floats) -> Floats:
    """Return (n, 2) unit image vectors towards the nadir's vanishing point."""
    camera = snapshot.camera
    nadir = -snapshot.base_from_camera[2, :3]
    x = (place[:, 0] + seen.origin[1] - camera.cx) / camera.fx
    y = (place[:, 1] + seen.origin[0] - camera.cy) / camera.fy
    down = np.column_stack(
        [(nadir[0] - x * nadir[2]) * camera.fx, (nadir[1] - y * nadir[2]) * camera.fy]
    )
    length: Floats = np.maximum(np.linalg.norm(down, axis=1, keepdims=True), 1e-12)
    return down / length


def _crossings(share: NDArray[np.float32], every: int) -> Floats:
    """Return column and row (n, 2) where the share is one half, on each ``every``-th line.

    A part of the contour is cut by the rows or by the columns, whichever it crosses at the steeper
    angle.
    """
    with np.errstate(invalid="ignore"):
        above = share > 0.5
    defined = np.isfinite(share)
    places = []
    for axis in (1, 0):
        grid, high, valid = (image if axis == 1 else image.T for image in (share, above, defined))
        lines = grid[::every], high[::every], valid[::every]
        change = (lines[1][:, 1:] != lines[1][:, :-1]) & lines[2][:, 1:] & lines[2][:, :-1]
        line, first = np.nonzero(change)
        line = line * every
        a, b = grid[line, first].astype(np.float64), grid[line, first + 1].astype(np.float64)
        along = first + (0.5 - a) / (b - a)
        middle = np.clip(np.round(along).astype(int), 1, grid.shape[1] - 2)
        inside = (line > 0) & (line < grid.shape[0] - 1)
        middle, line, along = middle[inside], line[inside], along[inside]
        here = np.abs(grid[line, middle + 1] - grid[line, middle - 1])
        across = np.abs(grid[line + 1, middle] - grid[line - 1, middle])
        # At 45 degrees rows and columns are equally good: take one of them, not both.
        squarely = here >= across if axis == 1 else here > across
        pair = (along, line) if axis == 1 else (line, along)
        places.append(np.column_stack(pair)[squarely])
    return np.concatenate(places).astype(np.float64).reshape(-1, 2)


def _outward(image: NDArray[np.float32], place: Floats) -> tuple[Floats, Bools]:
    """Return unit vectors (n, 2) down the image's gradient, and which points have a gradient."""
    if len(place) == 0:
        return np.zeros((0, 2)), np.zeros(0, dtype=bool)
    u = np.clip(np.round(place[:, 0]).astype(int), 1, image.shape[1] - 2)
    v = np.clip(np.round(place[:, 1]).astype(int), 1, image.shape[0] - 2)
    nine = np.arange(-1, 2)
    around = image[v[:, None, None] + nine[:, None], u[:, None, None] + nine]
    around = np.where(np.isfinite(around), around, image[v, u][:, None, None])
    smoothing = np.array([1.0, 2.0, 1.0])
    across = (around[:, :, 2] - around[:, :, 0]) @ smoothing / 8
    along = (around[:, 2, :] - around[:, 0, :]) @ smoothing / 8
    step = -np.column_stack([across, along]).astype(np.float64)
    length = np.linalg.norm(step, axis=1)
    return step / np.maximum(length, 1e-9)[:, None], length > 0.02


def _sample(image: Bools, place: Floats, step: Floats, distances: Floats) -> Bools:
    """Return (n, k): the image's nearest pixels at k distances along the points' steps."""
    at = place[:, None, :] + step[:, None, :] * distances[None, :, None]
    u = np.clip(np.round(at[..., 0]).astype(int), 0, image.shape[1] - 1)
    v = np.clip(np.round(at[..., 1]).astype(int), 0, image.shape[0] - 1)
    taken: Bools = image[v, u]
    return taken


def _judge(
    seen: Occupancy, snapshot: Snapshot, place: Floats, step: Floats, config: OutlineConfig
) -> tuple[NDArray[np.uint8], Floats, Bools]:
    """Return each crossing's kind, the number of unknown pixels near it, and a mask of real ones.

    A table edge has top on one side, and nothing in front close by. The top there must be deep
    enough, so that it is no strip of an upright face.
    """
    n = len(place)
    kind = np.full(n, EdgeKind.TABLE, dtype=np.uint8)
    if n == 0:
        return kind, np.zeros(0), np.zeros(0, dtype=bool)
    u = np.round(place[:, 0]).astype(int)
    v = np.round(place[:, 1]).astype(int)
    fall = np.maximum(-seen.fall[v, u].astype(np.float64), 0.02)
    range_px = 1 / _metres_per_px(seen, snapshot, u, v)
    strip = 2 * seen.tau[v, u] * range_px + 3
    depth_px = np.clip(np.maximum(config.support * range_px * fall, strip), 4, 24)

    inward = np.linspace(0.2, 1.0, 9)
    at = place[:, None, :] - step[:, None, :] * (inward[None, :, None] * depth_px[:, None, None])
    cu = np.clip(np.round(at[..., 0]).astype(int), 0, seen.top.shape[1] - 1)
    cv = np.clip(np.round(at[..., 1]).astype(int), 0, seen.top.shape[0] - 1)
    support = seen.top[cv, cu].mean(axis=1)
    blocked = seen.front[cv, cu].any(axis=1)
    lost = seen.missing[cv, cu].mean(axis=1)

    ahead = np.arange(0.5, 7.0)
    solid = _sample(seen.below, place, step, ahead)
    bridged = _sample(seen.bridged, place, step, ahead[:4]).any(axis=1)
    front_ahead = _sample(seen.front, place, step, ahead[:5]).any(axis=1)
    crowd = uniform_filter(seen.front.astype(np.float32), config.clearance_px, mode="nearest")[v, u]
    first = np.where(solid.any(axis=1), solid.argmax(axis=1), len(ahead))
    behind = _sample(seen.top, place, -step, ahead)
    last = np.where(behind.any(axis=1), behind.argmax(axis=1), len(ahead))
    gap = np.maximum(first + last - 1.0, 0.0) + 2.0 * bridged

    kind[_bends(seen, place, step, seen.tau[v, u])] = EdgeKind.BENT
    kind[(gap > config.gap_px) & ~bridged] = EdgeKind.MISSING
    kind[front_ahead | (crowd > 0.02) | blocked] = EdgeKind.OCCLUDED
    left, upper, right, lower = seen.border
    rim = config.border_px
    at_border = (
        (place[:, 0] < left + rim)
        | (place[:, 0] > right - rim)
        | (place[:, 1] < upper + rim)
        | (place[:, 1] > lower - rim)
    )
    kind[at_border] = EdgeKind.BORDER
    real = (support + lost > 0.75) | ((kind == EdgeKind.OCCLUDED) & (support > 0.3))
    return kind, gap, real & (support > 0.3)


def _bends(seen: Occupancy, place: Floats, step: Floats, tau: NDArray[np.float32]) -> Bools:
    """Tell which points have no step ahead: the depth sinks slowly out of the plane there.

    A side face or a floor lies centimetres lower within some pixels. The corners of real depth
    images sink by two centimetres over their last fifteen pixels, so that near the border of the
    image a step must be larger.
    """
    at = place[:, None, :] + step[:, None, :] * _AHEAD_PX[None, :, None]
    u = np.clip(np.round(at[..., 0]).astype(int), 0, seen.top.shape[1] - 1)
    v = np.clip(np.round(at[..., 1]).astype(int), 0, seen.top.shape[0] - 1)
    sunk = np.sort(np.nan_to_num(-seen.height[v, u], nan=-np.inf), axis=1)
    left, upper, right, lower = seen.border
    inset = np.minimum(
        np.minimum(place[:, 0] - left, right - place[:, 0]),
        np.minimum(place[:, 1] - upper, lower - place[:, 1]),
    )
    least = tau + np.where(inset < _BENT_BORDER_PX, _BORDER_STEP_M, _STEP_M)
    # One pixel may be a mixed one.
    second = sunk[:, -2]
    bends: Bools = np.isfinite(second) & (second <= least)
    return bends


_AHEAD_PX = np.arange(1.0, 13.0)
_STEP_M, _BORDER_STEP_M = 0.010, 0.025
_BENT_BORDER_PX = 24.0


def _unknown_ends(
    seen: Occupancy, config: OutlineConfig
) -> tuple[Floats, Floats, NDArray[np.uint8]]:
    """Return, to a pixel, the ends of the top at an occluder, at missing depth or at the border."""
    kinds = np.full(seen.top.shape, 255, dtype=np.uint8)
    rim = config.border_px
    left, upper, right, lower = seen.border
    rows, columns = np.arange(seen.top.shape[0])[:, None], np.arange(seen.top.shape[1])[None, :]
    # The border of the usable image, one pixel wide.
    frame = ((rows == np.ceil(upper + rim)) | (rows == np.floor(lower - rim))) & (
        (columns >= left + rim) & (columns <= right - rim)
    ) | ((columns == np.ceil(left + rim)) | (columns == np.floor(right - rim))) & (
        (rows >= upper + rim) & (rows <= lower - rim)
    )
    solid = seen.smooth_top > 0.25
    kinds[frame & seen.top & solid] = EdgeKind.BORDER
    inside = (
        (rows > upper + rim)
        & (rows < lower - rim)
        & (columns > left + rim)
        & (columns < right - rim)
    )
    for kind, mask, least in (
        (EdgeKind.MISSING, seen.missing, 0.3),
        (EdgeKind.OCCLUDED, seen.front, 0.25),
    ):
        crowd = counted(np.pad(mask, 2, mode="edge"), 5)[2:-2, 2:-2] > least * 25
        beside = np.zeros_like(mask)
        beside[:, 1:] |= mask[:, :-1]
        beside[:, :-1] |= mask[:, 1:]
        beside[1:] |= mask[:-1]
        beside[:-1] |= mask[1:]
        kinds[beside & crowd & seen.top & solid & inside] = kind
    v, u = np.nonzero(kinds != 255)
    # Diagonal thinning keeps the same share of points along rows and along columns.
    keep = (u + 2 * v) % config.thinning_px == 0
    v, u = v[keep], u[keep]
    place = np.column_stack([u, v]).astype(np.float64)
    step, _ = _outward(seen.smooth_top, place)
    return place, step, kinds[v, u]


def _metres_per_px(
    seen: Occupancy, snapshot: Snapshot, u: NDArray[np.intp], v: NDArray[np.intp]
) -> Floats:
    """Return (n,) the metres that a pixel spans at the plane, across the ray."""
    fall = np.maximum(-seen.fall[v, u].astype(np.float64), 0.02)
    span: Floats = np.maximum(seen.offset / fall, 0.1) / snapshot.camera.fy
    return span


@dataclass(frozen=True, eq=False)
class PlacedContour:
    """A contour on the top's plane, in the base: metres (see `ViewEdges`)."""

    points: Floats
    normals: Floats
    sigma: Floats
    is_near: Bools
    widening: Floats
    hole: Floats
    metres_per_px: Floats


def place_on_plane(
    seen: Occupancy,
    contour: Contour,
    snapshot: Snapshot,
    *,
    plane: ViewPlane,
    level: float,
    thickness: float | None = None,
    rim: float = 0.0,
    config: OutlineConfig,
    edge_sigma_px: float,
) -> PlacedContour:
    """Intersect the edge points' rays with the level plane at the joint height of all views.

    The view's own ``plane``, which may slope with the view's depth, only separated the top from
    lower surfaces. The place of an edge comes from its bearing alone.

    If the side face is towards the camera, the upper strip of the face counted as top. So the ray
    of the boundary meets the face below the plane, by the tolerance or by the whole thickness,
    whichever is less. At a bevelled or rounded edge the face lies ``rim`` metres further out.
    """
    camera, pose = snapshot.camera, snapshot.base_from_camera
    window = contour.place
    u = np.clip(np.round(window[:, 0]).astype(int), 0, seen.top.shape[1] - 1)
    v = np.clip(np.round(window[:, 1]).astype(int), 0, seen.top.shape[0] - 1)
    tau = seen.tau[v, u].astype(np.float64)
    is_table = contour.kind == EdgeKind.TABLE
    strip, is_sliver = tau, np.zeros(len(window), dtype=bool)
    is_open = ~contour.is_face
    if thickness is not None:
        # If the rest of the face is only about a pixel high, the smoothing takes half of it.
        left, about_a_pixel = thickness - tau, 1.5 * _metres_per_px(seen, snapshot, u, v)
        strip = np.where(left < about_a_pixel, tau + np.where(left > 0, 0.5, 1.0) * left, tau)
        # A face seen from its end is a sliver beside the background.
        is_sliver = contour.is_face & (left * contour.facing < about_a_pixel)
        is_open |= is_sliver
    lower = np.where(contour.is_face & is_table, strip, 0.0)

    pixel = window + np.array([seen.origin[1], seen.origin[0]])
    ray = np.column_stack(
        [
            (pixel[:, 0] - camera.cx) / camera.fx,
            (pixel[:, 1] - camera.cy) / camera.fy,
            np.ones(len(pixel)),
        ]
    )
    in_base = ray @ pose[:3, :3].T
    fall = np.minimum(in_base[:, 2], -1e-3)
    depth = -(pose[2, 3] - level + lower) / fall
    points = pose[:2, 3] + depth[:, None] * in_base[:, :2]

    # d(xy)/d(pixel): the change of the ray's direction, and the change of the depth along the ray.
    change = []
    for axis, focal in ((0, camera.fx), (1, camera.fy)):
        slope = pose[2, axis] / focal
        turn = pose[:2, axis] / focal
        change.append(depth[:, None] * turn - (depth * slope / fall)[:, None] * in_base[:, :2])
    jacobian = np.stack(change, axis=-1)  # (n, 2, 2): columns are d/du, d/dv
    determinant = jacobian[:, 0, 0] * jacobian[:, 1, 1] - jacobian[:, 0, 1] * jacobian[:, 1, 0]
    determinant = np.where(np.abs(determinant) < 1e-12, 1e-12, determinant)
    # A contour's normal maps by the inverse transpose.
    across = (
        np.column_stack(
            [
                jacobian[:, 1, 1] * contour.outward[:, 0]
                - jacobian[:, 1, 0] * contour.outward[:, 1],
                -jacobian[:, 0, 1] * contour.outward[:, 0]
                + jacobian[:, 0, 0] * contour.outward[:, 1],
            ]
        )
        / determinant[:, None]
    )
    length = np.maximum(np.linalg.norm(across, axis=1), 1e-9)
    normals = across / length[:, None]
    points = points + np.where(lower > 0, rim, 0.0)[:, None] * normals
    metres_per_px = 1 / length

    away = in_base[:, :2] / -fall[:, None]  # metres along the ground per metre of height
    leverage = np.abs(np.sum(normals * away, axis=1))
    pixels_sigma = np.hypot(edge_sigma_px, contour.gap * 0.29)
    pixels_sigma[~is_table] = np.maximum(pixels_sigma[~is_table], 1.0)
    pixels_sigma[is_sliver] = np.hypot(pixels_sigma[is_sliver], _SLIVER_SIGMA_PX)
    # On a face the crossing is as uncertain as a depth there. Smoothing over about a dozen pixels
    # reduces the part of the noise that they do not share.
    smoothed = plane.noise * np.sqrt(plane.shared + (1 - plane.shared) / 12)
    face_sigma = np.where(lower > 0, smoothed * axial_noise(depth) * -fall, 0.0)
    if thickness is None:
        face_sigma = np.hypot(face_sigma, np.where(lower > 0, config.face_sigma, 0.0))
    sigma = np.hypot(pixels_sigma * metres_per_px, leverage * face_sigma)
    widening = np.where(is_open, metres_per_px, 0.0)
    hole = contour.hole * metres_per_px
    return PlacedContour(points, normals, sigma, contour.is_face, widening, hole, metres_per_px)


_SLIVER_SIGMA_PX = 1.5  # smoothing mixes a sliver of a face with the background
