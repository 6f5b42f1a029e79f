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
"""Kinds of constraints. A ``loop`` is a pair of depth views that do not follow each other."""


@dataclass(frozen=True, eq=False)
class StopScan:
    """A stop's scans as one, in the base.

    - ``points``, ``normals``: (n, 2) metres and unit vectors towards the laser
    - ``scans``: how many were combined
    - ``directions``: (n, 2) unit vectors, the beams of the points
    - ``origin``: (2,) metres, the laser's place
    - ``bearings``, ``ranges``: (m,) radians and metres of all beams by ascending bearing, NaN where
      nothing was measured; they tell which space is free, and include points without a normal
    - ``noise``: metres, the points' RMS off the lines through their neighbours
    - ``sweep``: (n, 2) metres by which the points move if the laser took a full turn for them one
      after the other; None where the base stood, or where the scan itself says how long it took
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
    sweep: Floats | None = None


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
    - ``rmse``, ``inliers``: metres RMS between corresponding points, and their number
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
    """How a stop's scan fits the scans of the stops that it is paired with.

    Most are medians over the pairs, so that one person or moved chair does not decide.

    - ``rms``: metres, robust, between corresponding points
    - ``overlap``: share of its points that the other stop saw too, of the best pair
    - ``consistent``: share of its points near the other's, on faces that the other stop could see,
      within 15 mm of them, or three times the noise
    - ``violation``: share of its points that lie in the other stop's free space
    - ``score``: its mean likelihood among the points of all others
    - ``noise``: metres, the ``rms`` that the scans' own noise gives at the right place
    - ``points``: how many points of a pair correspond; 0 if that was not counted
    """

    rms: float
    overlap: float
    consistent: float
    violation: float
    score: float
    noise: float
    points: int = 0


@dataclass(frozen=True)
class DepthPairStatistics:
    """The depth pairs of a stop without a scan, and how many of them the graph kept."""

    depth_pairs: int
    depth_pairs_used: int


@dataclass(frozen=True)
class DepthStatistics:
    """How a view that is registered by its depth fits the others; None if it cannot be compared.

    The first four are medians over the other views.

    - ``edge_points``: how many points of the table's edge it shows
    - ``shared``: share of these points with a parallel edge of the other view nearby
    - ``consistent``: share of the shared points on that edge, within 15 mm or three times the noise
    - ``violation``: share of its top that lies more than 4 cm inside the free space of the other
      view, or the reverse
    - ``agreeing``: share of the other views that it agrees with
    - ``heading_tied``: whether its heading is tied to more than half of those that show the top
    - ``upright_points``: how many points on upright surfaces it shares with others
    - ``upright_score``, ``upright_violation``: how well these fit, as defined in `Sighting`
    - ``pairs``: how many pairs of views tie it
    - ``edge_rms``: metres, of the edges of all views
    - ``moved``: metres between its pose by the pairs and its pose by the edges
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
    - ``statistics``: the figures that it was judged by; None if it could not be compared
    - ``reasons``: why it failed
    """

    index: int
    passed: bool
    statistics: LaserStatistics | DepthPairStatistics | DepthStatistics | None
    reasons: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Registration:
    """The registered pose of every snapshot.

    - ``map_from_base``: one pose a snapshot, in the snapshots' order
    - ``covariance``: (3n, 3n) of x, y and yaw in the map, in the same order; it is relative: the
      mean pose is fixed
    - ``placement_covariance``: (3, 3) of x, y and yaw, for a common motion of all poses in the map
    - ``graph_before``: the poses before the graph was solved
    - ``used``: one a snapshot, False where its check failed
    - ``trajectory``: the registered base in the map, at the odometry's stamps
    - ``source``: what the poses rest on
    - ``systematic``: metres, the standard deviation per axis of errors that residuals cannot show;
      it comes from the assumed errors of the sensors, not from data
    - ``stretch_sigma``: standard deviation, a share, of a common stretch of all distances between
      the poses, as a laser's ranges cause it; it is not in the covariance
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

    @property
    def used_poses(self) -> dict[int, Pose2]:
        """The poses whose check passed, by snapshot index; all poses if none passed."""
        every = enumerate(self.map_from_base)
        return {index: pose for index, pose in every if self.used[index] or not any(self.used)}
