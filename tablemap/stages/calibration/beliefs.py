"""What is believed of the camera before the floor is seen."""

from __future__ import annotations

import numpy as np

from tablemap.config import CalibrationConfig, SensorsConfig
from tablemap.stages.calibration.adjustment import Beliefs, Common
from tablemap.stages.snapshots import Snapshot
from tablemap.stages.snapshots.rounding import Rounding

_TOP_SIGMA = 0.05  # metres about the height at which a segmentation saw the top
_TOP_SLOPE = np.deg2rad(0.2)  # tops stand on uneven floors
_TOP_SAG = 0.001  # metres
_MAP_LEAN = np.deg2rad(0.5)
_HELD_LOOSER = 3.0  # tilt errors of a tracked camera over those of a head; its square for heights


def camera_beliefs(
    snapshots: tuple[Snapshot, ...],
    rounding: Rounding,
    config: CalibrationConfig,
    sensors: SensorsConfig,
) -> Beliefs:
    """Return the priors of the camera before the floor is seen.

    The focal length is not fitted, as on planes its error looks like tilts and a field.
    """
    tilt = float(np.deg2rad(sensors.camera_tilt_sigma_deg))
    held = _is_held(snapshots, config)
    loose = _HELD_LOOSER if held else 1.0
    return Beliefs(
        common=Common(
            roll=tilt,
            pitch=tilt,
            lean_x=_MAP_LEAN if held else 0.0,
            lean_y=_MAP_LEAN if held else 0.0,
            height=sensors.held_camera_height_sigma if held else sensors.camera_height_sigma,
            offset=rounding.sigma,
            top=_TOP_SIGMA,
            slope_x=_TOP_SLOPE,
            slope_y=_TOP_SLOPE,
            sag=_TOP_SAG,
        ),
        scale=sensors.depth_scale_sigma,
        view_tilt=loose * float(np.deg2rad(sensors.view_tilt_sigma_deg)),
        view_lift=loose**2 * sensors.view_height_sigma,
        lean_share=(0.0, 0.0) if held else (1.0, sensors.base_lean_share),
        rounding=rounding,
    )


def _is_held(snapshots: tuple[Snapshot, ...], config: CalibrationConfig) -> bool:
    """Tell whether the camera was held by a hand.

    A robot's head pans and nods on a measured mounting. The image of a camera in a hand also rolls
    from view to view. Its height and the level of its map are only as good as its tracking.
    """
    rolls = np.arcsin([np.clip(s.base_from_camera[2, 0], -1.0, 1.0) for s in snapshots])
    return len(rolls) > 1 and float(np.std(rolls)) > np.deg2rad(config.held_roll_deg)
