"""From snapshots to corrected ones: tilt, scale, height, and the focal length where it shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tablemap.config import CalibrationConfig, SensorsConfig
from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.stages.calibration.fit import COMMON, fit_axes, fit_floor, views_apart
from tablemap.stages.calibration.floor import Floor, collect_floor, correction, residuals
from tablemap.stages.calibration.focal import estimate_focal, with_focal
from tablemap.stages.calibration.level import floor_level, lowered
from tablemap.stages.calibration.result import Calibration, FocalLength
from tablemap.stages.snapshots import Snapshot


def calibrate(
    snapshots: tuple[Snapshot, ...], *, config: CalibrationConfig, sensors: SensorsConfig
) -> Calibration:
    """Fit camera tilt and depth scale to the floor pixels of all views.

    A robust Gauss-Newton fit of z = 0 with priors. On a flat floor seen from one height the scale
    and the camera's height in TF cannot be told apart: the priors share the offset out, and the
    covariance keeps what they leave open. Where the views' floors disagree (a camera held by hand)
    each view also gets a small tilt and height of its own. A focal length that is clearly wrong is
    corrected first, as it would pass for a tilt and a scale. A floor that is not near z = 0, or
    that is so only with an implausible scale, is looked for at other heights.
    """
    floor = collect_floor(snapshots, config)
    result = _calibrate(snapshots, floor, config, sensors)
    missed = floor is None or floor.pixels < config.least_floor_pixels
    if not missed and abs(result.depth_scale - 1) <= config.plausible_scale:
        return result
    level = floor_level(snapshots)
    if level is None or abs(level) < (config.floor_band if missed else config.least_level):
        return result
    found = _at_level(snapshots, level, config, sensors)
    doubted = any(w.code == "accuracy.calibration" for w in found.warnings)
    return result if doubted and not missed else found


def _at_level(
    snapshots: tuple[Snapshot, ...],
    level: float,
    config: CalibrationConfig,
    sensors: SensorsConfig,
) -> Calibration:
    """Calibrate with z counted from the level where the floor was found, and say so.

    Only a floor at the base's own origin confirms the camera's height over it.
    """
    base = float(np.median([snapshot.base_z for snapshot in snapshots]))
    if abs(level - base) > config.least_level:
        unknown = sensors.camera_height_sigma_off_base
        sensors = sensors.model_copy(update={"camera_height_sigma": unknown})
    else:
        level = base
    snapshots = tuple(lowered(snapshot, level) for snapshot in snapshots)
    result = _calibrate(snapshots, collect_floor(snapshots, config), config, sensors)
    warning = ProcessWarning(
        "calibration.floor_level",
        "calibration",
        f"the floor lies at z = {level:+.3f} m of the fixed frame, not at 0: heights count from it",
    )
    return replace(result, floor_z=level, warnings=(warning, *result.warnings))


def _calibrate(
    snapshots: tuple[Snapshot, ...],
    floor: Floor | None,
    config: CalibrationConfig,
    sensors: SensorsConfig,
) -> Calibration:
    step = 0.0 if floor is None else floor.step
    prior = np.array(
        [np.deg2rad(sensors.camera_tilt_sigma_deg)] * 2
        + [
            sensors.depth_scale_sigma,
            _height_sigma(snapshots, config, sensors),
            max(step / np.sqrt(12), 1e-6),
        ]
    )
    if floor is None or floor.pixels < config.least_floor_pixels:
        pixels = 0 if floor is None else floor.pixels
        warning = ProcessWarning(
            "calibration.no_floor",
            "calibration",
            f"{pixels} floor pixels were seen in {len(snapshots)} views, "
            f"{config.least_floor_pixels} are needed: the camera's tilt and scale were left as "
            "recorded",
        )
        return _result(snapshots, np.zeros(5), np.diag(prior**2), {}, floor, (warning,))
    floor, common, covariance = fit_axes(floor, prior, len(snapshots))
    focal = estimate_focal(snapshots, floor, common, prior, config, sensors)
    warnings = []
    if focal is not None and focal.applied:
        snapshots = with_focal(snapshots, focal.scale)
        floor = collect_floor(snapshots, config) or floor
        floor, common, covariance = fit_axes(floor, prior, len(snapshots))
        warnings.append(_focal_warning(focal))
    by_view: dict[int, Floats] = {}
    able, scatter = views_apart(floor, common, len(snapshots))
    if scatter > config.view_scatter:
        tilt = np.deg2rad(sensors.view_tilt_sigma_deg)
        view_prior = np.array([tilt, tilt, sensors.view_height_sigma])
        common, own, covariance = fit_floor(floor, prior, (view_prior, able), len(snapshots))
        by_view = {s.index: own[i] for i, s in enumerate(snapshots)}
    warnings += _doubts(common, covariance, config)
    result = _result(snapshots, common, covariance, by_view, floor, tuple(warnings))
    return replace(result, focal=focal)


def _height_sigma(
    snapshots: tuple[Snapshot, ...], config: CalibrationConfig, sensors: SensorsConfig
) -> float:
    """Return how well the camera's height is known before the floor is seen.

    A robot's head pans and nods on a mounting that was measured; a camera whose image rolls from
    view to view is held by a hand, and its height is only as good as what tracks it.
    """
    rolls = np.arcsin([np.clip(s.base_from_camera[2, 0], -1.0, 1.0) for s in snapshots])
    if len(rolls) > 1 and float(np.std(rolls)) > np.deg2rad(config.held_roll_deg):
        return sensors.held_camera_height_sigma
    return sensors.camera_height_sigma


def _focal_warning(focal: FocalLength) -> ProcessWarning:
    return ProcessWarning(
        "calibration.focal_length",
        "calibration",
        f"the floor, seen under {focal.tilts} tilts, asks for {focal.scale:.3f} times the recorded "
        f"focal length (sigma {focal.sigma:.3f}); it was corrected: check the camera's calibration",
    )


def _doubts(common: Floats, covariance: Floats, config: CalibrationConfig) -> list[ProcessWarning]:
    roll, pitch = np.rad2deg(common[0]), np.rad2deg(common[1])
    doubts = []
    if max(abs(roll), abs(pitch)) > config.plausible_tilt_deg:
        doubts.append(f"a roll of {roll:+.2f} and a pitch of {pitch:+.2f} degrees")
    if abs(common[2]) > config.plausible_scale:
        doubts.append(
            f"a depth scale of {1 + common[2]:.3f} (sigma {np.sqrt(covariance[2, 2]):.3f})"
        )
    return [
        ProcessWarning(
            "accuracy.calibration",
            "calibration",
            f"The floor asks for {doubt}: check the camera's mounting in TF and its calibration",
        )
        for doubt in doubts
    ]


def _result(
    snapshots: tuple[Snapshot, ...],
    common: Floats,
    covariance: Floats,
    by_view: dict[int, Floats],
    floor: Floor | None,
    warnings: tuple[ProcessWarning, ...],
) -> Calibration:
    own = np.array([by_view.get(s.index, np.zeros(3)) for s in snapshots]).reshape(-1, 3)
    before = after = 0.0
    if floor is not None:
        first = residuals(floor, np.zeros(COMMON), np.zeros_like(own))
        last = residuals(floor, common, own)
        counted = np.abs(last) < np.maximum(3 * floor.sigma, 0.01)
        if counted.any():
            before = float(np.sqrt(np.mean(first[counted] ** 2)))
            after = float(np.sqrt(np.mean(last[counted] ** 2)))
    scale = 1 + float(common[2])
    corrected = []
    turns = np.zeros(len(snapshots)) if floor is None else floor.turns
    for snapshot, mine, turn in zip(snapshots, own, turns, strict=True):
        rotation, lift = correction(common, mine, float(turn))
        mount = snapshot.base_from_camera.copy()
        mount[:3, :3] = rotation @ mount[:3, :3]
        mount[2, 3] += lift
        better = snapshot.corrected(base_from_camera=mount, depth_scale=scale)
        if abs(common[4]) > 1e-5:
            depth = (better.depth + np.float32(common[4])).astype(np.float32)
            better = replace(better, depth=depth)
        corrected.append(better)
    return Calibration(
        roll=float(common[0]),
        pitch=float(common[1]),
        depth_scale=scale,
        height_correction=float(common[3]),
        covariance=covariance[:3, :3],
        floor_pixels=0 if floor is None else floor.pixels,
        floor_rms_before=before,
        floor_rms_after=after,
        snapshots=tuple(corrected),
        warnings=warnings,
        joint_covariance=covariance,
        by_view=by_view,
    )
