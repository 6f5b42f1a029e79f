"""The priors of the nuisances in the joint fit."""

from __future__ import annotations

import numpy as np

from tablemap.config import SensorsConfig, SurfaceConfig
from tablemap.geometry import Floats
from tablemap.stages.outline import Outline, ViewEdges
from tablemap.stages.registration import Registration
from tablemap.stages.surface.motion import Mounting
from tablemap.stages.surface.nuisances import CommonNuisances, ViewCorrections


def pose_sigma(registration: Registration) -> float:
    """Return the standard deviation of a view's place, metres, the views' median."""
    variances = np.diag(registration.covariance).reshape(-1, 3)[:, :2]
    return float(np.sqrt(np.median(variances)))


def skew_sigma(registration: Registration, poses: Floats) -> float:
    """Return the standard deviation of a bend of the drive, radians; 0 for poses by laser."""
    if registration.source == "laser":
        return 0.0
    return registration.systematic / max(float(np.hypot(*poses[:, :2].T).mean()), 0.1)


def common_prior(
    outline: Outline,
    registration: Registration,
    config: SurfaceConfig,
    sensors: SensorsConfig,
    mounting: Mounting | None = None,
) -> tuple[Floats, Floats]:
    """Return the prior mean (c,) and precision (c, c) of the nuisances that all views share.

    The distance of the camera from the top, its roll and its pitch have the covariance that the
    calibration found. The registration's systematic error acts like a camera shifted in every base.
    The poses share a scale error, from the laser's ranges or the wheels: if it were left out, the
    fit would measure the depth scale by the poses.
    A near edge belongs to the side face. A far edge ends where the flat top ends: at a bevelled or
    rounded rim this is millimetres inside. The image of the side face shows a large bevel, but not
    a small rounding. The legs, which laser and camera both see, tell where the camera is. The edges
    cannot: a camera too far ahead looks like one that is nearer to the top. The legs also show by
    how much the depth image widens what stands before a background, as stereo's windows do.
    """
    camera = outline.camera
    unknown = sensors.calibrated_depth_scale_sigma_surface
    tilt = float(np.deg2rad(sensors.camera_tilt_sigma_deg))
    focal = sensors.camera_focal_sigma
    if registration.source == "laser":
        shift, stretch = sensors.laser_mounting_sigma, sensors.laser_range_scale_sigma
    else:
        held = camera is not None and camera.is_held
        focal = sensors.focal_length_sigma if held else sensors.calibrated_focal_length_sigma
        shift = max(registration.systematic / config.systematic_sigmas, 1e-6)
        stretch = registration.stretch_sigma
    yaw = sensors.laser_mounting_yaw_sigma
    ahead, left, yaw = _admitted(np.array([shift, shift, yaw]), mounting)
    sag, sag_sigma = (0.0, 0.0) if camera is None else camera.sag
    widening, widening_sigma = top_widening(mounting, sensors)
    set_back = sensors.rim_set_back if outline.is_dull else sensors.sharp_rim_set_back
    sigmas = CommonNuisances(
        scale=unknown,
        roll=tilt,
        pitch=tilt,
        yaw=yaw,
        focal=focal,
        near_bias=sensors.near_edge_bias,
        widening=widening_sigma,
        shift_x=ahead,
        shift_y=left,
        set_back=max(set_back, 1e-6),
        slope_x=_TOP_SLOPE,
        slope_y=_TOP_SLOPE,
        sag=float(np.hypot(_TOP_SAG, sag_sigma)),
        stretch=max(stretch, 1e-6),
    )
    covariance = np.diag(sigmas.pack() ** 2)
    if camera is not None:
        at = [CommonNuisances.place(name) for name in ("scale", "roll", "pitch")]
        covariance[np.ix_(at, at)] = camera.covariance[1:, 1:] + np.diag([1e-12] * 3)
    precision: Floats = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    mean = CommonNuisances(widening=widening, sag=sag).pack()
    if mounting is not None:
        seen = np.zeros((4, CommonNuisances.COUNT))
        for row, name in enumerate(("shift_x", "shift_y", "yaw", "stretch")):
            seen[row, CommonNuisances.place(name)] = 1.0
        seen[0, CommonNuisances.place("focal")] = -mounting.ahead
        pull = precision @ mean + seen.T @ mounting.estimate
        precision = precision + seen.T @ mounting.information @ seen
        mean = np.asarray(np.linalg.solve(precision, pull), dtype=np.float64)
    return mean, precision


def _admitted(believed: Floats, mounting: Mounting | None) -> tuple[float, float, float]:
    """Return the sigmas of the camera's place and heading in the base, as the legs admit them.

    If the legs clearly show an error that is not believed (a wrong TF; stamps that are late on a
    drive that never stops), the belief must not pull against them.
    """
    if mounting is not None:
        loose = np.diag([*(_LOOSE * believed) ** -2.0, 1.0])
        shown = np.abs(np.linalg.solve(mounting.information + loose, mounting.estimate))[:3]
        believed = np.where(shown > _UNBELIEVED * believed, shown, believed)
    ahead, left, yaw = believed.tolist()
    return ahead, left, yaw


_LOOSE = 30.0  # times what is believed
_UNBELIEVED = 3.0  # times what is believed


def widens(mounting: Mounting | None, sensors: SensorsConfig) -> bool:
    """Tell whether depth widens what stands before a background, as stereo's windows do.

    If laser and camera saw the same legs, these tell it, else the kind of the camera.
    """
    told = _told_by_legs(mounting, sensors)
    return sensors.top_widening_px > 0 if told is None else told[0] >= _CLEAR * told[1]


def _told_by_legs(mounting: Mounting | None, sensors: SensorsConfig) -> tuple[float, float] | None:
    """Return the widening of the legs' silhouettes and its error for the top, pixels."""
    if mounting is None or not np.isfinite(mounting.widening[1]):
        return None
    widening, sigma = mounting.widening
    return widening, float(np.hypot(sigma, sensors.edge_widening_sigma_px))


def top_widening(mounting: Mounting | None, sensors: SensorsConfig) -> tuple[float, float]:
    """Return by how many pixels depth widens the top, and the standard deviation.

    A camera that compares no windows widens nothing: for it only a clear sign in the legs'
    silhouettes counts.
    """
    mean, sigma = sensors.top_widening_px, sensors.top_widening_sigma_px
    told = _told_by_legs(mounting, sensors)
    widened = widens(mounting, sensors)
    if told is None or not (mean or widened or sensors.matching_window_px):
        return mean, sigma
    widening, noise = told
    sigma = max(sigma, sensors.silhouette_width_sigma_px) if widened else sigma
    gain = 1.0 / (1.0 + (noise / sigma) ** 2)
    return mean + gain * (widening - mean), float(noise * np.sqrt(gain))


def face_widening(mounting: Mounting | None, sensors: SensorsConfig) -> tuple[float, float]:
    """Return by how many pixels depth lowers the end of a side face, and the standard deviation.

    The legs' silhouettes tell it in both directions: mixed pixels lie on neither surface, and make
    a thing narrower. But silhouettes are widened along the rows of the image and a face across
    them, which what compares or filters along rows does not widen alike.
    """
    by_window = sensors.window_face_share * sensors.matching_window_px
    pixels = max(sensors.top_widening_px, by_window)
    sigma = max(sensors.top_widening_sigma_px, by_window)
    told = _told_by_legs(mounting, sensors)
    if told is not None and abs(told[0] - pixels) > _CLEAR * told[1]:
        pixels, sigma = told
    elif told is not None:
        gain = 1.0 / (1.0 + (told[1] / sigma) ** 2)
        pixels, sigma = pixels + gain * (told[0] - pixels), told[1] * float(np.sqrt(gain))
    return pixels, float(np.hypot(sigma, _ACROSS * pixels))


_CLEAR = 2.0  # sigmas
_ACROSS = 0.6  # share of a widening along rows: by how much that across them differs (sigma)
_TOP_SAG = 0.0005  # metres (sigma): no top sags just as the calibration's parabola
_TOP_SLOPE = np.deg2rad(0.1)  # sigma of the top's slope, after the calibration by floor and top


def corrections_root(
    views: list[ViewEdges],
    poses: Floats,
    registration: Registration,
    outline: Outline,
    sensors: SensorsConfig,
) -> tuple[Floats, tuple[str, ...]]:
    """Return a root (n * ViewCorrections.COUNT, m) of the corrections' covariance, and its sources.

    The sources (m,) are the parts of a budget (`budget.PARTS`) to which the columns belong.

    The root times m independent unit normals gives corrections with their prior covariance. The
    mean pose is in the null space of the relative covariance of the poses (n, 3), and so does not
    move. A view's roll and pitch are partly a lean of its base, which moves its camera too.
    """
    camera = outline.camera
    count = len(poses)
    pose_root = _root(registration.covariance, count)
    size = ViewCorrections.COUNT
    own = np.zeros((count, size, len(_OWN) * len(views)))
    tilt = np.deg2rad(sensors.view_tilt_sigma_deg) if camera is None else camera.view_tilt
    by_roll, by_pitch = (0.0, 0.0) if camera is None else camera.lean
    shift = 0.0 if camera is None else camera.view_shift
    pan = np.deg2rad(sensors.view_pan_sigma_deg)
    for place, view in enumerate(views):
        sigmas = {"scale": view.scale_sigma, "roll": tilt, "pitch": tilt, "pan": pan}
        mine = own[view.index, :, len(_OWN) * place : len(_OWN) * (place + 1)]
        for column, (name, sigma) in enumerate(sigmas.items()):
            mine[ViewCorrections.place(name), column] = sigma
        heading = poses[view.index, 2] + outline.turns.get(view.index, 0.0)
        c, s = np.cos(heading), np.sin(heading)
        at = [ViewCorrections.place("x"), ViewCorrections.place("y")]
        mine[at, 1] = tilt * by_roll * np.array([s, -c])
        mine[at, 2] = tilt * by_pitch * np.array([c, s])
        mine[at, 4] = shift * np.array([c, s])
    moved = np.zeros((count, size, pose_root.shape[1]))
    moved[:, :3] = pose_root.reshape(count, 3, -1)
    root = np.concatenate([moved, own], axis=2).reshape(size * count, -1)
    sources = ["poses"] * pose_root.shape[1]
    sources += _OWN * len(views)
    kept = np.abs(root).max(axis=0) > 0
    return root[:, kept], tuple(s for s, keep in zip(sources, kept, strict=True) if keep)


# What a view's own scale, roll, pitch, pan and shift belong to in a budget.
_OWN = ["depth", "tilt", "tilt", "tilt", "tilt"]


def _root(covariance: Floats, count: int) -> Floats:
    size = 3 * count
    if covariance.shape != (size, size) or not np.isfinite(covariance).all():
        raise ValueError(f"expected a finite ({size}, {size}) covariance, got {covariance.shape}")
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    kept = values > max(1e-14, 1e-9 * float(values.max(initial=0.0)))
    root: Floats = vectors[:, kept] * np.sqrt(values[kept])
    return root
