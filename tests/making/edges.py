"""Edge points as views of a known table give them, with errors drawn from what is declared."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import shapely

from tablemap.config import SensorsConfig
from tablemap.geometry import Floats, Pose2
from tablemap.stages.odometry import Trajectory
from tablemap.stages.outline import EdgeKind, Outline, ViewEdges
from tablemap.stages.registration import Registration


@dataclass(frozen=True)
class Bench:
    """How the views are taken. Lengths metres, angles radians.

    ``hidden`` are map directions from the table's centre (from, to) in radians that no view sees;
    ``occluded`` is the share of each view's contour behind clutter.
    """

    views: int = 8
    place_sigma: float = 0.002
    yaw_sigma: float = np.radians(0.05)
    scale_sigma: float = 0.001
    point_sigma: float = 0.0025
    correlation: float = 0.8
    outliers: float = 0.05
    occluded: float = 0.15
    hidden: tuple[tuple[float, float], ...] = ()
    points: int = 350
    bias_sigma: float = 0.15
    far_bias: float = 0.0
    free: bool = True


@dataclass(frozen=True, eq=False)
class Table:
    """A true top: its kind, true dimensions by name, its outline in the map, its pose, its radius.

    ``corner_radius`` is None where the corners are sharp.
    """

    shape: str
    dimensions: dict[str, float]
    outline: Floats
    pose: Pose2 = field(default_factory=Pose2)
    corner_radius: float | None = None


def ellipse_table(major: float, minor: float, pose: Pose2) -> Table:
    """Make a circle where both axes are equal, else an ellipse."""
    turn = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    local = np.column_stack([major / 2 * np.cos(turn), minor / 2 * np.sin(turn)])
    if major == minor:
        return Table("circle", {"diameter": major}, pose.apply(local), pose)
    return Table("ellipse", {"major": major, "minor": minor}, pose.apply(local), pose)


def box_table(length: float, width: float, pose: Pose2, angle: float = np.pi / 2) -> Table:
    """Make a square, a rectangle or a parallelogram."""
    along = np.array([length, 0.0]) / 2
    across = width * np.array([np.cos(angle), np.sin(angle)]) / 2
    local = np.array([along - across, along + across, across - along, -along - across])
    local = local[[3, 0, 1, 2]]
    if angle != np.pi / 2:
        size = {"length": length, "width": width, "angle": angle}
        return Table("parallelogram", size, pose.apply(local), pose)
    if length == width:
        return Table("square", {"side": length}, pose.apply(local), pose)
    return Table("rectangle", {"length": length, "width": width}, pose.apply(local), pose)


def rounded(table: Table, radius: float) -> Table:
    """Round all corners of a table, those that point inward too."""
    soft = shapely.Polygon(table.outline)
    for inward in (-radius, radius):
        soft = soft.buffer(inward, join_style="mitre").buffer(-inward, quad_segs=24)
    ring = np.asarray(shapely.orient_polygons(soft).exterior.coords)[:-1]
    return replace(table, outline=ring, corner_radius=radius)


def cut_off(table: Table, size: float) -> Table:
    """Cut the corners that point outward off a table: ``size`` metres of both sides."""
    corners = []
    before, after = np.roll(table.outline, 1, axis=0), np.roll(table.outline, -1, axis=0)
    for here, last, following in zip(table.outline, before, after, strict=True):
        back, ahead = ((to - here) / np.linalg.norm(to - here) for to in (last, following))
        is_outward = back[1] * ahead[0] - back[0] * ahead[1] > 0
        corners += [here + size * back, here + size * ahead] if is_outward else [here]
    return Table("polygon", {}, np.array(corners), table.pose)


def stadium_table(length: float, width: float, pose: Pose2) -> Table:
    """Make a rectangle with half circles for its ends."""
    middle = shapely.LineString([((width - length) / 2, 0), ((length - width) / 2, 0)])
    ring = shapely.orient_polygons(middle.buffer(width / 2, quad_segs=90)).exterior.coords
    size = {"length": length, "width": width}
    return Table("stadium", size, pose.apply(np.asarray(ring)[:-1]), pose)


def polygon_table(corners: list[tuple[float, float]], pose: Pose2) -> Table:
    """Make a polygon of counter-clockwise corners."""
    return Table("polygon", {}, pose.apply(np.array(corners)), pose)


def school_table(pose: Pose2) -> Table:
    """Make a trapezoid."""
    return polygon_table([(-0.7, -0.35), (0.7, -0.35), (0.35, 0.35), (-0.35, 0.35)], pose)


def desk(pose: Pose2) -> Table:
    """Make a desk with a cut-out in its front."""
    return polygon_table(
        [(0, 0), (1.6, 0), (1.6, 0.8), (1.1, 0.8), (1.1, 0.5), (0.5, 0.5), (0.5, 0.8), (0, 0.8)],
        pose,
    )


def l_table(pose: Pose2) -> Table:
    """Make an L."""
    return polygon_table([(0, 0), (1.6, 0), (1.6, 0.7), (0.7, 0.7), (0.7, 1.4), (0, 1.4)], pose)


def observe(
    table: Table, bench: Bench, random: np.random.Generator
) -> tuple[Outline, Registration]:
    """Draw one recording's edges and registration."""
    centre = table.outline.mean(axis=0)
    polygon = shapely.Polygon(table.outline)
    radius = float(np.linalg.norm(table.outline - centre, axis=1).max()) + 0.7
    true_poses = []
    for k in range(bench.views):
        bearing = 2 * np.pi * k / bench.views + random.normal(0, 0.05)
        place = centre + radius * np.array([np.cos(bearing), np.sin(bearing)])
        true_poses.append(Pose2(place[0], place[1], bearing + np.pi + random.normal(0, 0.05)))
    count = bench.views
    # The relative covariance holds the mean pose.
    sigmas = np.tile([bench.place_sigma, bench.place_sigma, bench.yaw_sigma], count)
    hold = np.eye(3 * count) - np.kron(np.ones((count, count)) / count, np.eye(3))
    covariance = hold @ np.diag(sigmas**2) @ hold.T
    errors = (hold @ (sigmas * random.standard_normal(3 * count))).reshape(-1, 3)
    scale = random.normal(0, bench.scale_sigma)
    biases = random.normal([0.0, bench.far_bias], bench.bias_sigma) * bench.point_sigma
    views = tuple(
        _view(index, pose, polygon, table.outline, centre, scale, biases, bench, random)
        for index, pose in enumerate(true_poses)
    )
    poses = tuple(
        Pose2.from_array(pose.as_array() + error)
        for pose, error in zip(true_poses, errors, strict=True)
    )
    registration = Registration(
        map_from_base=poses,
        covariance=covariance,
        placement_covariance=np.zeros((3, 3)),
        graph_before=poses,
        used=(True,) * count,
        checks=(),
        pairs=(),
        stop_scans=(),
        trajectory=Trajectory(np.empty(0, dtype=np.int64), np.empty((0, 3))),
        source="laser",
        systematic=0.0,
        warnings=(),
    )
    outline = Outline(
        views=views,
        height=0.74,
        height_sigma=0.001,
        height_by_view={},
        thickness=None,
        thickness_sigma=None,
        warnings=(),
    )
    return outline, registration


def _view(
    index: int,
    map_from_base: Pose2,
    polygon: shapely.Polygon,
    ring: Floats,
    centre: Floats,
    scale: float,
    biases: Floats,
    bench: Bench,
    random: np.random.Generator,
) -> ViewEdges:
    closed = shapely.LinearRing(ring)
    at = (np.arange(bench.points) + random.random()) / bench.points * closed.length
    place = np.array([closed.interpolate(a).coords[0] for a in at])
    ahead = np.array([closed.interpolate((a + 1e-4) % closed.length).coords[0] for a in at])
    along = ahead - place
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normal = np.column_stack([along[:, 1], -along[:, 0]])
    bearing = np.arctan2(place[:, 1] - centre[1], place[:, 0] - centre[0])
    visible = np.ones(len(at), dtype=bool)
    for first, last in bench.hidden:
        visible &= ~(((bearing - first) % (2 * np.pi)) < ((last - first) % (2 * np.pi)))
    start = random.integers(0, len(at))
    visible[(start + np.arange(int(bench.occluded * len(at)))) % len(at)] = False
    noise = np.empty(len(at))
    noise[0] = random.standard_normal()
    fresh = random.standard_normal(len(at))
    for k in range(1, len(at)):
        noise[k] = bench.correlation * noise[k - 1] + np.sqrt(1 - bench.correlation**2) * fresh[k]
    camera = np.array([0.1, 0.0])
    camera_in_map = map_from_base.apply(camera)
    near = np.sum((camera_in_map - place) * normal, axis=1) > 0
    out = noise * bench.point_sigma + np.where(near, biases[0], biases[1])
    stray = random.random(len(at)) < bench.outliers
    out = np.where(stray, random.uniform(-0.05, 0.05, len(at)), out)
    observed = map_from_base.inverse().apply(place + out[:, None] * normal)
    # A camera that reads too far puts the point away from itself: the fit undoes it.
    observed = camera + (observed - camera) * (1 + scale)
    turn = random.normal(0, np.radians(8), len(at))
    normal_in_base = map_from_base.inverse().rotate(normal)
    c, s = np.cos(turn), np.sin(turn)
    normal_in_base = np.column_stack(
        [
            c * normal_in_base[:, 0] - s * normal_in_base[:, 1],
            s * normal_in_base[:, 0] + c * normal_in_base[:, 1],
        ]
    )
    kind = np.where(visible, EdgeKind.TABLE, EdgeKind.OCCLUDED).astype(np.uint8)
    low, high = ring.min(axis=0) - 0.3, ring.max(axis=0) + 0.3
    grid = np.stack(
        np.meshgrid(np.arange(low[0], high[0], 0.02), np.arange(low[1], high[1], 0.02)), axis=-1
    ).reshape(-1, 2)
    inside = shapely.contains_xy(polygon, grid)
    reach = shapely.distance(closed, shapely.points(grid))
    top = grid[inside & (reach > 0.01)]
    free = grid[~inside & (reach > 0.01)]
    if bench.hidden:
        for name, points in (("top", top), ("free", free)):
            turn = np.arctan2(points[:, 1] - centre[1], points[:, 0] - centre[0])
            far = np.linalg.norm(points - centre, axis=1) > 0.25
            kept = np.ones(len(points), dtype=bool)
            for first, last in bench.hidden:
                kept &= ~(far & (((turn - first) % (2 * np.pi)) < ((last - first) % (2 * np.pi))))
            if name == "top":
                top = points[kept]
            else:
                free = points[kept]
    if not bench.free:
        free = free[:0]
    base_from_map = map_from_base.inverse()
    return ViewEdges(
        index=index,
        points=observed,
        normals=normal_in_base,
        sigma=np.full(len(at), bench.point_sigma),
        kind=kind,
        is_near=near,
        widening=np.where(near, 0.0, bench.point_sigma / SensorsConfig().edge_sigma_px),
        hole=np.zeros(len(at)),
        metres_per_px=np.full(len(at), 0.003),
        pixels=np.column_stack([at / closed.length * bench.points * 4, np.zeros(len(at))]),
        camera_xy=camera,
        drop=0.4,
        axis=np.array([0.8, 0.0, -0.6]),
        top=base_from_map.apply(top),
        free=base_from_map.apply(free),
    )
