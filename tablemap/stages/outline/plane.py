"""The top's plane in each view, with the view's own noise, and the joint height of all views."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablemap.config import OutlineConfig, SensorsConfig
from tablemap.geometry import Bools, Floats
from tablemap.masks import counted
from tablemap.robust import TUKEY_CUTOFF, mad_sigma, tukey
from tablemap.stages.segmentation import Label, ViewSegmentation
from tablemap.stages.snapshots import Snapshot

MINIMUM_POINTS = 60
"""A view with fewer interior pixels of the top than this gives no height."""


@dataclass(frozen=True, eq=False)
class ViewPlane:
    """A view's top: ``z = height + slope . (xy - centre)`` in the base.

    - ``height_sigma``: metres, from the scatter of patches, so that coarse depth steps count
    - ``noise``: factor on `axial_noise` that gives the scatter of this view's depths
    - ``shared``: the part of that variance that neighbouring pixels share; 1 if the depth comes in
      coarse steps
    """

    height: float
    height_sigma: float
    slope: Floats
    centre: Floats
    noise: float
    shared: float

    def in_camera(self, base_from_camera: Floats) -> tuple[Floats, float]:
        """Return the plane in the camera: ``normal`` (3,) and ``offset``.

        The height of a point in the camera above the plane is ``normal . point + offset``.
        """
        normal = np.array([-self.slope[0], -self.slope[1], 1.0])
        normal /= np.linalg.norm(normal)
        anchor = np.array([self.centre[0], self.centre[1], self.height])
        offset = float(normal @ (base_from_camera[:3, 3] - anchor))
        return base_from_camera[:3, :3].T @ normal, offset

    def drop(self, base_from_camera: Floats) -> float:
        """Return the camera's height above the top, metres, at least a decimetre."""
        return max(float(base_from_camera[2, 3]) - self.height, 0.1)


def axial_noise(depth: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return a structured-light depth's sigma, metres (Nguyen et al. 2012, eq. 3, head on)."""
    excess: NDArray[np.floating] = depth - 0.4
    return 0.0012 + 0.0019 * excess * excess


def fit_plane(
    snapshot: Snapshot,
    view: ViewSegmentation,
    *,
    config: OutlineConfig,
    sensors: SensorsConfig,
) -> ViewPlane | None:
    """Fit the top's plane to the inner pixels of one view, with a prior that it is level.

    Returns None if the top has fewer than `MINIMUM_POINTS` inner pixels.
    """
    top = view.labels == Label.TOP
    rows, columns = np.nonzero(inner_part(top))
    if len(rows) < MINIMUM_POINTS:
        rows, columns = np.nonzero(top)
    stride = max(1, len(rows) // config.plane_samples)
    rows, columns = rows[::stride], columns[::stride]
    depth = snapshot.depth[rows, columns].astype(np.float64)
    seen = np.isfinite(depth) & (depth > 0)
    rows, columns, depth = rows[seen], columns[seen], depth[seen]
    if len(depth) < MINIMUM_POINTS:
        return None

    rays = snapshot.camera.rays[rows, columns].astype(np.float64)
    pose = snapshot.base_from_camera
    points = (rays * depth[:, None]) @ pose[:3, :3].T + pose[:3, 3]
    fall = np.maximum(np.abs(rays @ pose[2, :3]), 0.05)

    centre = np.median(points[:, :2], axis=0)
    design = np.column_stack([np.ones(len(points)), points[:, :2] - centre])
    # Depth errors are correlated over whole regions: thousands of pixels count as a few dozen
    # against the prior that a calibrated camera sees a level top.
    worth = min(1.0, config.plane_worth / len(points))
    solution = np.array([np.median(points[:, 2]), 0.0, 0.0])
    spread = 0.01
    for _ in range(8):
        residual = points[:, 2] - design @ solution
        spread = max(mad_sigma(residual), 3e-4)
        weight = tukey(residual / (TUKEY_CUTOFF * spread))
        normal = (design * weight[:, None]).T @ design * (worth / spread**2)
        right = (design * weight[:, None]).T @ points[:, 2] * (worth / spread**2)
        normal[[1, 2], [1, 2]] += np.radians(sensors.calibrated_view_tilt_sigma_deg) ** -2
        normal[0, 0] += 1e-9
        solution = np.linalg.solve(normal, right)
    residual = points[:, 2] - design @ solution
    inlier = np.abs(residual) < TUKEY_CUTOFF * spread
    scaled = residual / fall / axial_noise(depth)
    noise = mad_sigma(scaled[inlier])
    sigma = _patch_sigma(rows[inlier], columns[inlier], residual[inlier], snapshot.depth.shape[1])

    beside = columns + np.where(columns < snapshot.depth.shape[1] - 2, 2, -2)
    other_depth = snapshot.depth[rows, beside].astype(np.float64)
    other = snapshot.camera.rays[rows, beside].astype(np.float64) * other_depth[:, None]
    other = other @ pose[:3, :3].T + pose[:3, 3]
    expected = solution[0] + (other[:, :2] - centre) @ solution[1:]
    both = inlier & (np.abs(other[:, 2] - expected) < TUKEY_CUTOFF * spread)
    product = residual[both] * (other[both, 2] - expected[both])
    shared = float(np.mean(product) / max(np.mean(residual[both] ** 2), 1e-12)) if both.any() else 1
    return ViewPlane(
        height=float(solution[0]),
        height_sigma=sigma,
        slope=solution[1:],
        centre=centre,
        noise=max(noise, 0.1),
        shared=float(np.clip(shared, 0.0, 1.0)),
    )


def inner_part(top: Bools) -> Bools:
    """Return the pixels whose 9 by 9 neighbourhood is top: this leaves out strips of side faces."""
    size, outside = 9, 3
    return counted(top, size) >= size**2 - outside


def _patch_sigma(
    rows: NDArray[np.intp], columns: NDArray[np.intp], residual: Floats, width: int
) -> float:
    """Return the sigma of the mean height, from patches of about a fortieth of the image."""
    size = max(width // 40, 4)
    _, patch = np.unique((rows // size) * 4096 + columns // size, return_inverse=True)
    count = np.bincount(patch)
    means = (np.bincount(patch, weights=residual) / count)[count >= 4]
    if len(means) < 4:
        return float(np.std(residual) + 1e-3)
    # Neighbouring patches err together: four count as one.
    return float(mad_sigma(means) * 2 / np.sqrt(len(means)) + 2e-4)


def joint_height(
    planes: dict[int, ViewPlane], start: float, start_sigma: float
) -> tuple[float, float, float]:
    """Return the joint height of all views, its sigma, and the scatter between views (metres).

    A single view shows no scatter: then the larger of ``start_sigma`` (the segmentation's) and 2 mm
    is used.
    """
    heights = np.array([plane.height for plane in planes.values()])
    own = np.array([plane.height_sigma for plane in planes.values()])
    if len(heights) == 0:
        return start, start_sigma, start_sigma
    if len(heights) == 1:
        scatter = max(start_sigma, 0.002)
        return float(heights[0]), float(np.hypot(own[0], scatter)), scatter
    # Scatter between views beyond their own sigmas is an error common to all pixels of a view.
    beyond = mad_sigma(heights - np.median(heights)) ** 2 - np.median(own**2)
    scatter = float(np.sqrt(max(beyond, 5e-4**2)))
    sigma = np.hypot(own, scatter)
    height = float(np.median(heights))
    weight = sigma**-2
    for _ in range(10):
        robust = np.minimum(1.0, 1.5 / np.maximum(np.abs(heights - height) / sigma, 1e-9))
        weight = robust / sigma**2
        height = float(np.sum(weight * heights) / np.sum(weight))
    formal = np.sum(weight) ** -0.5
    empirical = np.sqrt(np.sum(weight * (heights - height) ** 2) / np.sum(weight) / len(heights))
    return height, float(max(formal, empirical)), scatter
