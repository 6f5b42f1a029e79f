"""Correction of the snapshots by tilt, height and depth field of the camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tablemap.config import CalibrationConfig, SensorsConfig
from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.stages.calibration.adjustment import (
    CLOSE_GATES_M,
    COUNT,
    FIELD,
    NAMES,
    PLACE,
    WIDE_GATES_M,
    Adjustment,
    Beliefs,
    Common,
    adjust,
    residuals,
    unadjusted,
    view_tilts,
)
from tablemap.stages.calibration.beliefs import camera_beliefs
from tablemap.stages.calibration.corrected import corrected
from tablemap.stages.calibration.field import REFERENCE_M
from tablemap.stages.calibration.level import floor_level, lowered
from tablemap.stages.calibration.levels import LevelSamples, SeenTop, collect
from tablemap.stages.calibration.maps import residual_maps
from tablemap.stages.calibration.result import Calibration
from tablemap.stages.snapshots import Snapshot
from tablemap.stages.snapshots.rounding import FINE, Rounding
from tablemap.words import counted

_LEAST_FLOOR_SHARE = 0.15
_IMPLAUSIBLE_SIGMAS = 2.0


def calibrate(
    snapshots: tuple[Snapshot, ...],
    *,
    config: CalibrationConfig,
    sensors: SensorsConfig,
    rounding: Rounding = FINE,
) -> Calibration:
    """Adjust the camera's tilt, height and depth field to the floor of all views.

    A flat floor seen from one height cannot distinguish the depth scale from the camera's height in
    TF: the priors divide the offset between them, and the covariance contains the ambiguity. If the
    floor is not near z = 0, or only with an implausible scale, it is searched at other heights.
    `flatten` adds the table's top when that is known. ``rounding`` shifts all depths.
    """
    beliefs = camera_beliefs(snapshots, rounding, config, sensors)
    samples = collect(snapshots, config, rounding=rounding)
    result = _calibrated(snapshots, samples, beliefs, config)
    missed = result.floor_pixels < config.least_floor_pixels
    level = floor_level(snapshots)
    if not missed and not _excess(result.adjustment, rounding, config):
        # A higher level is no floor where a flat one is seen below it, but a top that hides it.
        if level is None or level > -_ELSEWHERE_M:
            return result
        # The band about z = 0 widens with the distance, and may hold far parts of a lower floor.
        found = _at_level(snapshots, level, beliefs, config, sensors)
        is_wider = found.floor_pixels > _WIDER * result.floor_pixels
        return (
            _believed(found, config)
            if is_wider and not _excess(found.adjustment, rounding, config)
            else result
        )
    if level is not None and result.is_cluttered and level > 0:
        level = None  # a floor under things on it is lower than they are
    if level is not None and abs(level) >= (config.floor_band if missed else config.least_level):
        found = _at_level(snapshots, level, beliefs, config, sensors)
        if missed or not _excess(found.adjustment, rounding, config):
            result = found
    return _believed(result, config)


def flatten(calibration: Calibration, top: SeenTop, *, config: CalibrationConfig) -> Calibration:
    """Adjust the camera again, to the floor and to the top that a first segmentation found.

    Two planes at two distances show the growth of the depth field, and the height of the top. If
    the first adjustment was rejected, this one is, too.
    """
    if any(w.code == "accuracy.calibration" for w in calibration.warnings):
        return calibration
    snapshots = calibration.recorded
    samples = collect(
        snapshots,
        config,
        corrected=calibration.snapshots,
        top=top,
        rounding=calibration.beliefs.rounding,
    )
    if samples is None or not samples.is_top.any():
        return calibration
    if calibration.is_cluttered:
        samples = _of_top(samples)
    result = _calibrated(snapshots, samples, calibration.beliefs, config)
    known = {warning.code for warning in calibration.warnings}
    new = [warning for warning in result.warnings if warning.code not in known]
    warnings = (*calibration.warnings, *new)
    return _believed(
        replace(
            result,
            sees_top=True,
            floor_z=calibration.floor_z,
            is_cluttered=calibration.is_cluttered,
            warnings=warnings,
        ),
        config,
    )


def _at_level(
    snapshots: tuple[Snapshot, ...],
    level: float,
    beliefs: Beliefs,
    config: CalibrationConfig,
    sensors: SensorsConfig,
) -> Calibration:
    """Calibrate with z counted from the level of the floor that was found, and add a warning.

    Only a floor at the base's own origin confirms the camera's height above it.
    """
    base = float(np.median([snapshot.base_z for snapshot in snapshots]))
    if abs(level - base) > config.least_level:
        unknown = sensors.camera_height_sigma_off_base
        beliefs = replace(beliefs, common=replace(beliefs.common, height=unknown))
    else:
        level = base
    snapshots = tuple(lowered(snapshot, level) for snapshot in snapshots)
    samples = collect(snapshots, config, rounding=beliefs.rounding)
    result = _calibrated(snapshots, samples, beliefs, config)
    warnings = [
        ProcessWarning(
            "calibration.floor_level",
            "calibration",
            f"the floor lies at z = {level:+.3f} m in the fixed frame, not at 0; heights are "
            "measured from this floor",
        )
    ]
    if config.least_level < abs(level - base) < _STEP_M:
        warnings.append(
            ProcessWarning(
                "accuracy.floor_level",
                "calibration",
                f"the floor lies {100 * abs(level - base):.1f} cm "
                f"{'above' if level > base else 'below'} the base's origin; a wrong depth scale, "
                "focal length or camera height causes this, or a base's frame above the floor; "
                "check the camera's calibration and its height in TF",
            )
        )
    return replace(result, floor_z=level, warnings=(*warnings, *result.warnings))


_ELSEWHERE_M = 0.1  # a floor so far from z = 0 is not the one that was taken for it
_WIDER = 3.0  # times as many pixels as near z = 0
_STEP_M = 0.15  # a base stands on the floor: a floor closer than this is its own


def _calibrated(
    snapshots: tuple[Snapshot, ...],
    samples: LevelSamples | None,
    beliefs: Beliefs,
    config: CalibrationConfig,
) -> Calibration:
    sees_top = samples is not None and bool(samples.is_top.any())
    pixels = 0 if samples is None else samples.pixels
    if samples is not None and (pixels >= config.least_floor_pixels or sees_top):
        samples, adjustment = _in_its_axes(samples, beliefs)
        if not _is_cluttered(snapshots, samples, adjustment):
            return _result(snapshots, samples, adjustment, beliefs, ())
        if sees_top:
            samples, adjustment = _in_its_axes(_of_top(samples), beliefs)
            return _result(snapshots, samples, adjustment, beliefs, ())
        why = (
            f"what {counted(len(snapshots), 'view')} show of a floor is little and not flat, like "
            "things on it; let the camera see more of it"
        )
    else:
        why = (
            f"the floor has only {counted(pixels, 'pixel')} in {counted(len(snapshots), 'view')}, "
            f"{config.least_floor_pixels} are needed"
        )
    warning = ProcessWarning(
        "calibration.no_floor",
        "calibration",
        f"{why}; the camera's tilt and scale were left as recorded",
    )
    nothing = unadjusted(beliefs, len(snapshots))
    result = _result(snapshots, None, nothing, beliefs, (warning,))
    return replace(result, is_cluttered=pixels >= config.least_floor_pixels)


def _is_cluttered(
    snapshots: tuple[Snapshot, ...], samples: LevelSamples, adjustment: Adjustment
) -> bool:
    """Tell whether the little that passes for floor is not flat: then it is things on the floor.

    Where more is seen, a floor may have steps: a rug, a platform.
    """
    whole = sum(snapshot.depth.size for snapshot in snapshots)
    if samples.pixels >= _LITTLE_FLOOR * whole or samples.is_top.all():
        return False
    floor = samples.only(~samples.is_top)
    return _support(floor, adjustment) < _LEAST_FLAT * len(floor.depth)


def _of_top(samples: LevelSamples) -> LevelSamples:
    return replace(samples.only(samples.is_top), pixels=0)


_LITTLE_FLOOR = 0.01  # of the images' pixels
_LEAST_FLAT = 0.75  # of these that fit the adjusted floor: floors of real clips have 0.8 and more


def _in_its_axes(samples: LevelSamples, beliefs: Beliefs) -> tuple[LevelSamples, Adjustment]:
    """Adjust in the axes of the head or of the base, whichever fit better.

    If the camera is tilted on its head, the error turns with the head; if the base leans, it does
    not. Floor and top show which it is.
    """
    best = _adjusted(samples, beliefs)
    if samples.turns.any():
        still = samples.in_base_axes()
        other = _adjusted(still, beliefs)
        if _disagreement(still, other) < _disagreement(samples, best):
            return still, other
    return samples, best


def _disagreement(samples: LevelSamples, adjustment: Adjustment) -> float:
    residual = residuals(samples, adjustment.values, adjustment.own)
    return float(np.sum(samples.weight * np.minimum(np.abs(residual), WIDE_GATES_M[-1]) ** 2))


def _adjusted(samples: LevelSamples, beliefs: Beliefs) -> Adjustment:
    """Adjust to the floor, and not to a platform.

    The search begins with a wide band. If its result is implausible and there is also a plane close
    to z = 0, then a platform, a low shelf or a step was the larger surface.
    """
    wide = adjust(samples, beliefs)
    strain = _strain(wide, beliefs)
    if strain > _IMPLAUSIBLE_SIGMAS:
        close = adjust(samples, beliefs, gates=CLOSE_GATES_M)
        likelier = _strain(close, beliefs) < strain
        if likelier and _support(samples, close) >= _LEAST_FLOOR_SHARE * _support(samples, wide):
            return close
    return wide


def _strain(adjustment: Adjustment, beliefs: Beliefs) -> float:
    """Return the largest correction of tilt, height or scale, in prior sigmas."""
    common, sigma = adjustment.common, beliefs.common
    believed = np.hypot(beliefs.scale, sigma.offset / REFERENCE_M)
    scale = (adjustment.scale - 1) / believed
    strains = [common.roll / sigma.roll, common.pitch / sigma.pitch, common.height / sigma.height]
    return float(np.max(np.abs([*strains, scale])))


def _support(samples: LevelSamples, adjustment: Adjustment) -> int:
    residual = residuals(samples, adjustment.values, adjustment.own)
    return int((np.abs(residual) < WIDE_GATES_M[-1] + samples.sigma).sum())


def _excess(adjustment: Adjustment, rounding: Rounding, config: CalibrationConfig) -> list[str]:
    """Return words for the implausible values of an adjustment."""
    roll, pitch = np.rad2deg(adjustment.common.roll), np.rad2deg(adjustment.common.pitch)
    scale = adjustment.scale
    cut_off = 0.5 * rounding.step / REFERENCE_M
    found = []
    if max(abs(roll), abs(pitch)) > config.plausible_tilt_deg:
        found.append(f"a roll of {roll:+.2f} and a pitch of {pitch:+.2f} degrees")
    if abs(scale - 1) > config.plausible_scale + cut_off:
        sigma = np.sqrt(adjustment.covariance[FIELD.start, FIELD.start])
        found.append(f"a depth scale of {scale:.3f} (sigma {sigma:.3f})")
    return found


def _believed(result: Calibration, config: CalibrationConfig) -> Calibration:
    """Return a plausible calibration as it is; replace an implausible one by the recorded camera.

    Then a warning is added, and the rejected correction makes the covariance larger, as it may
    still be right.
    """
    excess = _excess(result.adjustment, result.beliefs.rounding, config)
    if not excess:
        return result
    values, beliefs = result.adjustment.values, result.beliefs
    common = Common(
        **{
            name: float(np.hypot(getattr(beliefs.common, name), values[PLACE[name]]))
            if name in ("roll", "pitch", "height")
            else getattr(beliefs.common, name)
            for name in NAMES
        }
    )
    wide = replace(
        beliefs, common=common, scale=float(np.hypot(beliefs.scale, values[FIELD.start]))
    )
    warning = ProcessWarning(
        "accuracy.calibration",
        "calibration",
        f"By the floor, the camera has {' and '.join(excess)}; this is implausible, so it was left "
        "as recorded; check the camera's mounting in TF and its calibration",
    )
    left = unadjusted(wide, len(result.recorded))
    same = _result(result.recorded, None, left, wide, (*result.warnings, warning))
    return replace(same, floor_pixels=result.floor_pixels, floor_z=result.floor_z)


def _result(
    snapshots: tuple[Snapshot, ...],
    samples: LevelSamples | None,
    adjustment: Adjustment,
    beliefs: Beliefs,
    warnings: tuple[ProcessWarning, ...],
) -> Calibration:
    before = after = 0.0
    floor = top = None
    turns = np.zeros(len(snapshots))
    if samples is not None:
        turns = samples.turns
        first = residuals(samples, _recorded(adjustment), np.zeros_like(adjustment.own))
        last = residuals(samples, adjustment.values, adjustment.own)
        counted = ~samples.is_top & (np.abs(last) < np.maximum(3 * samples.sigma, 0.01))
        if counted.any():
            before = float(np.sqrt(np.mean(first[counted] ** 2)))
            after = float(np.sqrt(np.mean(last[counted] ** 2)))
        floor = residual_maps(samples, first, last, ~samples.is_top)
        top = residual_maps(samples, first, last, samples.is_top)
    headings = np.array([snapshot.map_from_base.yaw for snapshot in snapshots]) + turns
    tilts = view_tilts(headings, adjustment.common, adjustment.own)
    as_adjusted = tuple(
        corrected(snapshot, adjustment, tilt, own, beliefs, float(turn))
        for snapshot, tilt, own, turn in zip(snapshots, tilts, adjustment.own, turns, strict=True)
    )
    return Calibration(
        adjustment=adjustment,
        beliefs=beliefs,
        floor_pixels=0 if samples is None else samples.pixels,
        floor_rms_before=before,
        floor_rms_after=after,
        recorded=snapshots,
        snapshots=as_adjusted,
        warnings=warnings,
        turns=turns,
        floor=floor,
        top=top,
    )


def _recorded(adjustment: Adjustment) -> Floats:
    """Return the unknowns of the camera as recorded, with the top as estimated."""
    values = np.zeros(COUNT)
    for name in ("top", "slope_x", "slope_y", "sag", "lean_x", "lean_y"):
        values[PLACE[name]] = adjustment.values[PLACE[name]]
    return values
