"""The best SE(2) fit of a model's snapshots onto the true ones.

It brings both into one frame, so that the free offset of the localisation does not count.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tablemap.evaluation.score import Error
from tablemap.evaluation.truth import TrueSnapshot, Truth
from tablemap.geometry import Floats, Pose2, wrap_angle
from tablemap.model import SnapshotPose, TableModel

_SAME_STAMP_NS = 50_000_000


def fit_rigid(source: Floats, target: Floats) -> Pose2:
    """Return the SE(2) pose that best maps (n, 2) points onto their partners (Umeyama 1991)."""
    from_mean, to_mean = source.mean(axis=0), target.mean(axis=0)
    a, b = source - from_mean, target - to_mean
    yaw = float(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
    turned = Pose2(0.0, 0.0, yaw).apply(from_mean)
    return Pose2(float(to_mean[0] - turned[0]), float(to_mean[1] - turned[1]), yaw)


@dataclass(frozen=True)
class SnapshotFit:
    """What the fit of the used snapshots says; nothing if fewer than two have a true one.

    - ``truth_from_model``: the fit
    - ``poses``: how far each snapshot then lies from the true one, metres
    - ``headings``: by how much each is turned, radians, without sign
    """

    truth_from_model: Pose2 | None = None
    poses: tuple[Error, ...] = ()
    headings: tuple[float, ...] = ()


def align(model: TableModel, truth: Truth) -> SnapshotFit:
    """Fit the used snapshots onto the true ones."""
    estimated, true, sigmas = [], [], []
    for snapshot, known in matched(model, truth):
        if not snapshot.used:
            continue
        pose = known.map_from_base
        true.append(Pose2(pose.x, pose.y, pose.yaw))
        at = snapshot.map_from_base
        estimated.append(Pose2(at.x, at.y, at.yaw))
        sigmas.append(snapshot.sigma.xy if snapshot.sigma else None)
    if len(true) < 2:
        return SnapshotFit()
    fit = fit_rigid(
        np.array([p.translation for p in estimated]), np.array([p.translation for p in true])
    )
    poses, headings = [], []
    for estimate, there, sigma in zip(estimated, true, sigmas, strict=True):
        placed = fit @ estimate
        distance = float(np.hypot(placed.x - there.x, placed.y - there.y))
        # The stated sigma is for one axis; the distance has two.
        planar = None if sigma is None else sigma * np.sqrt(2)
        poses.append(Error("pose", distance, planar, 0.0, distance))
        headings.append(abs(wrap_angle(placed.yaw - there.yaw)))
    return SnapshotFit(fit, tuple(poses), tuple(headings))


def matched(model: TableModel, truth: Truth) -> Iterator[tuple[SnapshotPose, TrueSnapshot]]:
    """Yield each of the model's snapshots that has a true one of its stamp, with that one."""
    if not truth.snapshots:
        return
    known = sorted(truth.snapshots, key=lambda snapshot: snapshot.stamp_ns)
    stamps = np.array([snapshot.stamp_ns for snapshot in known], dtype=np.int64)
    for snapshot in model.snapshots:
        i = int(np.argmin(np.abs(stamps - snapshot.stamp_ns)))
        if abs(int(stamps[i]) - snapshot.stamp_ns) <= _SAME_STAMP_NS:
            yield snapshot, known[i]
