"""What registration returns and records."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats, Pose2
from tablemap.stages.odometry import Trajectory

PoseSource = Literal["laser", "depth", "localisation"]
"""What registered poses rest on."""

PairKind = Literal["laser", "depth", "loop", "odometry"]
"""What ties two snapshots; a ``loop`` is a pair of depth views that do not follow each other."""


@dataclass(frozen=True, eq=False)
class StopScan:
    """A stop's scans as one, in the base.

    - ``points``, ``normals``: (n, 2) metres and unit vectors towards the laser
    - ``scans``: how many were combined
    - ``directions``: (n, 2) unit vectors, the beams of the points
    - ``origin``: (2,) metres, the laser's place
    - ``bearings``, ``ranges``: (m,) radians and metres of all beams by ascending bearing, NaN where
      nothing was measured: they know what is free, and keep the points without a normal
    - ``noise``: metres, the points' RMS off the lines through their neighbours
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
    """A constraint between two snapshots.

    - ``source``, ``target``: the snapshots' indices
    - ``information``: (3, 3) of x, y and yaw in the target's base, near zero in directions that the
      geometry leaves open
    - ``fitness``: share of the source's points that found a partner
    - ``rmse``, ``inliers``: metres between those that correspond, and their number
    - ``reason``: why it was dropped
    """

    source: int
    target: int
    kind: PairKind
    target_from_source: Pose2
    information: Floats
    fitness: float
    rmse: float
    inliers: int
    used: bool
    reason: str | None


@dataclass(frozen=True)
class LaserStatistics:
    """How a stop's scan fits those of the stops that it is paired with.

    Medians over the pairs, so that one person or moved chair does not decide.

    - ``rms``: metres, robust, between points that correspond
    - ``overlap``: share of its points that the other saw too
    - ``consistent``: share of those within 15 mm, or three times the noise
    - ``violation``: share of its points that lie in the other's free space
    - ``score``: its likelihood among the points of all others
    - ``noise``: metres, what the scans' own noise makes of ``rms`` at the right place
    """

    rms: float
    overlap: float
    consistent: float
    violation: float
    score: float
    noise: float


@dataclass(frozen=True)
class DepthPairStatistics:
    """What depth says of a stop without a scan: its pairs, and how many the graph kept."""

    depth_pairs: int
    depth_pairs_used: int


@dataclass(frozen=True)
class DepthStatistics:
    """How a view that is registered by its depth fits the others; None where nothing compares.

    The first four are medians over the other views.

    - ``edge_points``: how many points of the table's edge it shows
    - ``shared``: share of them near which the other saw a parallel edge
    - ``consistent``: share of those that lie on it, within 15 mm or three times the noise
    - ``violation``: how much of the top it saw where the other saw through, or the reverse, by more
      than 4 cm, as a share of its top
    - ``agreeing``: share of the other views that it agrees with
    - ``heading_tied``: whether its heading is tied to more than half of those that show the top
    - ``upright_points``: how many points of what stands upright it shares with others
    - ``upright_score``, ``upright_violation``: how these fit, as a `Sighting` has it
    - ``pairs``: how many pairs of views tie it
    - ``edge_rms``: metres, of all views' edges
    - ``moved``: metres that the edges moved it from where the pairs had it
    """

    edge_points: float | None = None
    shared: float | None = None
    consistent: float | None = None
    violation: float | None = None
    agreeing: float | None = None
    heading_tied: bool | None = None
    upright_points: int | None = None
    upright_score: float | None = None
    upright_violation: float | None = None
    pairs: int | None = None
    edge_rms: float | None = None
    moved: float | None = None


@dataclass(frozen=True)
class StopCheck:
    """Whether one stop is where it should be.

    - ``index``: the snapshot's
    - ``statistics``: what it was judged by; None where it could not be compared
    - ``reasons``: why it failed
    """

    index: int
    passed: bool
    statistics: LaserStatistics | DepthPairStatistics | DepthStatistics | None
    reasons: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Registration:
    """Where every snapshot was.

    - ``map_from_base``: one pose a snapshot, in their order
    - ``covariance``: (3n, 3n) of x, y and yaw in the map, in the same order; it is relative: with
      the mean pose held
    - ``placement_covariance``: (3, 3), how well the whole is placed in the map
    - ``graph_before``: the poses before the graph was solved
    - ``used``: one a snapshot, False where its check failed
    - ``trajectory``: the registered base in the map, at the odometry's stamps
    - ``source``: what the poses rest on
    - ``systematic``: metres, the standard deviation per axis of what residuals cannot see; it
      rests on what is assumed of the sensors, not on data
    - ``stretch_sigma``: the share by which a laser's ranges may stretch all distances between the
      poses alike; it is not in the covariance
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
    source: PoseSource
    systematic: float
    warnings: tuple[ProcessWarning, ...]
    stretch_sigma: float = 0.0
