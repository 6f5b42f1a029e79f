"""What is believed of the nuisances before the edges are looked at."""

from __future__ import annotations

import numpy as np

from tablemap.config import SensorsConfig, SurfaceConfig
from tablemap.geometry import Floats
from tablemap.stages.outline import Outline, ViewEdges
from tablemap.stages.registration import Registration
from tablemap.stages.surface.nuisances import CommonNuisances, ViewCorrections


def pose_sigma(registration: Registration) -> float:
    """Return how well a view's place is known: metres, the views' median."""
    variances = np.diag(registration.covariance).reshape(-1, 3)[:, :2]
    return float(np.sqrt(np.median(variances)))


def skew_sigma(registration: Registration, poses: Floats) -> float:
    """Return by how much the drive may be bent, radians: laser poses are not."""
    if registration.source == "laser":
        return 0.0
    return registration.systematic / max(float(np.hypot(*poses[:, :2].T).mean()), 0.1)


def common_sigmas(
    outline: Outline, registration: Registration, config: SurfaceConfig, sensors: SensorsConfig
) -> CommonNuisances:
    """Return the prior standard deviations of the nuisances that all views share.

    The depth scale is known as well as the calibration left it, the camera's height in TF trusted
    (`scale.settle_scale` doubts that). What the registration bounds as systematic acts as a camera
    shifted in every base. A near edge is the side face's; a far one ends where the flat top does:
    where the rim is bevelled or rounded, millimetres early. On a face that shows, this shows; a
    small rounding does not.
    """
    unknown = sensors.calibrated_depth_scale_sigma_surface
    scale = unknown if outline.scale is None else outline.scale.sigma_trusting
    shift = max(registration.systematic / config.systematic_sigmas, 1e-6)
    set_back = sensors.rim_set_back if outline.is_dull else sensors.sharp_rim_set_back
    return CommonNuisances(
        scale=max(scale, 1e-6),
        near_bias=sensors.near_edge_bias,
        far_bias=sensors.far_edge_bias,
        shift_x=shift,
        shift_y=shift,
        set_back=max(set_back, 1e-6),
    )


def corrections_root(
    views: list[ViewEdges], poses: Floats, registration: Registration, sensors: SensorsConfig
) -> Floats:
    """Return the (4n, m) root of the views' corrections: x, y, yaw, scale of each of n snapshots.

    Times m independent unit normals it gives corrections as uncertain, and as bound to each other,
    as is known. The poses' relative covariance has the mean pose in its null space: it stays where
    it is. Poses (n, 3) also share the scale of what placed them, the laser's ranges or the wheels;
    without it the depth would be thought to measure its own scale by them.
    """
    count = len(poses)
    pose_root = _root(registration.covariance, count)
    drive = poses - poses.mean(axis=0)
    drive[:, 2] = 0.0
    is_laser = registration.source == "laser"
    drive *= sensors.laser_range_scale_sigma if is_laser else sensors.drive_scale_sigma
    size, scale = ViewCorrections.COUNT, ViewCorrections.place("scale")
    own = np.zeros((count, size, len(views)))
    own[[view.index for view in views], scale, np.arange(len(views))] = [
        view.scale_sigma for view in views
    ]
    moved = np.zeros((count, size, pose_root.shape[1] + 1))
    moved[:, :3, :-1] = pose_root.reshape(count, 3, -1)
    moved[:, :3, -1] = drive
    root = np.concatenate([moved, own], axis=2).reshape(size * count, -1)
    kept: Floats = root[:, np.abs(root).max(axis=0) > 0]
    return kept


def _root(covariance: Floats, count: int) -> Floats:
    size = 3 * count
    if covariance.shape != (size, size) or not np.isfinite(covariance).all():
        raise ValueError(f"expected a finite ({size}, {size}) covariance, got {covariance.shape}")
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    kept = values > max(1e-14, 1e-9 * float(values.max(initial=0.0)))
    root: Floats = vectors[:, kept] * np.sqrt(values[kept])
    return root
