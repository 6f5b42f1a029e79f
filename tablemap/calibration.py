"""Camera tilt and depth scale, given away by the floor."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tablemap.config import CalibrationConfig
from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.snapshots import Snapshot, depth_sigma
from tablemap.snapshots.noise import coarse_step
from tablemap.snapshots.normals import upward_share

STRIDE_PX = 2
BLOCK_PX = 32  # the errors of neighbouring pixels are alike: a block of this side counts once
MOST_SAMPLES = 60_000
LEAST_UPWARD = np.cos(np.deg2rad(25.0))
GATES_M = (0.06, 0.04, 0.025, 0.015, 0.010, 0.010, 0.010)
CLOSE_GATES_M = (0.015, 0.012, 0.010, 0.010, 0.010, 0.010)
IMPLAUSIBLE_SIGMAS = 2.0
LEAST_FLOOR_SHARE = 0.15
COMMON = 5  # roll, pitch, scale - 1, height, offset
UNEVEN_M = 0.002  # floors are flat to about this


@dataclass(frozen=True, eq=False)
class Calibration:
    """What the floor of all views says about the camera.

    ``roll`` and ``pitch`` (radians, about the base's x and y axes) and ``depth_scale`` (factor on
    every depth) turn the recorded camera into the corrected one; ``covariance`` (3, 3) is theirs,
    in that order, priors included. ``height_correction`` (metres) lifts the camera where the floor
    lies beside z = 0. ``floor_rms_before`` and ``floor_rms_after`` are the floor's residuals in
    metres.
    ``snapshots`` are the corrected ones, in the order given. ``depth_offset`` (metres, added after
    the scale) is fitted only to depth published in coarse steps, whose rounding is unknown.
    ``joint_covariance`` (5, 5) goes on with the height correction, which the floor ties to the
    scale, and the offset. ``by_view`` has, by snapshot index, roll, pitch and height (3,) on top of
    the common ones, where the views' floors disagreed.
    """

    roll: float
    pitch: float
    depth_scale: float
    height_correction: float
    covariance: Floats
    floor_pixels: int
    floor_rms_before: float
    floor_rms_after: float
    snapshots: tuple[Snapshot, ...]
    warnings: tuple[ProcessWarning, ...]
    joint_covariance: Floats
    by_view: dict[int, Floats]
    depth_offset: float

    def height_sigma(self, height: float) -> float:
        """Return what the camera leaves unknown of a height above the floor, in metres.

        A point at that height below a camera at height c has z = c + h + s (z - c): its error is
        that of h plus (z - c) times that of s, plus what an offset along the ray does.
        """
        if not self.snapshots:
            return 0.0
        camera = float(np.median([s.base_from_camera[2, 3] for s in self.snapshots]))
        axis = float(np.median([s.base_from_camera[2, 2] for s in self.snapshots]))
        gradient = np.array([0.0, 0.0, height - camera, 1.0, axis])
        return float(np.sqrt(gradient @ self.joint_covariance @ gradient))


@dataclass(frozen=True, eq=False)
class _Floor:
    """Floor samples of all views.

    ``arms`` (n, 3) from the camera, in base axes; ``steep`` (n,) how far down a metre of depth
    leads; ``camera_z``, ``sigma``, ``weight`` and ``view`` (n,). ``step`` metres between depth
    values, where they are coarse, else 0.
    """

    arms: Floats
    steep: Floats
    camera_z: Floats
    sigma: Floats
    weight: Floats
    view: NDArray[np.int64]
    pixels: int
    step: float


def calibrate(snapshots: tuple[Snapshot, ...], *, config: CalibrationConfig) -> Calibration:
    """Fit camera tilt and depth scale to the floor pixels of all views.

    A robust Gauss-Newton fit of z = 0 with priors. On a flat floor seen from one height the scale
    and the camera's height in TF cannot be told apart: the priors share the offset out, and the
    covariance keeps what they leave open. Where the views' floors disagree (a camera held by hand)
    each view also gets a small tilt and height of its own.
    """
    floor = _collect_floor(snapshots, config)
    step = 0.0 if floor is None else floor.step
    prior = np.array(
        [np.deg2rad(config.tilt_sigma_deg)] * 2
        + [config.scale_sigma, config.camera_height_sigma, max(step / np.sqrt(12), 1e-6)]
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
    common, covariance = _fit_common(floor, prior, len(snapshots))
    by_view: dict[int, Floats] = {}
    able, scatter = _views_apart(floor, common, len(snapshots))
    if scatter > config.view_scatter:
        tilt = np.deg2rad(config.view_tilt_sigma_deg)
        view_prior = np.array([tilt, tilt, config.view_height_sigma])
        common, own, covariance = _fit(floor, prior, (view_prior, able), len(snapshots))
        by_view = {s.index: own[i] for i, s in enumerate(snapshots)}
    return _result(
        snapshots, common, covariance, by_view, floor, tuple(_doubts(common, covariance, config))
    )


def _collect_floor(snapshots: tuple[Snapshot, ...], config: CalibrationConfig) -> _Floor | None:
    """Gather pixels that face up near z = 0, from every view."""
    parts, steps = [], []
    pixels = 0
    thin = max(1, round(np.sqrt(len(snapshots) * 12_000 / MOST_SAMPLES)))
    for view, snapshot in enumerate(snapshots):
        depth = snapshot.depth[::STRIDE_PX, ::STRIDE_PX]
        if min(depth.shape) < 32:
            continue
        arms = (snapshot.camera.rays[::STRIDE_PX, ::STRIDE_PX] * depth[..., None]) @ (
            snapshot.base_from_camera[:3, :3].T.astype(np.float32)
        )
        z = arms[..., 2] + np.float32(snapshot.base_from_camera[2, 3])
        distance = np.hypot(arms[..., 0], arms[..., 1])
        with np.errstate(invalid="ignore"):
            near = np.abs(z) < config.floor_band + config.floor_slope * distance
        if not near.any():
            continue
        sigma = depth_sigma(snapshot)[::STRIDE_PX, ::STRIDE_PX]
        step = coarse_step(snapshot)
        steps.append(step)
        with np.errstate(invalid="ignore"):
            near &= upward_share(arms, 9 if step > 0 else 4) > LEAST_UPWARD
        chosen = np.zeros_like(near)
        chosen[::thin, ::thin] = near[::thin, ::thin]
        pixels += int(near.sum()) * STRIDE_PX**2
        steep = arms[chosen][:, 2] / np.maximum(depth[chosen], 0.05)
        parts.append(
            (arms[chosen], sigma[chosen] * np.abs(steep), np.full(int(chosen.sum()), view), steep)
        )
    if not parts:
        return None
    arms_all = np.concatenate([p[0] for p in parts]).astype(np.float64)
    sigma_all = np.sqrt(np.concatenate([p[1] for p in parts]).astype(np.float64) ** 2 + UNEVEN_M**2)
    views = np.concatenate([p[2] for p in parts]).astype(np.int64)
    heights = np.array([s.base_from_camera[2, 3] for s in snapshots])[views]
    share = min(1.0, (STRIDE_PX * thin / BLOCK_PX) ** 2)
    return _Floor(
        arms=arms_all,
        steep=np.concatenate([p[3] for p in parts]).astype(np.float64),
        camera_z=heights,
        sigma=sigma_all,
        weight=share / sigma_all**2,
        view=views,
        pixels=pixels,
        step=float(np.median(steps)),
    )


def _correction(common: Floats, own: Floats | None = None) -> tuple[Floats, float]:
    """Return the (3, 3) rotation about the camera and the lift of it."""
    roll, pitch, lift = common[0], common[1], common[3]
    if own is not None:
        roll, pitch, lift = roll + own[0], pitch + own[1], lift + own[2]
    rotation: Floats = Rotation.from_euler("xy", [roll, pitch]).as_matrix()
    return rotation, float(lift)


def _residuals(floor: _Floor, common: Floats, own: Floats) -> Floats:
    """Return the (n,) heights of the samples under a correction: what should be 0."""
    roll, pitch = common[0] + own[floor.view, 0], common[1] + own[floor.view, 1]
    x, y, z = floor.arms.T
    # Third row of R_x(roll) then R_y(pitch), as `_correction` composes them (extrinsic).
    turned = -np.sin(pitch) * x + np.cos(pitch) * (np.sin(roll) * y + np.cos(roll) * z)
    heights: Floats = (
        floor.camera_z
        + common[3]
        + own[floor.view, 2]
        + (1 + common[2]) * turned
        + common[4] * floor.steep
    )
    return heights


def _fit_common(floor: _Floor, prior: Floats, views: int) -> tuple[Floats, Floats]:
    """Return the common correction (5,) and its covariance, from the floor and not from a platform.

    The search begins wide. Where it ends in something implausible though a plane close to z = 0 is
    there too, a platform, a low shelf or a step was the larger surface.
    """
    none = np.zeros((views, 3))

    def supported(common: Floats) -> int:
        return int((np.abs(_residuals(floor, common, none)) < GATES_M[-1] + floor.sigma).sum())

    common, _, covariance = _fit(floor, prior, None, views)
    if float(np.max(np.abs(common / prior))) > IMPLAUSIBLE_SIGMAS:
        close, _, close_covariance = _fit(floor, prior, None, views, CLOSE_GATES_M)
        likelier = np.max(np.abs(close / prior)) < np.max(np.abs(common / prior))
        if likelier and supported(close) >= LEAST_FLOOR_SHARE * supported(common):
            return close, close_covariance
    return common, covariance


def _fit(
    floor: _Floor,
    prior: Floats,
    by_view: tuple[Floats, NDArray[np.bool_]] | None,
    views: int,
    gates: tuple[float, ...] = GATES_M,
) -> tuple[Floats, Floats, Floats]:
    """Return the common (5,) and the views' (views, 3) corrections, and the common covariance.

    The order is roll, pitch, scale - 1, height, offset. ``by_view`` has the prior (3,) of a view's
    own correction and which views (views,) show enough floor for one.
    """
    common, own = np.zeros(5), np.zeros((views, 3))
    view_prior, able = by_view if by_view is not None else (np.ones(3), np.zeros(views, dtype=bool))
    size = COMMON + (3 * views if able.any() else 0)
    information = np.eye(size)
    for gate in gates:
        residual = _residuals(floor, common, own)
        width = np.maximum(gate, 3 * floor.sigma)
        weight = floor.weight / (1 + (residual / width) ** 2) ** 2
        # Where the ray meets the floor, not where the noisy depth says: a regressor that shares
        # its noise with the residual draws the scale down.
        reach = -floor.camera_z / floor.arms[:, 2]
        x, y = floor.arms[:, 0] * reach, floor.arms[:, 1] * reach
        rows = np.stack([y, -x, -floor.camera_z, np.ones_like(x), floor.steep], axis=1)
        weighted = rows * weight[:, None]
        information = np.zeros((size, size))
        right = np.zeros(size)
        information[:COMMON, :COMMON] = rows.T @ weighted + np.diag(prior**-2.0)
        right[:COMMON] = -weighted.T @ residual - common / prior**2
        for view in range(views if able.any() else 0):
            a, b = COMMON + 3 * view, COMMON + 3 * view + 3
            information[a:b, a:b] = np.diag(view_prior**-2.0)
            if not able[view]:
                continue
            mine = floor.view == view
            part, wpart = rows[mine][:, [0, 1, 3]], weighted[mine][:, [0, 1, 3]]
            information[a:b, a:b] += part.T @ wpart
            cross = weighted[mine].T @ part
            information[:COMMON, a:b], information[a:b, :COMMON] = cross, cross.T
            right[a:b] = -wpart.T @ residual[mine] - own[view] / view_prior**2
        step = np.asarray(np.linalg.solve(information, right), dtype=np.float64)
        common = common + step[:COMMON]
        if able.any():
            own = own + step[COMMON:].reshape(views, 3)
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return common, own, covariance[:COMMON, :COMMON]


def _views_apart(floor: _Floor, common: Floats, views: int) -> tuple[NDArray[np.bool_], float]:
    """Return which views show enough floor, and the RMS of their floors' heights in metres."""
    residual = _residuals(floor, common, np.zeros((views, 3)))
    able = np.zeros(views, dtype=bool)
    medians = []
    for view in range(views):
        mine = residual[floor.view == view]
        close = mine[np.abs(mine) < GATES_M[0]]
        # Where most of what faces up lies elsewhere, it is not the floor that is seen.
        if len(close) >= 200 and 2 * len(close) >= len(mine):
            able[view] = True
            medians.append(float(np.median(close)))
    scatter = float(np.sqrt(np.mean(np.square(medians)))) if len(medians) >= 2 else 0.0
    return able, scatter


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
    floor: _Floor | None,
    warnings: tuple[ProcessWarning, ...],
) -> Calibration:
    own = np.array([by_view.get(s.index, np.zeros(3)) for s in snapshots]).reshape(-1, 3)
    before = after = 0.0
    if floor is not None:
        first = _residuals(floor, np.zeros(COMMON), np.zeros_like(own))
        last = _residuals(floor, common, own)
        counted = np.abs(last) < np.maximum(3 * floor.sigma, 0.01)
        if counted.any():
            before = float(np.sqrt(np.mean(first[counted] ** 2)))
            after = float(np.sqrt(np.mean(last[counted] ** 2)))
    scale = 1 + float(common[2])
    corrected = []
    for snapshot, mine in zip(snapshots, own, strict=True):
        rotation, lift = _correction(common, mine)
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
        depth_offset=float(common[4]),
    )
