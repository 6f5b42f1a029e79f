"""The camera's offset and the laser's scale, solved from all comparisons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.config import SensorsConfig
from tablemap.geometry import Floats
from tablemap.robust import geman_mcclure, reduced_chi_square
from tablemap.stages.crosscheck.rows import BIASES, Rows

ASKED = 4
"""The first unknowns: forward, left and yaw of the camera in the base, and the laser's scale."""

_SETTLES = 12
# The prior of the offset is as loose as errors of TF are large: the data decide.
_OFFSET_SIGMA = 0.02  # metres
_YAW_SIGMA = 0.01  # radians
_KERNEL = 9.0  # squared sigmas: such a residual has a quarter of its weight
_FREEDOM = 0.05  # metres: the outline is nearly free


@dataclass(frozen=True, eq=False)
class MountingSolution:
    """What the comparisons say of camera and laser.

    - ``asked``: (4,) metres forward and left, radians of yaw, and the factor less one that mends
      the laser's ranges: it is negative where they are too long
    - ``covariance``: (4, 4), the priors included
    - ``widening``: pixels that depth adds to a leg on each side, and its standard deviation
    """

    asked: Floats
    covariance: Floats
    widening: tuple[float, float]

    @property
    def range_scale(self) -> tuple[float, float]:
        """By what share the laser's ranges are too long, and its standard deviation."""
        return -float(self.asked[3]), float(np.sqrt(self.covariance[3, 3]))


def prior_sigmas(sensors: SensorsConfig) -> Floats:
    """Return the prior standard deviations (4,) of the first unknowns."""
    return np.array(
        [_OFFSET_SIGMA, _OFFSET_SIGMA, _YAW_SIGMA, sensors.laser_range_scale_sigma_wide]
    )


def solve(
    rows: Rows,
    pose_covariance: Floats,
    tilt_sigmas: Floats,
    far_bias_sigma: float,
    sensors: SensorsConfig,
) -> MountingSolution:
    """Solve offset, scales, shared biases, outline, legs and poses by robust least squares.

    ``pose_covariance`` (3n, 3n) is the registration's; ``tilt_sigmas`` (2,) in radians are those of
    the camera's roll and pitch, which look like a turn and a shift; ``far_bias_sigma`` (metres) is
    the prior of the bias that far edges share.
    """
    present = np.unique(rows.view).astype(np.int64)
    design = _design(rows, present)
    is_leg = rows.is_leg > 0
    # The unknowns of legs are in sigmas, those of the outline in metres and radians.
    freedom = np.where(np.abs(rows.basis[is_leg]).sum(axis=0) > 0, 1.0, _FREEDOM)
    sigma = np.concatenate(
        [
            prior_sigmas(sensors),
            [sensors.calibrated_depth_scale_sigma_crosscheck],
            tilt_sigmas,
            [sensors.edge_bias_sigma, far_bias_sigma],
            [sensors.silhouette_width_sigma_px, sensors.silhouette_middle_sigma_px],
            [sensors.edge_bias_sigma],
            freedom,
        ]
    )
    shared = len(sigma)
    prior = np.zeros((design.shape[1],) * 2)
    prior[:shared, :shared] = np.diag(sigma**-2.0)
    at = (3 * present[:, None] + np.arange(3)).ravel()
    poses = pose_covariance[np.ix_(at, at)] + 1e-8 * np.eye(len(at))
    prior[shared:, shared:] = np.linalg.inv(poses)

    state: Floats = np.zeros(design.shape[1], dtype=np.float64)
    information: Floats = np.asarray(prior, dtype=np.float64)
    for _ in range(_SETTLES):
        squared = (rows.distance + design @ state) ** 2 / rows.variance
        scatter = np.ones(len(rows))
        for kind in (is_leg, ~is_leg):
            if kind.any():
                scatter[kind] = max(1.0, reduced_chi_square(squared[kind]))
        weight = geman_mcclure(squared / (_KERNEL * scatter), 1.0 / (rows.variance * scatter))
        information = np.asarray(prior + (design.T * weight) @ design, dtype=np.float64)
        pull = design.T @ (weight * rows.distance)
        following = np.asarray(np.linalg.solve(information, -pull), dtype=np.float64)
        settled = float(np.abs(following - state)[:2].max()) < 1e-6
        state = following
        if settled:
            break
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    # The depth's scale and two tilts stand between what is asked for and the shared biases.
    width = ASKED + 3 + BIASES.index("width of silhouettes")
    widening = float(state[width]), float(np.sqrt(covariance[width, width]))
    return MountingSolution(state[:ASKED], covariance[:ASKED, :ASKED], widening)


def _design(rows: Rows, present: np.ndarray) -> Floats:
    """Return derivatives (n, ...) by the first unknowns, depth scale, biases, basis and poses."""
    normal = rows.normal

    def along(vectors: Floats) -> Floats:
        return np.asarray(np.einsum("ij,ij->i", normal, vectors))

    def turned(arm: Floats) -> Floats:
        return np.asarray(normal[:, 1] * arm[:, 0] - normal[:, 0] * arm[:, 1])

    shared = [
        along(rows.forward),
        along(rows.left),
        turned(rows.ray),
        along(rows.stretch),
        along(rows.ray),
        rows.tilt,
    ]
    slot = np.searchsorted(present, rows.view)
    own = np.zeros((len(rows), 3 * len(present)))
    at = np.arange(len(rows))
    own[at, 3 * slot], own[at, 3 * slot + 1] = normal[:, 0], normal[:, 1]
    own[at, 3 * slot + 2] = turned(rows.arm)
    return np.column_stack([*shared, rows.bias, rows.basis, own])
