"""The joint refinement of all stops, and the errors of the ranges that it finds on the way."""

from __future__ import annotations

import numpy as np
import pytest

from tablemap.geometry import Floats, Pose2
from tablemap.stages.registration import StopScan
from tablemap.stages.registration.polish import RangePrior, polish

STOPS = 8
ROOM = np.array([[-2.6, -2.1], [2.9, -2.1], [2.9, 1.0], [1.8, 1.0], [1.8, 2.4], [-2.6, 2.4]])
ANGLES = np.linspace(-2.1, 2.1, 481)
BEND = 0.002
ALL_PAIRS = [(a, b) for a in range(STOPS) for b in range(a)]


def _ring() -> Floats:
    """Return the poses (n, 3) of a ring of stops that face its middle."""
    turns = np.arange(STOPS) * 2 * np.pi / STOPS
    return np.column_stack([1.3 * np.cos(turns), 1.3 * np.sin(turns), turns + np.pi])


def _stop(index: int, pose: Floats, rng: np.random.Generator) -> StopScan:
    """Cast the beams against the room's walls; the ranges bend with the beam's angle."""
    beams = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
    rays = Pose2.from_array(pose).rotate(beams)
    start, along = ROOM, np.roll(ROOM, -1, axis=0) - ROOM
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    facing = rays @ outward.T
    reach = np.einsum("ij,ij->i", start - pose[:2], outward) / np.where(facing == 0, 1e-9, facing)
    place = pose[:2] + reach[..., None] * rays[:, None]
    share = np.einsum("rwj,wj->rw", place - start, along) / np.sum(along**2, axis=1)
    reach = np.where((reach > 0) & (share >= 0) & (share <= 1), reach, np.inf)
    wall = reach.argmin(axis=1)
    ranges = reach.min(axis=1) + BEND * (np.cos(ANGLES) - np.sin(2 * ANGLES))
    ranges = ranges + rng.normal(0.0, 0.001, len(ranges))
    normals = Pose2.from_array(pose).inverse().rotate(-outward[wall])
    points = ranges[:, None] * beams
    return StopScan(index, points, normals, 30, beams, np.zeros(2), ANGLES, ranges, 0.001)


def _spread(poses: Floats, truth: Floats) -> float:
    """Return by how much the ring of stops is too wide, metres."""
    ring, true = poses[:, :2] - poses[:, :2].mean(axis=0), truth[:, :2] - truth[:, :2].mean(axis=0)
    return float((np.linalg.norm(ring, axis=1) - np.linalg.norm(true, axis=1)).mean())


def _polished(ranges: RangePrior) -> tuple[Floats, Floats, Floats]:
    """Return the poses, their covariance and the factors of the errors of the ranges."""
    truth, rng = _ring(), np.random.default_rng(5)
    stops = [_stop(i, pose, rng) for i, pose in enumerate(truth)]
    found = polish(
        stops,
        truth + rng.normal(0.0, 0.002, truth.shape),
        ALL_PAIRS,
        [],
        gates=(0.2, 0.1, 0.05),
        kernel=0.01,
        correlation=8.0,
        ranges=ranges,
    )
    return found.poses, found.covariance, found.range_errors


def _sigma(covariance: Floats) -> float:
    """Return the standard deviation of `_spread`, metres."""
    outward = (_ring() * [1.0, 1.0, 0.0] / 1.3 / STOPS).ravel()
    return float(np.sqrt(outward @ covariance @ outward))


def test_ranges_that_bend_with_the_angle_do_not_widen_the_ring() -> None:
    """Most of the ring's error goes, the rest is within two sigmas, and the bend is found."""
    stiff, too_sure, _ = _polished(RangePrior(0.01))
    assert abs(_spread(stiff, _ring())) > max(0.0012, 4 * _sigma(too_sure))
    poses, covariance, errors = _polished(RangePrior(0.01, 0.002))
    assert covariance.shape == (3 * STOPS, 3 * STOPS)
    assert abs(_spread(poses, _ring())) < 0.5 * abs(_spread(stiff, _ring()))
    assert abs(_spread(poses, _ring())) < 2 * _sigma(covariance) < 0.002
    # After the constant: cosine of one, two and three times the angle, then sine.
    assert -errors[1] == pytest.approx(BEND, abs=0.001)
    assert errors[5] == pytest.approx(BEND, abs=0.001)
