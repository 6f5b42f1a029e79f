"""A snapshot as the adjusted camera has seen it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from tablemap.geometry import Floats
from tablemap.stages.calibration.adjustment import Adjustment, Beliefs
from tablemap.stages.snapshots import Snapshot

_LEAST_OFFSET = 1e-5  # metres: less is nothing


def corrected(
    snapshot: Snapshot,
    adjustment: Adjustment,
    tilt: Floats,
    own: Floats,
    beliefs: Beliefs,
    turn: float,
) -> Snapshot:
    """Return a snapshot with the adjusted camera and depth.

    A base that leans turns about its wheels: it moves the camera, a metre above, by millimetres.
    """
    common = adjustment.common
    rotation: Floats = Rotation.from_euler("xy", tilt).as_matrix()
    if turn:
        about = Rotation.from_euler("z", turn).as_matrix()
        rotation = about @ rotation @ about.T
    mount = snapshot.base_from_camera.copy()
    mount[:3, :3] = rotation @ mount[:3, :3]
    roll, pitch = own[:2] * beliefs.lean_share
    c, s = np.cos(turn), np.sin(turn)
    mount[:2, 3] += mount[2, 3] * np.array([c * pitch + s * roll, s * pitch - c * roll])
    mount[2, 3] += common.height + own[2]
    depth = snapshot.depth * adjustment.field.multiplier(snapshot.camera, snapshot.depth)
    if abs(common.offset) > _LEAST_OFFSET:
        shift = np.float32(common.offset) * beliefs.rounding.share(snapshot.depth)
        depth = depth + shift
    return replace(
        snapshot,
        base_from_camera=mount,
        depth=depth.astype(np.float32),
        recorded_noise=snapshot.noise,
    )
