"""Pairs of stops aligned by Open3D's ICP, an iteration at a time, each projected to SE(2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from tablemap import imports
from tablemap.events import Record
from tablemap.geometry import Floats, Pose2, wrap_angle
from tablemap.robust import kernel_weight
from tablemap.stages.registration.result import Pair, PairIteration, PairKind, PairStarted, StopScan
from tablemap.words import counted

_ITERATIONS_A_GATE = 5
_SOURCE_POINTS = 360
_NORMAL_COSINE = 0.9
_LEAST_SIGMA = 0.002
_LEAST_INLIERS = 20
# Directions that fewer points than this share bind are noise (a radian counts as a metre).
_HELD_POINTS = 0.05
_DEPTH_SIGMA = 0.01
_DEPTH_KERNEL = 0.03  # metres, Geman-McClure's scale: depth at three metres errs by so much
_DEPTH_PAIR_POINTS = 20.0  # most independent points in a pair: errors of depth come in patches
_DEPTH_PRIOR = (0.05, 0.05, 0.04)


@dataclass(frozen=True, eq=False)
class Cloud:
    """The points that ICP aligns.

    - ``points``, ``normals``: (n, 3) metres and unit vectors, in a base
    - ``handle``: Open3D's copy of both
    - ``tree``: finds the nearest points
    """

    points: Floats
    normals: Floats
    handle: Any
    tree: cKDTree


def make_cloud(points: Floats, normals: Floats) -> Cloud:
    """Lift (n, 2) or (n, 3) points and normals to a cloud that Open3D knows."""
    open3d = imports.open3d()
    flat = np.zeros((len(points), 1))
    if points.shape[1] == 2:
        points, normals = np.hstack([points, flat]), np.hstack([normals, flat])
    handle = open3d.geometry.PointCloud()
    handle.points = open3d.utility.Vector3dVector(np.ascontiguousarray(points, dtype=np.float64))
    handle.normals = open3d.utility.Vector3dVector(np.ascontiguousarray(normals, dtype=np.float64))
    return Cloud(points, normals, handle, cKDTree(points))


def thinned(cloud: Cloud, most: int) -> Cloud:
    """Return at most ``most`` of a cloud's points, taken evenly from their order."""
    every = max(1, -(-len(cloud.points) // most))
    return cloud if every == 1 else make_cloud(cloud.points[::every], cloud.normals[::every])


def laser_clouds(stop: StopScan) -> tuple[Cloud, Cloud]:
    """Return a stop's cloud twice: thinned, to be a source, and whole, to be a target."""
    whole = make_cloud(stop.points, stop.normals)
    return thinned(whole, _SOURCE_POINTS), whole


def align_laser_pair(
    source: int,
    target: int,
    clouds: tuple[Cloud, Cloud],
    target_from_source: Pose2,
    *,
    gates: tuple[float, ...],
    kernel: float,
    correlation: float,
    record: Record,
) -> Pair:
    """Align a planar source to a target by point-to-plane ICP from wide gates to narrow ones.

    In directions that the geometry leaves open, the start is kept: along bare walls ICP would slide
    off.
    """
    icp = imports.open3d().pipelines.registration
    once = icp.ICPConvergenceCriteria(max_iteration=1)
    source_cloud, target_cloud = clouds
    pose = target_from_source
    record(PairStarted(source, target, pose, source_cloud.points, target_cloud.points))
    iteration = 0
    for gate in gates:
        loss = icp.GMLoss(max(kernel, gate / 3))
        estimation = icp.TransformationEstimationPointToPlane(loss)
        rows, residuals, _ = correspondences(clouds, pose, gate=gate)
        weight = np.square(1.0 / (1.0 + np.square(residuals / max(kernel, gate / 3))))
        speaking = (rows.T * weight) @ rows
        gain = np.linalg.solve(speaking + _HELD_POINTS * np.eye(3), speaking)
        for _ in range(_ITERATIONS_A_GATE):
            result = icp.registration_icp(
                source_cloud.handle, target_cloud.handle, gate, pose.lifted(), estimation, once
            )
            # Open3D's threads sum in any order, which changes the last bits: rounding makes runs
            # repeat.
            apart = Pose2.projected(np.asarray(result.transformation)).as_array()
            apart -= target_from_source.as_array()
            apart[2] = wrap_angle(apart[2])
            found = target_from_source.as_array() + gain @ apart
            moved = Pose2.from_array(np.round(found, 9))
            inliers = len(result.correspondence_set)
            step = pose.inverse() @ moved
            pose = moved
            record(
                PairIteration(
                    source,
                    target,
                    iteration,
                    pose,
                    float(result.fitness),
                    float(result.inlier_rmse),
                    inliers,
                )
            )
            iteration += 1
            if inliers < _LEAST_INLIERS or np.abs(step.as_array()).max() < 1e-5:
                break
    return weigh_pair(
        source,
        target,
        "laser",
        clouds,
        pose,
        gate=gates[-1],
        kernel=kernel,
        correlation=correlation,
    )


def align_depth_pair(
    source: int,
    target: int,
    kind: PairKind,
    clouds: tuple[Cloud, Cloud],
    target_from_source: Pose2,
    *,
    gates: tuple[float, ...],
    record: Record,
) -> Pair:
    """Align two depth views by point-to-plane steps in SE(2) over Open3D's correspondences.

    The start enters each step as a prior. It is kept in directions that the geometry leaves open.
    """
    prior = np.diag(1.0 / np.square(_DEPTH_PRIOR))
    pose, iteration, gate = target_from_source, 0, gates[0]
    record(PairStarted(source, target, pose, clouds[0].points, clouds[1].points))
    for gate in gates:
        scale = max(_DEPTH_KERNEL, gate / 3)
        for _ in range(_ITERATIONS_A_GATE):
            rows, residuals, share = correspondences(clouds, pose, gate=gate)
            if len(residuals) < _LEAST_INLIERS:
                break
            weight = np.square(scale**2 / (scale**2 + residuals**2))
            weight /= _DEPTH_SIGMA**2 * max(float(weight.sum()) / _DEPTH_PAIR_POINTS, 1.0)
            apart = pose.as_array() - target_from_source.as_array()
            apart[2] = wrap_angle(apart[2])
            step = np.linalg.solve(
                (rows.T * weight) @ rows + prior, -((rows.T * weight) @ residuals + prior @ apart)
            )
            pose = Pose2.from_array(pose.as_array() + step)
            rmse = float(np.sqrt(np.mean(residuals**2)))
            record(PairIteration(source, target, iteration, pose, share, rmse, len(residuals)))
            iteration += 1
            if np.abs(step).max() < 5e-4:
                break
    return weigh_pair(
        source,
        target,
        kind,
        clouds,
        pose,
        gate=gate,
        kernel=_DEPTH_KERNEL,
        correlation=1.0,
        most_points=_DEPTH_PAIR_POINTS,
        least_sigma=_DEPTH_SIGMA,
    )


def weigh_pair(
    source: int,
    target: int,
    kind: PairKind,
    clouds: tuple[Cloud, Cloud],
    pose: Pose2,
    *,
    gate: float,
    kernel: float,
    correlation: float,
    most_points: float = np.inf,
    least_sigma: float = _LEAST_SIGMA,
) -> Pair:
    """Give an aligned pair the information of its correspondences.

    This is the SE(2) normal matrix of the point-to-plane residuals, divided by their variance.
    ``correlation`` neighbouring residuals count as one, and all count as ``most_points`` at most.
    """
    rows, residuals, share = correspondences(clouds, pose, gate=gate)
    inliers = len(residuals)
    if inliers < _LEAST_INLIERS:
        reason = f"only {counted(inliers, 'point')} with a correspondence"
        return Pair(
            source, target, kind, pose, np.zeros((3, 3)), share, 0.0, inliers, False, reason
        )
    weight = kernel_weight(residuals, kernel)
    variance = float((weight * residuals**2).sum() / max(weight.sum(), 1e-9))
    rmse = float(np.sqrt(variance))
    effective = min(1.0 / correlation, most_points / max(float(weight.sum()), 1.0))
    scale = effective / max(variance, least_sigma**2)
    information = scale * (rows.T * weight) @ rows
    return Pair(source, target, kind, pose, information, share, rmse, inliers, True, None)


def correspondences(
    clouds: tuple[Cloud, Cloud], pose: Pose2, *, gate: float
) -> tuple[Floats, Floats, float]:
    """Return (n, 3) Jacobian rows (x, y, yaw), (n,) residuals in metres, and the share matched.

    The correspondences are those of Open3D's ICP: nearest neighbours within the gate. Pairs whose
    normals disagree are left out. The tree is built once; Open3D would build it for every step.
    """
    source, target = clouds
    turned = pose.apply(source.points)
    distance, index = target.tree.query(turned, distance_upper_bound=gate)
    found = np.flatnonzero(np.isfinite(distance))
    normals = pose.rotate(source.normals[found, :2])
    onto = target.normals[index[found]]
    agree = np.einsum("ij,ij->i", normals, onto[:, :2]) + source.normals[found, 2] * onto[:, 2]
    good = agree > _NORMAL_COSINE
    found, onto = found[good], onto[good]
    turned = turned[found]
    residuals = np.einsum("ij,ij->i", onto, turned - target.points[index[found]])
    arm = turned[:, :2] - pose.translation
    rows = np.stack(
        [onto[:, 0], onto[:, 1], onto[:, 1] * arm[:, 0] - onto[:, 0] * arm[:, 1]], axis=1
    )
    return rows, residuals, len(found) / max(len(source.points), 1)
