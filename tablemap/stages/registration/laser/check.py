"""Whether a registration is right: residuals, overlap, score and free space, taken together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from tablemap.geometry import Floats, Pose2
from tablemap.robust import mad_sigma
from tablemap.stages.registration.correlative import likelihood
from tablemap.stages.registration.laser.normals import LEAST_COSINE
from tablemap.stages.registration.result import LaserStatistics, StopCheck, StopScan
from tablemap.stages.snapshots import is_same_place

# The limits lie between right registrations of simulated rooms and ones that were made wrong on
# purpose. Both include people and moved furniture.
_NEAR = 0.10
_CONSISTENT = 0.015
_LEAST_OVERLAP = 0.25
_LEAST_SCORE = 0.5
_LEAST_CONSISTENT = 0.6
_LARGEST_RMS = 0.008
_NOISE_FACTOR = 1.8  # times the scans' own noise (a stop with one scan is as noisy as the laser)
_COMMON_FACTOR = 1.5  # times the misfit of all stops: a laser's error that bends is common to all
_LARGEST_VIOLATION = 0.5
_DOUBTFUL_VIOLATION = 0.25
_DOUBTFUL_SCORE = 0.75
_THROUGH = 0.2  # metres: a point so much nearer than the beam's range is in free space
_NORMAL_COSINE = 0.9


def check_stops(
    stops: Sequence[StopScan | None], poses: Floats, pairs: Sequence[tuple[int, int]]
) -> tuple[StopCheck, ...]:
    """Compare each stop with the stops that it is paired with, all at ``poses`` (n, 3)."""
    scans = {i: stop for i, stop in enumerate(stops) if stop is not None and len(stop.points)}
    trees = {i: cKDTree(stop.points) for i, stop in scans.items()}
    located = [Pose2.from_array(pose) for pose in poses]
    in_map = {i: located[i].apply(stop.points) for i, stop in scans.items()}
    seen: dict[int, LaserStatistics] = {}
    for i in scans:
        partners = sorted({a if b == i else b for a, b in pairs if i in (a, b)} & set(scans))
        # Views that a turning head took from one place would agree even if the place were wrong.
        apart = [j for j in partners if not is_same_place(located[i], located[j])]
        partners = apart or partners
        if not partners:
            continue
        compared = np.array(
            [
                _compare(scans[i], scans[j], trees[j], located[j].inverse() @ located[i])
                for j in partners
            ]
        )
        # Pairs that hardly overlap say little about residuals.
        shared = compared[:, 1] >= 0.5 * compared[:, 1].max()
        others = cKDTree(np.concatenate([in_map[j] for j in partners]))
        seen[i] = LaserStatistics(
            rms=float(np.median(compared[shared, 0])),
            overlap=float(np.max(compared[:, 1])),
            consistent=float(np.median(compared[shared, 2])),
            violation=float(np.median(compared[:, 3])),
            score=likelihood(scans[i].points, others, located[i]),
            noise=float(np.median([np.hypot(scans[i].noise, scans[j].noise) for j in partners])),
            points=int(np.median(compared[shared, 4])),
        )
    common = float(np.median([one.rms for one in seen.values()])) if seen else 0.0
    return tuple(_checked(i, i in scans, seen.get(i), common) for i in range(len(stops)))


def _checked(index: int, scanned: bool, seen: LaserStatistics | None, common: float) -> StopCheck:
    if seen is None:
        reason = (
            "no other stop saw the same surroundings" if scanned else "it has no usable laser scan"
        )
        return StopCheck(index, False, None, (reason,))
    reasons = judge(seen, common)
    return StopCheck(index, not reasons, seen, reasons)


def suspicious(checks: Sequence[StopCheck]) -> dict[int, float]:
    """Return the stops, with their scores, that need a search; some of them passed the check."""
    return {
        check.index: seen.score
        for check in checks
        if isinstance(seen := check.statistics, LaserStatistics)
        and (
            not check.passed or seen.score < _DOUBTFUL_SCORE or seen.violation > _DOUBTFUL_VIOLATION
        )
    }


def judge(seen: LaserStatistics, common: float) -> tuple[str, ...]:
    """Return what speaks against a stop's registration; nothing if it is right.

    ``common`` (metres) is the median RMS of all stops. A laser whose error bends with the range
    misfits them all alike, and a wrong place stands out against it.
    """
    reasons = []
    if seen.overlap < _LEAST_OVERLAP:
        reasons.append(f"only {100 * seen.overlap:.0f} % of its scan fits any other stop's")
    if seen.score < _LEAST_SCORE:
        reasons.append(f"its scan has a score of only {seen.score:.2f} against the others")
    if seen.consistent < _LEAST_CONSISTENT:
        reasons.append(f"only {100 * seen.consistent:.0f} % of what other stops saw too agrees")
    # Of a dozen points the scatter itself is uncertain.
    uncertain = 1.0 + 1.0 / np.sqrt(seen.points) if seen.points else 1.0
    allowed = max(_LARGEST_RMS, min(_COMMON_FACTOR * common, _CONSISTENT))
    if seen.rms > uncertain * max(allowed, _NOISE_FACTOR * seen.noise):
        reasons.append(f"what other stops saw too is off by {1e3 * seen.rms:.1f} mm RMS")
    if seen.violation > _LARGEST_VIOLATION or (
        seen.violation > _DOUBTFUL_VIOLATION and seen.score < _DOUBTFUL_SCORE
    ):
        reasons.append(
            f"{100 * seen.violation:.0f} % of its scan lies where other stops saw free space"
        )
    return tuple(reasons)


def _compare(
    source: StopScan, target: StopScan, tree: cKDTree, target_from_source: Pose2
) -> tuple[float, float, float, float, int]:
    """Compare two stops' points.

    Returns their robust RMS in metres, overlap, consistent share, free-space violation and number.
    """
    points = target_from_source.apply(source.points)
    normals = target_from_source.rotate(source.normals)
    distance, index = tree.query(points, distance_upper_bound=_NEAR)
    found = np.isfinite(distance)
    index = np.where(found, index, 0)
    agree = np.einsum("ij,ij->i", normals, target.normals[index]) > _NORMAL_COSINE
    matched = found & agree
    # The other stop cannot see a face that is turned away from it, as of a leg between the two.
    to_target = target.origin - points
    cosine = np.einsum("ij,ij->i", normals, to_target) / np.linalg.norm(to_target, axis=1)
    comparable = found & (matched | (cosine > LEAST_COSINE))
    apart = np.einsum(
        "ij,ij->i", target.normals[index[matched]], points[matched] - target.points[index[matched]]
    )
    overlap = float(matched.mean())
    if matched.any():
        rms = mad_sigma(apart)
        # At a wrong place points have neighbours too, but these are neither close nor parallel.
        limit = max(_CONSISTENT, 3 * float(np.hypot(source.noise, target.noise)))
        consistent = float((np.abs(apart) < limit).sum() / max(comparable.sum(), 1))
    else:
        rms, consistent = float(_NEAR), 0.0
    return rms, overlap, consistent, _violation(points, target), int(matched.sum())


def _violation(points: Floats, target: StopScan) -> float:
    measured = np.isfinite(target.ranges)
    if measured.sum() < 2:
        return 0.0
    offset = points - target.origin
    bearing, reach = np.arctan2(offset[:, 1], offset[:, 0]), np.linalg.norm(offset, axis=1)
    index = np.clip(np.searchsorted(target.bearings, bearing), 1, len(target.bearings) - 1)
    inside = (bearing >= target.bearings[0]) & (bearing <= target.bearings[-1])
    around = np.stack(
        [target.ranges[np.clip(index + k, 0, len(target.ranges) - 1)] for k in (-2, -1, 0, 1)]
    )
    seen = inside & np.isfinite(around).all(axis=0)
    if not seen.any():
        return 0.0
    through = reach[seen] < around[:, seen].min(axis=0) - _THROUGH
    return float(through.mean())
