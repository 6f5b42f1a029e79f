"""The bachelor report's method, as the baseline: depth clouds, 6-DoF ICP, a hull, two primitives.

The steps of the report (TU Eindhoven):

1. Each snapshot gives a cloud in the map, at its localised pose. Points lower than 0.1 m are
   dropped. The nearest Euclidean cluster is kept.
2. RANSAC (3 cm) finds a horizontal plane in the cluster. The planes' heights are averaged over the
   snapshots. Points more than 1 cm below this height are dropped.
3. Point-to-point ICP adds one cloud after the other to the growing cloud. Points that lie more than
   1 m apart do not correspond.
4. The cloud is projected to the floor. RANSAC (3 cm) searches its concave hull for a circle through
   three points, and twice for two parallel lines through three points.
5. A shape's score is its share of inliers among the hull points. The higher score wins.

Where the report tried more than one way, `tablemap.config.ReportConfig` chooses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tablemap import imports
from tablemap import model as m
from tablemap.baseline.shapes import Found, find_circle, find_parallelogram, hull_points
from tablemap.config import Config, ReportConfig, Tables
from tablemap.errors import EstimationError
from tablemap.events import Record, ignore
from tablemap.geometry import Floats, transform
from tablemap.pipeline import Processed, stages
from tablemap.recording import Recording
from tablemap.stages.odometry import Trajectory
from tablemap.stages.snapshots import Snapshot, take_snapshots

if TYPE_CHECKING:
    import open3d

# The values of the report, in metres.
FLOOR = 0.1  # lower points are dropped first
PLANE_THRESHOLD = 0.03  # RANSAC of the top's plane
CUT_MARGIN = 0.01  # points so far below the plane are kept
THRESHOLD = 0.03  # RANSAC of circle and lines

# The report does not state these.
VOXEL = 0.01  # metres: cell of every cloud
CLUSTER_TOLERANCE = 0.03  # metres: gap between clusters
CLUSTER_MINIMUM = 300  # cells of the smallest cluster
ALPHA = 0.1  # metres: radius of the concave hull
LEAST_SCORE = 0.5  # of a circle or parallelogram; below it the hull is the result
PLANE_ITERATIONS = 500
HORIZONTAL = 0.95  # least cosine between the normal of a plane and the vertical
ICP_ITERATIONS = 50


@dataclass(frozen=True, eq=False)
class ViewCloud:
    """The table in one snapshot.

    - ``index``: of the snapshot
    - ``points``: (n, 3), metres, in the map, at the localised pose
    - ``height``: metres, of the plane in the cloud
    """

    index: int
    points: Floats
    height: float


def process(
    recording: Recording, *, config: Config, tables: Tables | None = None, record: Record = ignore
) -> Processed:
    """Model the table by the method of the report.

    Raises `EstimationError` if no snapshot shows a horizontal plane in its nearest cluster, or if
    ``tables`` is not ``best``: the method finds no other table.
    """
    if (config.tables if tables is None else tables) != "best":
        raise EstimationError(
            "the report's method models the nearest table alone; leave out --near and --all."
        )
    settings, stage = config.report, stages(record)
    with stage("snapshots"):
        taken = take_snapshots(recording, config=config.snapshots, sensors=config.sensors)
        record(taken)
    reasons: dict[int, str] = {}
    views = []
    with stage("segmentation"):
        for snapshot in taken.snapshots:
            found = table_cloud(snapshot, seed=config.seed)
            if isinstance(found, str):
                reasons[snapshot.index] = found
            else:
                views.append(found)
        if not views:
            raise EstimationError(
                "no snapshot shows a horizontal plane in its nearest cluster; look at the depth "
                "images in run.rrd."
            )
        height = float(np.mean([view.height for view in views]))
    with stage("registration"):
        cloud, corrections = join(views, height, settings)
    with stage("surface"):
        hull = hull_points(cloud[:, :2], ALPHA)
        surface = _surface(hull, height, seed=config.seed)
    poses = [
        _corrected(snapshot, corrections.get(snapshot.index, np.eye(4)))
        for snapshot in taken.snapshots
    ]
    made = m.TableModel(
        frame=recording.names.fixed,
        floor_z=0.0,
        surface=surface,
        legs=(),
        snapshots=tuple(
            m.SnapshotPose(
                stamp_ns=snapshot.stamp_ns,
                map_from_base=m.PlanarPose(x=pose[0], y=pose[1], yaw=pose[2]),
                sigma=None,
                used=snapshot.index not in reasons,
                reason=reasons.get(snapshot.index),
            )
            for snapshot, pose in zip(taken.snapshots, poses, strict=True)
        ),
        verdict=m.Verdict(level="good", reasons=()),
        warnings=tuple(
            m.WarningEntry(code=w.code, stage=w.stage, message=w.message, stamp_ns=w.stamp_ns)
            for w in recording.warnings
        ),
    )
    model = made.as_written()
    record(model)
    stamps = np.array([snapshot.stamp_ns for snapshot in taken.snapshots], dtype=np.int64)
    return Processed(model, (), Trajectory(stamps, np.array(poses)))


def table_cloud(snapshot: Snapshot, *, seed: int) -> ViewCloud | str:
    """Return the nearest cluster of a snapshot and the height of its plane, or why it has none."""
    o3d = imports.open3d()
    in_map = transform(snapshot.map_from_base.lifted(), snapshot.points_in_base()).reshape(-1, 3)
    in_map = in_map[np.isfinite(in_map[:, 2]) & (in_map[:, 2] >= FLOOR)]
    cloud = _cloud(in_map).voxel_down_sample(VOXEL)
    points = np.asarray(cloud.points)
    if len(points) < CLUSTER_MINIMUM:
        return "it shows nothing above the floor"
    labels = np.asarray(cloud.cluster_dbscan(CLUSTER_TOLERANCE, min_points=1))
    sizes = np.bincount(labels)
    large = np.flatnonzero(sizes >= CLUSTER_MINIMUM)
    if not len(large):
        return "it shows no large cluster"
    robot = snapshot.map_from_base.translation
    distances = np.hypot(*(points[:, :2] - robot).T)
    nearest = min(large.tolist(), key=lambda label: float(distances[labels == label].min()))
    cluster = points[labels == nearest]
    rest = cluster
    while len(rest) >= CLUSTER_MINIMUM:
        o3d.utility.random.seed(seed)
        plane, inliers = _cloud(rest).segment_plane(PLANE_THRESHOLD, 3, PLANE_ITERATIONS)
        if abs(plane[2]) >= HORIZONTAL:
            return ViewCloud(snapshot.index, cluster, float(rest[inliers, 2].mean()))
        rest = np.delete(rest, inliers, axis=0)
    return "its nearest cluster has no horizontal plane"


def join(
    views: list[ViewCloud], height: float, config: ReportConfig
) -> tuple[Floats, dict[int, Floats]]:
    """Add one cloud after the other to the growing one; return it and the motion of each view."""
    o3d = imports.open3d()
    whole = _cut(views[0].points, height, config)
    corrections = {views[0].index: np.eye(4)}
    for view in views[1:]:
        points = _cut(view.points, height, config)
        motion = np.eye(4)
        if config.icp_distance > 0 and len(points) >= 3:
            motion = o3d.pipelines.registration.registration_icp(
                _cloud(points),
                _cloud(whole),
                config.icp_distance,
                np.eye(4),
                o3d.pipelines.registration.TransformationEstimationPointToPoint(),
                o3d.pipelines.registration.ICPConvergenceCriteria(max_iteration=ICP_ITERATIONS),
            ).transformation
        corrections[view.index] = np.array(motion)
        whole = np.vstack([whole, transform(corrections[view.index], points)])
        whole = np.asarray(_cloud(whole).voxel_down_sample(VOXEL).points)
    return whole, corrections


def _cut(points: Floats, height: float, config: ReportConfig) -> Floats:
    if config.cut == "nothing":
        return points
    kept = points[:, 2] >= height - CUT_MARGIN
    if config.cut == "above_and_below":
        kept &= points[:, 2] <= height + PLANE_THRESHOLD
    return points[kept]


def _cloud(points: Floats) -> open3d.geometry.PointCloud:
    o3d = imports.open3d()
    vectors = o3d.utility.Vector3dVector(np.ascontiguousarray(points))
    cloud: open3d.geometry.PointCloud = o3d.geometry.PointCloud(vectors)
    return cloud


def _corrected(snapshot: Snapshot, motion: Floats) -> tuple[float, float, float]:
    """Return x, y, yaw of the base after the 6-DoF motion of the snapshot's cloud."""
    pose = motion @ snapshot.map_from_base.lifted()
    return float(pose[0, 3]), float(pose[1, 3]), float(np.arctan2(pose[1, 0], pose[0, 0]))


def _surface(hull: Floats, height: float, *, seed: int) -> m.TableSurface:
    """Return the shape with the higher score; the hull, if both scores are low."""
    rng = np.random.default_rng(seed)
    tried = [
        find_circle(hull, THRESHOLD, rng),
        find_parallelogram(hull, THRESHOLD, rng),
    ]
    found = sorted((t for t in tried if t is not None), key=lambda t: -t.score)
    is_good = found and found[0].score >= LEAST_SCORE
    best = found[0] if is_good else Found.of_hull(hull)
    outline = tuple((float(x), float(y)) for x, y in best.outline)
    zero = (0.0, 0.0, 0.0)
    return m.TableSurface(
        shape=best.shape,
        pose=m.SurfacePose(x=best.x, y=best.y, yaw=best.yaw, covariance=(zero, zero, zero)),
        height=m.Figure(value=height, sigma=None),
        thickness=None,
        dimensions={
            name: m.Dimension(value=value, sigma=None, status="measured")
            for name, value in best.dimensions.items()
        },
        corner_radius=None,
        outline=outline,
        edges=(m.Edge(points=outline, status="measured", sigma=None, seen_fraction=1.0),),
        score=best.score,
        alternatives=tuple(
            m.Alternative(shape=other.shape, score=other.score)
            for other in found
            if other is not best
        ),
    )
