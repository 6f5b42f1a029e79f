"""What is believed of the nuisances before the edges are looked at."""

from __future__ import annotations

import numpy as np

from tablemap.config import SensorsConfig, SurfaceConfig
from tablemap.geometry import Floats
from tablemap.stages.calibration import TopBelief
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


def common_precision(
    outline: Outline, registration: Registration, config: SurfaceConfig, sensors: SensorsConfig
) -> Floats:
    """Return the prior precision (c, c) of the nuisances that all views share.

    How far the camera is from the top, its roll and its pitch are known, and bound to each other,
    as the calibration left them. What the registration bounds as systematic acts as a camera
    shifted in every base. A near edge is the side face's; a far one ends where the flat top does:
    where the rim is bevelled or rounded, millimetres early. On a face that shows, this shows; a
    small rounding does not.
    """
    camera = outline.camera
    unknown = sensors.calibrated_depth_scale_sigma_surface
    tilt = float(np.deg2rad(sensors.camera_tilt_sigma_deg))
    focal = sensors.camera_focal_sigma
    if registration.source == "laser":
        shift = sensors.laser_mounting_sigma
    else:
        held = camera is not None and camera.is_held
        focal = sensors.focal_length_sigma if held else sensors.calibrated_focal_length_sigma
        shift = max(registration.systematic / config.systematic_sigmas, 1e-6)
    set_back = sensors.rim_set_back if outline.is_dull else sensors.sharp_rim_set_back
    sigmas = CommonNuisances(
        scale=unknown,
        roll=tilt,
        pitch=tilt,
        yaw=sensors.laser_mounting_yaw_sigma,
        focal=focal,
        near_bias=sensors.near_edge_bias,
        far_bias=sensors.far_edge_bias,
        shift_x=shift,
        shift_y=shift,
        set_back=max(set_back, 1e-6),
        slope_x=_TOP_SLOPE,
        slope_y=_TOP_SLOPE,
    )
    covariance = np.diag(sigmas.pack() ** 2)
    if camera is not None:
        at = [CommonNuisances.place(name) for name in ("scale", "roll", "pitch")]
        covariance[np.ix_(at, at)] = camera.covariance[1:, 1:] + np.diag([1e-12] * 3)
    return np.asarray(np.linalg.inv(covariance), dtype=np.float64)


_TOP_SLOPE = np.deg2rad(0.1)  # what floor and top leave of the slope of the top


def corrections_root(
    views: list[ViewEdges],
    poses: Floats,
    registration: Registration,
    camera: TopBelief | None,
    sensors: SensorsConfig,
) -> tuple[Floats, tuple[str, ...]]:
    """Return the (n * ViewCorrections.COUNT, m) root of the views' corrections, and its sources.

    The sources (m,) are the parts of a budget (`budget.PARTS`) that the columns stand for.

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
    drive *= sensors.laser_range_scale_sigma if is_laser else registration.stretch_sigma
    size = ViewCorrections.COUNT
    own = np.zeros((count, size, _OWN * len(views)))
    tilt = np.deg2rad(sensors.view_tilt_sigma_deg) if camera is None else camera.view_tilt
    pan = np.deg2rad(sensors.view_pan_sigma_deg)
    for place, view in enumerate(views):
        sigmas = {"scale": view.scale_sigma, "roll": tilt, "pitch": tilt, "pan": pan}
        for column, (name, sigma) in enumerate(sigmas.items()):
            own[view.index, ViewCorrections.place(name), _OWN * place + column] = sigma
    moved = np.zeros((count, size, pose_root.shape[1] + 1))
    moved[:, :3, :-1] = pose_root.reshape(count, 3, -1)
    moved[:, :3, -1] = drive
    root = np.concatenate([moved, own], axis=2).reshape(size * count, -1)
    sources = ["poses"] * pose_root.shape[1] + ["drive_scale"]
    sources += ["depth", "tilt", "tilt", "tilt"] * len(views)
    kept = np.abs(root).max(axis=0) > 0
    return root[:, kept], tuple(s for s, keep in zip(sources, kept, strict=True) if keep)


_OWN = 4  # of a view: how far its camera is from the top, roll, pitch and pan


def _root(covariance: Floats, count: int) -> Floats:
    size = 3 * count
    if covariance.shape != (size, size) or not np.isfinite(covariance).all():
        raise ValueError(f"expected a finite ({size}, {size}) covariance, got {covariance.shape}")
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    kept = values > max(1e-14, 1e-9 * float(values.max(initial=0.0)))
    root: Floats = vectors[:, kept] * np.sqrt(values[kept])
    return root
