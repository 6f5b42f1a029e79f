"""The floor's pixels in all views, and how far a correction leaves them from z = 0."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tablemap.config import CalibrationConfig
from tablemap.geometry import Floats
from tablemap.stages.snapshots import Snapshot, depth_sigma, turned_left
from tablemap.stages.snapshots.noise import coarse_step
from tablemap.stages.snapshots.normals import upward_share

STRIDE_PX = 2
BLOCK_PX = 32  # the errors of neighbouring pixels are alike: a block of this side counts once
MOST_SAMPLES = 60_000
LEAST_UPWARD = np.cos(np.deg2rad(25.0))
UNEVEN_M = 0.002  # floors are flat to about this


@dataclass(frozen=True, eq=False)
class Floor:
    """Floor samples of all views.

    ``arms`` (n, 3) from the camera, in base axes that turn with the head: by ``turns`` (views,)
    radians, all 0 of a head that does not; ``steep`` (n,) how far down a metre of depth
    leads; ``camera_z``, ``sigma``, ``weight`` and ``view`` (n,). ``beside`` (n,) is the part of an
    arm's height that comes from beside the optical axis, which a focal length stretches. ``step``
    metres between depth values, where they are coarse, else 0.
    """

    arms: Floats
    steep: Floats
    camera_z: Floats
    sigma: Floats
    weight: Floats
    view: NDArray[np.int64]
    pixels: int
    step: float
    beside: Floats
    turns: Floats

    def in_base_axes(self) -> Floor:
        """Return the same floor in axes that do not turn with the head."""
        arms = _turned(self.arms, self.turns[self.view])
        return replace(self, arms=arms, turns=np.zeros_like(self.turns))


def collect_floor(snapshots: tuple[Snapshot, ...], config: CalibrationConfig) -> Floor | None:
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
        beside = arms[chosen][:, 2] - depth[chosen] * snapshot.base_from_camera[2, 2]
        index = np.full(int(chosen.sum()), view)
        parts.append((arms[chosen], sigma[chosen] * np.abs(steep), index, steep, beside))
    if not parts:
        return None
    arms_all = np.concatenate([p[0] for p in parts]).astype(np.float64)
    sigma_all = np.sqrt(np.concatenate([p[1] for p in parts]).astype(np.float64) ** 2 + UNEVEN_M**2)
    views = np.concatenate([p[2] for p in parts]).astype(np.int64)
    heights = np.array([s.base_from_camera[2, 3] for s in snapshots])[views]
    turns = turned_left(np.stack([s.base_from_camera for s in snapshots]))
    if turns.any():
        arms_all = _turned(arms_all, -turns[views])
    share = min(1.0, (STRIDE_PX * thin / BLOCK_PX) ** 2)
    return Floor(
        arms=arms_all,
        steep=np.concatenate([p[3] for p in parts]).astype(np.float64),
        camera_z=heights,
        sigma=sigma_all,
        weight=share / sigma_all**2,
        view=views,
        pixels=pixels,
        step=float(np.median(steps)),
        beside=np.concatenate([p[4] for p in parts]).astype(np.float64),
        turns=turns,
    )


def _turned(arms: Floats, angles: Floats) -> Floats:
    """Turn (n, 3) arms about the vertical by (n,) radians."""
    c, s = np.cos(angles), np.sin(angles)
    x, y, z = arms.T
    return np.column_stack([c * x - s * y, s * x + c * y, z])


def correction(common: Floats, own: Floats, turn: float) -> tuple[Floats, float]:
    """Return the (3, 3) rotation about the camera and the lift of it, for axes turned by an angle.

    ``own`` (3,) is the view's roll, pitch and height on top of the ``common`` ones.
    """
    roll, pitch, lift = common[0], common[1], common[3]
    roll, pitch, lift = roll + own[0], pitch + own[1], lift + own[2]
    rotation: Floats = Rotation.from_euler("xy", [roll, pitch]).as_matrix()
    if turn:
        about = Rotation.from_euler("z", turn).as_matrix()
        rotation = about @ rotation @ about.T
    return rotation, float(lift)


def residuals(floor: Floor, common: Floats, own: Floats) -> Floats:
    """Return the (n,) heights of the samples under a correction: what should be 0."""
    roll, pitch = common[0] + own[floor.view, 0], common[1] + own[floor.view, 1]
    x, y, z = floor.arms.T
    # Third row of R_x(roll) then R_y(pitch), as `correction` composes them (extrinsic).
    turned = -np.sin(pitch) * x + np.cos(pitch) * (np.sin(roll) * y + np.cos(roll) * z)
    heights: Floats = (
        floor.camera_z
        + common[3]
        + own[floor.view, 2]
        + (1 + common[2]) * turned
        + common[4] * floor.steep
    )
    return heights
