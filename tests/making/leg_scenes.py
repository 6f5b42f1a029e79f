"""A room in the plane, cut by a laser with a finite beam, and boxes seen by a depth camera."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from tablemap.config import LegsConfig, SensorsConfig
from tablemap.geometry import Floats, Ints, Pose2
from tablemap.inputs import Input
from tablemap.recording import FrameNames, Recording
from tablemap.recording.messages import Image, LaserScan
from tablemap.stages.legs import Legs, find_legs
from tablemap.stages.odometry import Trajectory
from tablemap.stages.registration import Registration
from tablemap.stages.snapshots import Camera, Snapshot
from tablemap.stages.surface import FittedFigure, Surface
from tests.making.casting import Box, Drum, World, looking

BASE_FROM_LASER = np.eye(4)
BASE_FROM_LASER[:3, 3] = (0.1675, 0.0, 0.1844)
SECOND = 1_000_000_000
SENSORS = SensorsConfig()
TABLE = Pose2(0.4, -0.3, 0.6)
ROOM = [(-3, -3, 3, -3), (3, -3, 3, 3), (3, 3, -3, 3), (-3, 3, -3, -3)]
BEAMS, FIELD = 721, 2.1


@dataclass
class Scene:
    """Circles (x, y, radius) and boxes (x, y, length, width, yaw[, low, high]) in the map."""

    circles: list[tuple[float, float, float]] = field(default_factory=list)
    boxes: list[tuple[float, ...]] = field(default_factory=list)
    walls: list[tuple[float, float, float, float]] = field(default_factory=list)
    table: Pose2 = field(default_factory=Pose2)
    length: float = 1.2
    width: float = 0.8
    height: float = 0.75
    shape: str = "rectangle"

    def world(self) -> World:
        """Return all that stands there, and the top."""
        boxes = [
            Box(x, y, length, width, *(span or (0.0, self.height)), yaw)
            for x, y, length, width, yaw, *span in self.boxes
        ]
        posts = [Drum(x, y, 2 * radius, 0.0, self.height) for x, y, radius in self.circles]
        return World([self.top(), *boxes, *posts], np.array(self.walls).reshape(-1, 4))

    def top(self) -> Box | Drum:
        """Return the board of the top, 2 cm thick."""
        low, high = self.height - 0.02, self.height
        if self.shape == "circle":
            return Drum(self.table.x, self.table.y, self.length, low, high)
        return Box(self.table.x, self.table.y, self.length, self.width, low, high, self.table.yaw)

    def outline(self) -> Floats:
        """Return the top's outline (n, 2) in the map."""
        top = self.top()
        if isinstance(top, Box):
            return top.sides()[:, :2]
        angles = np.linspace(0, 2 * np.pi, 72, endpoint=False)
        local = 0.5 * self.length * np.column_stack([np.cos(angles), np.sin(angles)])
        return self.table.apply(local)


def scanned(
    world: World,
    map_from_base: Pose2,
    stamp_ns: int,
    rng: np.random.Generator,
    *,
    half_width: float = 0.001,
    bias: float = 0.0,
    noise: float = 0.01,
) -> LaserScan:
    """Return a scan whose spot reports the nearest thing that it touches."""
    origin = map_from_base.apply(BASE_FROM_LASER[:2, 3])
    across = half_width * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
    angles = np.linspace(-FIELD, FIELD, BEAMS) + map_from_base.yaw + across[:, None]
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=-1).reshape(-1, 2)
    met = world.cast_at(BASE_FROM_LASER[2, 3], origin, rays).reshape(len(across), BEAMS)
    ranges = met.min(axis=0) + bias + rng.normal(0.0, noise, BEAMS)
    ranges[~np.isfinite(ranges) | (ranges > 60)] = np.inf
    return LaserScan(
        stamp_ns,
        "laser",
        -FIELD,
        FIELD,
        2 * FIELD / (BEAMS - 1),
        0.0,
        1 / 30,
        0.05,
        60.0,
        ranges.astype(np.float32),
    )


def photographed(world: World, map_from_camera: Floats, camera: Camera) -> Floats:
    """Return the (height, width) depth of floor, top and what stands there, NaN beyond 5 m."""
    rays = camera.rays.astype(np.float64)
    depth = World(world.solids).depth(map_from_camera, rays)  # walls are farther off
    return np.where(depth < 5.0, depth, np.nan)


class FakeRecording(Recording):
    """A recording that holds its scans in memory."""

    def __init__(self, scans: list[LaserScan], *, laser: bool = True) -> None:
        self.input = Input.of("fake.mcap")
        self.names = FrameNames("map", "odom", "base", "camera", "laser" if laser else None)
        self.warnings = []
        self.all = scans
        self.start_ns, self.end_ns = 0, 0

    def scan_stamps(self) -> Ints:
        """Return the stamps of what was given."""
        return np.array([scan.stamp_ns for scan in self.all], dtype=np.int64)

    def scans(self, *, stamps_ns: Ints) -> Iterator[LaserScan]:
        """Yield what was given, at these stamps."""
        yield from (scan for scan in self.all if scan.stamp_ns in stamps_ns)

    def base_from_laser(self, stamp_ns: int) -> Floats:
        """Return the HSR's mount."""
        return BASE_FROM_LASER


def four(scene: Scene, inset: float = 0.06) -> Floats:
    """Return (4, 2) places in the map, inset from the corners of the top."""
    u, v = 0.5 * scene.length - inset, 0.5 * scene.width - inset
    return scene.table.apply(np.array([[u, v], [-u, v], [-u, -v], [u, -v]]))


def surface_of(scene: Scene, map_from_base: dict[int, Pose2]) -> Surface:
    """Return the top as a fit of it would be handed on."""
    outline = scene.outline()
    return Surface(
        shape=scene.shape,
        pose=scene.table,
        covariance=np.eye(3) * 1e-6,
        relative_covariance=np.eye(3) * 1e-6,
        height=FittedFigure(scene.height, 0.001),
        thickness=None,
        dimensions={},
        corner_radius=None,
        outline=outline,
        edges=(),
        score=1.0,
        candidates=(),
        map_from_base=map_from_base,
        points=outline,
        residuals=np.zeros(len(outline)),
        hull=outline,
        warnings=(),
    )


def drive(
    scene: Scene,
    rng: np.random.Generator,
    *,
    stops: int = 8,
    distance: float = 1.3,
    pose_sigma: float = 0.002,
    drive_sigma: float = 0.004,
    scans_per_stop: int = 20,
    scans_between: int = 40,
    half_width: float = 0.001,
    bias: float = 0.004,
    arc: float = 2 * np.pi,
    with_depth: bool = False,
    laser: bool = True,
) -> tuple[FakeRecording, tuple[Snapshot, ...], Registration, Surface]:
    """Drive round the table and stop, with poses that are off by ``pose_sigma``."""
    camera = Camera(320, 240, 270.0, 270.0, 159.5, 119.5)
    mount, world = looking(1.1, 0.5, ahead=0.1), scene.world()
    scans: list[LaserScan] = []
    truth: list[Pose2] = []
    believed: list[Pose2] = []
    snapshots: list[Snapshot] = []
    stamps: list[int] = []
    trajectory: list[Floats] = []
    image = Image(0, "camera", 1, 1, "16UC1", False, 2, b"\0\0")

    def at(turn: float) -> Pose2:
        place = scene.table.apply(
            np.array(
                [
                    (distance + 0.5 * (scene.length - 0.6)) * np.cos(turn),
                    (distance + 0.5 * (scene.width - 0.6)) * np.sin(turn),
                ]
            )
        )
        to = np.array([scene.table.x, scene.table.y]) - place
        # A robot never heads so exactly that all views cut a leg between the same two beams.
        heading = float(np.arctan2(to[1], to[0])) + rng.normal(0.0, 0.05)
        return Pose2(float(place[0]), float(place[1]), heading)

    def off(pose: Pose2, sigma: float) -> Pose2:
        error = rng.normal(0.0, sigma, 2)
        return Pose2(pose.x + error[0], pose.y + error[1], pose.yaw + rng.normal(0, 0.25 * sigma))

    stamp = SECOND
    for k in range(stops):
        turn = 0.3 + arc * k / stops
        pose = at(turn)
        seen = off(pose, pose_sigma)
        start = stamp
        for _ in range(scans_per_stop):
            scans.append(scanned(world, pose, stamp, rng, half_width=half_width, bias=bias))
            stamp += SECOND // 30
        end = stamp - SECOND // 30
        stamps += [start, end]
        trajectory += [seen.as_array(), seen.as_array()]
        truth.append(pose)
        believed.append(seen)
        depth = np.full((camera.height, camera.width), np.nan, dtype=np.float32)
        if with_depth:
            depth = photographed(world, pose.lifted() @ mount, camera).astype(np.float32)
            depth += rng.normal(0, 0.002, depth.shape).astype(np.float32)
        snapshots.append(
            Snapshot(
                k, (start + end) // 2, start, end, 1, depth, camera, mount, seen, None, image, None
            )
        )
        if k == stops - 1:
            break
        common = rng.normal(0.0, drive_sigma, 2)
        for i in range(1, scans_between + 1):
            stamp += SECOND // 10
            pose = at(turn + arc / stops * i / (scans_between + 1))
            scans.append(scanned(world, pose, stamp, rng, half_width=half_width, bias=bias))
            guess = off(Pose2(pose.x + common[0], pose.y + common[1], pose.yaw), 0.5 * drive_sigma)
            stamps.append(stamp)
            trajectory.append(guess.as_array())
        stamp += SECOND // 10
    covariance = np.diag(np.tile(np.square([pose_sigma, pose_sigma, 0.25 * pose_sigma]), stops))
    poses = tuple(believed)
    registration = Registration(
        map_from_base=poses,
        covariance=covariance,
        placement_covariance=np.eye(3) * 1e-6,
        graph_before=poses,
        used=(True,) * stops,
        checks=(),
        pairs=(),
        stop_scans=(),
        trajectory=Trajectory(np.array(stamps, dtype=np.int64), np.array(trajectory)),
        source="laser",
        systematic=0.0,
        warnings=(),
    )
    surface = surface_of(scene, dict(enumerate(poses)))
    return (
        FakeRecording(scans if laser else [], laser=laser),
        tuple(snapshots),
        registration,
        surface,
    )


def legs_of(scene: Scene, seed: int = 0, **settings: object) -> Legs:
    """Return what the stage finds on a short drive round a scene."""
    rng = np.random.default_rng(seed)
    arguments = {"scans_between": 8, "scans_per_stop": 4, **settings}
    given = drive(scene, rng, **arguments)  # type: ignore[arg-type]
    return find_legs(*given, config=LegsConfig(), sensors=SENSORS)


def errors_of(legs: Legs, truth: Floats) -> Floats:
    """Return each true leg's distance to the nearest found one."""
    places = np.array([[leg.x, leg.y] for leg in legs.legs])
    errors: Floats = np.linalg.norm(truth[:, None] - places[None], axis=2).min(axis=1)
    return errors
