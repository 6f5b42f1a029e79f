"""The thickness of the top, from lower ends of its side face, and the bulge of its rim."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.config import OutlineConfig
from tablemap.geometry import Floats, Ints
from tablemap.robust import mad_sigma
from tablemap.stages.outline.contour import Contour, PlacedContour
from tablemap.stages.outline.occupancy import Occupancy
from tablemap.stages.outline.plane import axial_noise
from tablemap.stages.outline.result import EdgeKind
from tablemap.stages.snapshots import Snapshot

MINIMUM_ENDS = 25
"""The thickness needs at least this many lower ends of a side face, over all views."""

MINIMUM_FACE = 100
"""The rim needs at least this many pixels of side faces in a view."""

RIM_SIGMA_M = 0.0002
"""The least scatter of the rim at a sharp edge, metres."""


_LEAST_STEEP = 0.1  # a face that is seen from straight above has no height in the image


@dataclass(frozen=True, eq=False)
class FaceEnds:
    """Lower ends of the side face in one view.

    - ``drop``: (n,) metres below the plane
    - ``resolution``: metres, the height that one pixel spans on the face
    - ``tau``: metres, the tolerance within which a pixel counted as top there
    - ``bulge``: (m,) metres that pixels of the face lie outside the placed edge
    """

    drop: Floats
    resolution: Floats
    tau: Floats
    bulge: Floats


def face_ends(
    seen: Occupancy,
    contour: Contour,
    placed: PlacedContour,
    snapshot: Snapshot,
    *,
    noise: float,
    config: OutlineConfig,
) -> FaceEnds:
    """Walk down the face from each near edge until a surface further back begins.

    A face that goes on out of reach (a box, a panel, a cloth) has no end here.
    """
    near = contour.is_face & (contour.kind == EdgeKind.TABLE) & (contour.gap <= 1.0)
    place, step = contour.place[near], contour.outward[near]
    edge, normal = placed.points[near], placed.normals[near]
    if len(place) == 0:
        return FaceEnds(*[np.zeros(0)] * 4)
    u = np.clip(np.round(place[:, 0]).astype(int), 0, seen.top.shape[1] - 1)
    v = np.clip(np.round(place[:, 1]).astype(int), 0, seen.top.shape[0] - 1)
    distance = np.maximum(seen.offset / np.maximum(-seen.fall[v, u].astype(np.float64), 0.02), 0.1)

    camera, pose = snapshot.camera, snapshot.base_from_camera
    nadir = -pose[2, :3]
    x = (place[:, 0] + seen.origin[1] - camera.cx) / camera.fx
    y = (place[:, 1] + seen.origin[0] - camera.cy) / camera.fy
    down = np.column_stack([nadir[0] - x * nadir[2], nadir[1] - y * nadir[2]])
    steep = np.linalg.norm(down, axis=1)
    down = down / np.maximum(steep, 1e-9)[:, None]
    frontal = np.sum(down * step, axis=1) > 0.5

    walked = np.arange(-3.0, 45.0)
    at = place[:, None, :] + down[:, None, :] * walked[None, :, None]
    cu, cv = np.round(at[..., 0]).astype(int), np.round(at[..., 1]).astype(int)
    inside = (cu >= 0) & (cu < seen.top.shape[1]) & (cv >= 0) & (cv < seen.top.shape[0])
    cu, cv = np.clip(cu, 0, seen.top.shape[1] - 1), np.clip(cv, 0, seen.top.shape[0] - 1)
    depth = np.where(inside, seen.depth[cv, cu], np.nan).astype(np.float64)
    height = np.where(inside, seen.height[cv, cu], np.nan).astype(np.float64)
    rays = camera.rays[cv + seen.origin[0], cu + seen.origin[1]].astype(np.float64)
    ground = depth[..., None] * (rays @ pose[:2, :3].T) + pose[:2, 3]
    # How far behind the upright face through the edge each pixel lies.
    set_back = -np.sum((ground - edge[:, None, :]) * normal[:, None, :], axis=-1)

    allowance = config.face_set_back + 3 * noise * axial_noise(distance)
    with np.errstate(invalid="ignore"):
        away = ~(np.abs(set_back) <= allowance[:, None])
        beyond = set_back > allowance[:, None]
    on_top = walked < 1
    away[:, on_top] = False
    ended = away[:, :-1] & away[:, 1:]
    has_end = ended.any(axis=1) & frontal
    end = ended.argmax(axis=1)
    index = np.arange(len(place))
    # Two later pixels must be measured behind the face: the image's border or a hole is no end.
    later = np.minimum(end[:, None] + np.arange(1, 5), len(walked) - 1)
    has_end &= beyond[index[:, None], later].sum(axis=1) >= 2
    on_face = np.isfinite(height) & (np.arange(len(walked))[None, :] < end[:, None])
    last = len(walked) - 1 - on_face[:, ::-1].argmax(axis=1)
    has_end &= on_face.any(axis=1) & (end - last <= 2)
    per_px = distance / camera.fy / np.maximum(steep, _LEAST_STEEP)
    # A mixed pixel next to the end contains the end; otherwise the end lies between two pixels.
    following = set_back[index, np.minimum(end + 1, len(walked) - 1)]
    with np.errstate(invalid="ignore"):
        is_mixed = following > set_back[index, end] + 2 * allowance
    drop = -height[index, last] + per_px * (end - last + is_mixed) / 2
    passed = seen.tau[v, u].astype(np.float64)
    with np.errstate(invalid="ignore"):
        plain = on_face & (height < -2 * passed[:, None]) & (height > -0.8 * drop[:, None])
    plain &= has_end[:, None] & ~away & (np.arange(len(walked))[None, :] < last[:, None])
    return FaceEnds(drop[has_end], per_px[has_end], passed[has_end], -set_back[plain])


@dataclass(frozen=True)
class Thickness:
    """The height of the side face, as far as it looks like one.

    value, sigma: metres
    per_px: metres that it grows if depth widens what stands before a background by a pixel
    """

    value: float
    sigma: float
    per_px: float


def joint_thickness(
    views: list[FaceEnds], face_depth_sigma: float = 0.0, *, config: OutlineConfig
) -> Thickness | None:
    """Return the thickness, or None if the views disagree.

    Aprons, legs and clutter end elsewhere: more than half of the ends must agree.
    ``face_depth_sigma`` (metres) is how unlike the heights of face and top may err by their depths.
    """
    drop = np.concatenate([view.drop for view in views]) if views else np.zeros(0)
    if len(drop) < MINIMUM_ENDS:
        return None
    resolution = float(np.median(np.concatenate([view.resolution for view in views])))
    width = max(0.004, resolution)
    # The mode: the shortest interval with half of the ends.
    ordered = np.sort(drop)
    half = len(ordered) // 2
    spans = ordered[half:] - ordered[: len(ordered) - half]
    first = int(np.argmin(spans))
    middle = float(np.median(ordered[first : first + half + 1]))
    close = np.abs(drop - middle) < 2 * width
    if close.mean() < 0.5 or not config.thickness_min <= middle <= config.thickness_max:
        return None
    value = float(np.mean(drop[close]))
    # Ends along an edge are correlated: twenty count as one. A quarter pixel is systematic.
    scatter = float(np.std(drop[close])) / np.sqrt(max(close.sum() / 20, 1.0))
    of_view = np.repeat(np.arange(len(views)), [len(view.drop) for view in views])
    apart = _between_views(drop[close], of_view[close], resolution)
    systematic = (0.25 * resolution) ** 2 + face_depth_sigma**2
    sigma = np.sqrt(scatter**2 + apart**2 + systematic)
    return Thickness(value, float(sigma), resolution)


def _between_views(drop: Floats, of_view: Ints, resolution: float) -> float:
    """Return the sigma of the mean drop (metres) from what the views' own means differ by.

    Few views hardly show their scatter: one more is assumed that is a pixel off.
    """
    count = np.bincount(of_view)
    shown = count >= _LEAST_OF_VIEW
    if not shown.any():
        return resolution
    means = (np.bincount(of_view, weights=drop) / np.maximum(count, 1))[shown]
    total = resolution**2 + float(np.sum((means - means.mean()) ** 2))
    return float(np.sqrt(total) / len(means))


_LEAST_OF_VIEW = 5  # ends of a view whose mean tells something


def joint_rim(
    views: list[FaceEnds], surface_depth_sigma: float = 0.0
) -> tuple[float, float] | None:
    """Return the distance of the side face outside the placed edge, and its sigma (metres).

    It is 0 at a sharp edge; at a bevel or a rounding the flat top ends before its outermost line.
    ``surface_depth_sigma`` (metres) is how unlike the depths of face and top may err.
    Returns None if no view shows enough of a face.
    """
    medians = [float(np.median(view.bulge)) for view in views if len(view.bulge) >= MINIMUM_FACE]
    if not medians:
        return None
    value = float(np.median(medians))
    scatter = mad_sigma(np.array(medians) - value)
    own = np.hypot(RIM_SIGMA_M, surface_depth_sigma)
    return value, float(np.hypot(scatter / np.sqrt(len(medians)), own))
