"""What registration returns and records."""

from __future__ import annotations

from dataclasses import dataclass

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats, Pose2
from tablemap.stages.odometry import Trajectory


@dataclass(frozen=True, eq=False)
class StopScan:
    """A stop's scans as one: ``points`` and ``normals`` (n, 2) in the base, normals to the laser.

    ``directions`` (n, 2) are the beams of the points. ``origin`` (2,) is the laser's place;
    ``bearings`` and ``ranges`` (m,) are all beams by ascending bearing in the base, NaN where
    nothing was measured: these know what is free, and keep the points without a normal. ``noise``
    is the points' RMS off the lines through their neighbours, in metres.
    """

    index: int
    points: Floats
    normals: Floats
    scans: int
    directions: Floats
    origin: Floats
    bearings: Floats
    ranges: Floats
    noise: float


@dataclass(frozen=True, eq=False)
class PairStarted:
    """Event: a pair's ICP begins, at ``target_from_source``.

    ``source_points`` and ``target_points`` (n, 3) are what it aligns, each in its stop's base.
    """

    source: int
    target: int
    target_from_source: Pose2
    source_points: Floats
    target_points: Floats


@dataclass(frozen=True, eq=False)
class PairIteration:
    """Event: one ICP iteration of the pair that was started last."""

    source: int
    target: int
    iteration: int
    target_from_source: Pose2
    fitness: float
    rmse: float
    inliers: int


@dataclass(frozen=True, eq=False)
class Pair:
    """A constraint between two snapshots (by index).

    ``kind`` is ``laser``, ``depth``, ``odometry`` or ``loop``; ``information`` (3, 3) in the
    target's base frame (x, y, yaw), degenerate directions near zero; ``reason`` says why it was
    dropped.
    """

    source: int
    target: int
    kind: str
    target_from_source: Pose2
    information: Floats
    fitness: float
    rmse: float
    inliers: int
    used: bool
    reason: str | None


@dataclass(frozen=True)
class StopCheck:
    """The combined check of one stop: statistics by name, and the reasons where it failed."""

    index: int
    passed: bool
    statistics: dict[str, float]
    reasons: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Registration:
    """Where every snapshot was.

    ``map_from_base[i]`` belongs to snapshot ``i``; ``covariance`` (3n, 3n), in their order (x, y,
    yaw in the map), is relative: with the mean pose held. ``placement_covariance`` (3, 3) says how
    well the whole is placed in the map. ``graph_before`` are the poses before the graph was solved.
    ``trajectory`` is the registered base in the map at the odometry's stamps. ``source`` is
    ``laser``, ``depth`` or ``localisation``. ``systematic`` (metres) is the standard deviation, per
    axis, of what residuals cannot see: it rests on what is assumed of the sensors, not on data.
    ``used[i]`` is False where the check failed. ``stretch_sigma`` is the share by which a laser's
    ranges may stretch all distances between the poses alike; it is not in the covariance.
    """

    map_from_base: tuple[Pose2, ...]
    covariance: Floats
    placement_covariance: Floats
    graph_before: tuple[Pose2, ...]
    used: tuple[bool, ...]
    checks: tuple[StopCheck, ...]
    pairs: tuple[Pair, ...]
    stop_scans: tuple[StopScan, ...]
    trajectory: Trajectory
    source: str
    systematic: float
    warnings: tuple[ProcessWarning, ...]
    stretch_sigma: float = 0.0
