"""The joint refinement of all stops, and the errors of the ranges that it finds on the way."""

from __future__ import annotations

import numpy as np
import pytest

from tablemap.geometry import Floats, Pose2, compose
from tablemap.stages.registration import StopScan
from tablemap.stages.registration.polish import Polished, RangePrior, polish

STOPS = 8
ROOM = np.array([[-2.6, -2.1], [2.9, -2.1], [2.9, 1.0], [1.8, 1.0], [1.8, 2.4], [-2.6, 2.4]])
ANGLES = np.linspace(-2.1, 2.1, 481)
BEND = 0.002
ALL_PAIRS = [(a, b) for a in range(STOPS) for b in range(a)]


def _ring() -> Floats:
    """Return the poses (n, 3) of a ring of stops that face its middle."""
    turns = np.arange(STOPS) * 2 * np.pi / STOPS
    return np.column_stack([1.3 * np.cos(turns), 1.3 * np.sin(turns), turns + np.pi])


def _stop(
    index: int,
    pose: Floats,
    rng: np.random.Generator,
    *,
    turn: Floats | None = None,
    took: float = 0,
) -> StopScan:
    """Cast the beams against the room's walls; the ranges bend with the beam's angle.

    ``turn`` (3,) is the base's motion during a turn of the laser. The scan ``took`` a part of it,
    from its first beam to its last, and does not say so.
    """
    motion = np.zeros(3) if turn is None else turn
    share = np.linspace(0.0, 1.0, len(ANGLES))[:, None]
    beams = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
    bases = compose(np.tile(pose, (len(ANGLES), 1)), took * share * motion)
    rays = _rotated(beams, bases[:, 2])
    start, along = ROOM, np.roll(ROOM, -1, axis=0) - ROOM
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    facing = rays @ outward.T
    reach = np.einsum("rwj,wj->rw", start - bases[:, None, :2], outward)
    reach = reach / np.where(facing == 0, 1e-9, facing)
    place = bases[:, None, :2] + reach[..., None] * rays[:, None]
    part = np.einsum("rwj,wj->rw", place - start, along) / np.sum(along**2, axis=1)
    reach = np.where((reach > 0) & (part >= 0) & (part <= 1), reach, np.inf)
    wall = reach.argmin(axis=1)
    ranges = reach.min(axis=1) + BEND * (np.cos(ANGLES) - np.sin(2 * ANGLES))
    ranges = ranges + rng.normal(0.0, 0.001, len(ranges))
    normals = Pose2.from_array(pose).inverse().rotate(-outward[wall])
    points = ranges[:, None] * beams
    moved = _rotated(points, (share * motion)[:, 2]) + (share * motion)[:, :2]
    return StopScan(
        index=index,
        points=points,
        normals=normals,
        scans=30,
        directions=beams,
        origin=np.zeros(2),
        bearings=ANGLES,
        ranges=ranges,
        noise=0.001,
        sweep=None if turn is None else moved - points,
    )


def _rotated(vectors: Floats, yaws: Floats) -> Floats:
    """Turn each of (n, 2) vectors by its own angle (n,)."""
    c, s = np.cos(yaws), np.sin(yaws)
    return np.stack(
        [c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]], axis=1
    )


def _spread(poses: Floats, truth: Floats) -> float:
    """Return by how much the ring of stops is too wide, metres."""
    ring, true = poses[:, :2] - poses[:, :2].mean(axis=0), truth[:, :2] - truth[:, :2].mean(axis=0)
    return float((np.linalg.norm(ring, axis=1) - np.linalg.norm(true, axis=1)).mean())


def _polished(ranges: RangePrior) -> tuple[Floats, Floats, Floats]:
    """Return the poses, their covariance and the factors of the errors of the ranges."""
    rng = np.random.default_rng(5)
    found = _polish([_stop(i, pose, rng) for i, pose in enumerate(_ring())], ranges, rng)
    return found.poses, found.covariance, found.range_errors


def _polish(stops: list[StopScan], ranges: RangePrior, rng: np.random.Generator) -> Polished:
    return polish(
        stops,
        _ring() + rng.normal(0.0, 0.002, (STOPS, 3)),
        ALL_PAIRS,
        [],
        gates=(0.2, 0.1, 0.05),
        kernel=0.01,
        correlation=8.0,
        ranges=ranges,
    )


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


@pytest.mark.parametrize("took", [0.0, 0.5, 0.9])
def test_scans_of_a_moving_base_show_how_long_they_took(took: float) -> None:
    """A robot circles the middle, now quicker, now slower: the share of a turn comes out."""
    rng = np.random.default_rng(7)
    stops = []
    for index, pose in enumerate(_ring()):
        quick = 0.5 + 0.5 * (index % 3)
        turn = np.array([0.0, -0.06, 0.05]) * quick
        stops.append(_stop(index, pose, rng, turn=turn, took=took))
    found = _polish(stops, RangePrior(0.01, 0.002), rng)
    assert found.sweep is not None
    share, sigma = found.sweep
    assert share == pytest.approx(took, abs=0.1)
    assert 0.0 < sigma < 0.1


def test_scans_that_say_their_times_have_nothing_to_show() -> None:
    """Nor do those of a base that stands."""
    rng = np.random.default_rng(5)
    stops = [_stop(i, pose, rng) for i, pose in enumerate(_ring())]
    assert _polish(stops, RangePrior(0.01, 0.002), rng).sweep is None
