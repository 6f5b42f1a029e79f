"""The focal length, which the floor gives away where the camera looked down at many angles.

In one view a wrong focal length is a tilt and a scale: with a factor 1 + q on all that lies beside
the optical axis, a camera that looks down by t seems tilted by q sin(t) cos(t). Only views tilted
differently tell the two apart.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tablemap.config import CalibrationConfig, SensorsConfig
from tablemap.geometry import Floats
from tablemap.robust import geman_mcclure
from tablemap.stages.calibration.floor import Floor, residuals
from tablemap.stages.calibration.result import FocalLength
from tablemap.stages.snapshots import Snapshot

_GATES_M = (0.03, 0.03, 0.02, 0.02, 0.015, 0.010, 0.010, 0.010)
_LEAST_SAMPLES = 200
_SAME_TILT = np.deg2rad(0.5)
_PARAMETERS = 5  # roll, pitch, scale - 1, height, spread


def estimate_focal(
    snapshots: tuple[Snapshot, ...],
    floor: Floor,
    common: Floats,
    prior: Floats,
    config: CalibrationConfig,
    sensors: SensorsConfig,
) -> FocalLength | None:
    """Fit the focal length together with tilt, scale and height, from what these were without it.

    None where too few different tilts were seen, or depth in coarse steps. The sigma is the larger
    of the fit's own and that of the spread between tilts (a sandwich, clustered by tilt), with what
    a tilt that errs in proportion to itself would feign.
    """
    if floor.step > 0:
        return None
    tilts = np.array([-np.arcsin(np.clip(s.base_from_camera[2, 2], -1, 1)) for s in snapshots])
    cluster = np.round(tilts / _SAME_TILT).astype(np.int64)[floor.view]
    names, place, counts = np.unique(cluster, return_inverse=True, return_counts=True)
    if int((counts >= _LEAST_SAMPLES).sum()) < config.focal_tilts:
        return None
    beside = floor.beside
    sigmas = np.append(prior[:4], sensors.focal_length_sigma)
    none = np.zeros((len(snapshots), 3))
    state = np.append(common[:4], 0.0)
    information, rows, pull = np.eye(_PARAMETERS), np.zeros((0, 0)), np.zeros(0)
    for gate in _GATES_M:
        heights = residuals(floor, np.append(state[:4], common[4]), none)
        heights = heights + (1 + state[2]) * state[4] * beside
        width = np.maximum(gate, 3 * floor.sigma)
        weight = geman_mcclure((heights / width) ** 2, floor.weight)
        # Where the ray meets the floor, as the fit without it does.
        reach = -floor.camera_z / (floor.arms[:, 2] + state[4] * beside)
        x, y = floor.arms[:, 0] * reach, floor.arms[:, 1] * reach
        rows = np.stack([y, -x, -floor.camera_z, np.ones_like(x), beside * reach], axis=1)
        information = (rows.T * weight) @ rows + np.diag(sigmas**-2.0)
        pull = weight * heights
        right = -rows.T @ pull - state / sigmas**2
        state = state + np.asarray(np.linalg.solve(information, right), dtype=np.float64)
    scale = 1.0 / (1.0 + float(state[4]))
    sigma = _sigma(information, rows * pull[:, None], place, len(names))
    tilt = tilts[floor.view]
    spread = float(np.std(0.5 * np.sin(2 * tilt)))
    feigned = sensors.camera_tilt_gain_sigma * float(np.std(tilt)) / max(spread, 1e-6)
    sigma = float(np.hypot(sigma, feigned))
    clear = abs(scale - 1) > config.focal_significance * sigma
    return FocalLength(scale, sigma, len(names), clear and abs(scale - 1) < config.plausible_focal)


def with_focal(snapshots: tuple[Snapshot, ...], scale: float) -> tuple[Snapshot, ...]:
    """Return the snapshots with their focal lengths multiplied."""
    cameras = {
        camera: replace(camera, fx=camera.fx * scale, fy=camera.fy * scale)
        for camera in {snapshot.camera for snapshot in snapshots}
    }
    return tuple(replace(snapshot, camera=cameras[snapshot.camera]) for snapshot in snapshots)


def _sigma(information: Floats, scores: Floats, place: NDArray[np.int64], clusters: int) -> float:
    """Return the last parameter's standard deviation, by the fit and by the clusters' spread."""
    inverse = np.linalg.inv(information)
    summed = np.zeros((clusters, scores.shape[1]))
    np.add.at(summed, place, scores)
    spread = inverse @ (summed.T @ summed) @ inverse
    spread = spread * clusters / max(clusters - _PARAMETERS, 1)
    return float(np.sqrt(max(inverse[-1, -1], spread[-1, -1])))
