"""A drive round a rectangle, made up: every result and event that a run hands to its reviewer."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import MISSING, fields, replace
from typing import Any, TypeVar, get_origin, get_type_hints

import numpy as np
from msgspec import structs
from numpy.typing import ArrayLike, NDArray

from tablemap import model as m
from tablemap import pipeline
from tablemap.errors import ProcessWarning
from tablemap.events import OfTable, OtherTable, StageFinished, StageStarted
from tablemap.geometry import Bools, Floats, Ints, Pose2
from tablemap.inputs import Input
from tablemap.recording import DepthFrame, FrameNames, Recording
from tablemap.recording.messages import CompressedImage, Image, LaserScan
from tablemap.review.images import encode_depth
from tablemap.stages.calibration import Calibration
from tablemap.stages.calibration.adjustment import FIELD, Beliefs, Common, unadjusted
from tablemap.stages.calibration.result import LevelResiduals
from tablemap.stages.crosscheck import CrossCheck
from tablemap.stages.legs import Leg, Legs, RejectedCluster
from tablemap.stages.odometry import Odometry, OdometryMap, OdometryScan, Trajectory
from tablemap.stages.outline import EdgeKind, Outline, ViewEdges
from tablemap.stages.registration import (
    LaserStatistics,
    Pair,
    PairIteration,
    PairStarted,
    Registration,
    StopCheck,
    StopScan,
)
from tablemap.stages.segmentation import (
    Label,
    Segmentation,
    TableCandidate,
    TablesFound,
    ViewSegmentation,
)
from tablemap.stages.snapshots import Camera, SetAside, Snapshot, Snapshots
from tablemap.stages.surface import FittedFigure, Primitive, Surface, SurfaceEdge
from tests.making.casting import Box, World, cast_level, looking
from tests.making.models import rectangle_model

Made = TypeVar("Made", bound=Any)
START_NS = 1_600_000_000_123_456_789
STOP_NS = 5_000_000_000
LENGTH, WIDTH, HEIGHT = 1.2, 0.8, 0.74
TABLE = Pose2(1.5, -0.4, 0.35)
ROOM = 3.0
CAMERA = Camera(width=320, height=240, fx=269.0, fy=269.0, cx=159.5, cy=119.5)
LASER_HEIGHT = 0.18
WORLD = World(
    [Box(TABLE.x, TABLE.y, LENGTH, WIDTH, HEIGHT - 0.02, HEIGHT, TABLE.yaw)],
    Box(TABLE.x, TABLE.y, 2 * ROOM, 2 * ROOM).sides(),
)


def filled(kind: type[Made], *values: object) -> Made:
    """Make a result of its first fields; later ones, that no drawing needs, are left neutral."""
    hints = get_type_hints(kind)
    named = dict(zip([one.name for one in fields(kind)], values, strict=False))
    for one in fields(kind)[len(values) :]:
        if one.default is MISSING and one.default_factory is MISSING:
            origin = get_origin(hints[one.name]) or hints[one.name]
            neutral = {tuple: (), dict: {}, float: 0.0, int: 0, str: "", bool: False}
            named[one.name] = neutral.get(
                origin, np.zeros((0, 2)) if origin is np.ndarray else None
            )
    return kind(**named)


def base_from_camera() -> Floats:
    """The optical frame 1.09 m up, looking 35 degrees down."""
    return looking(1.09, np.radians(35), ahead=0.1)


def true_pose(index: int, stops: int) -> Pose2:
    """A stop on a circle round the table, facing it."""
    angle = -2 * np.pi * index / stops
    return TABLE @ Pose2(1.35 * np.cos(angle), 1.35 * np.sin(angle), angle + np.pi)


def outline() -> Floats:
    """The table's corners in the map, counter-clockwise."""
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * np.array([LENGTH, WIDTH]) / 2
    return TABLE.apply(corners)


def render(map_from_base: Pose2) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Cast the camera's rays at floor, top and four walls: depth and labels."""
    map_from_camera = map_from_base.lifted() @ base_from_camera()
    rays = CAMERA.rays.astype(np.float64) @ map_from_camera[:3, :3].T
    centre = map_from_camera[:3, 3]
    depth, what = WORLD.cast(centre, rays)
    on = what == 1
    labels = np.select([what == 0, on], [Label.FLOOR, Label.TOP], Label.FRONT)
    with np.errstate(divide="ignore"):
        to_top = np.where(rays[..., 2] < 0, (HEIGHT - centre[2]) / rays[..., 2], 99.0)
    local = TABLE.inverse().apply((centre + rays * to_top[..., None])[..., :2])
    through = ~on & (np.linalg.norm(local, axis=-1) < 1.5)
    labels = np.where(through, Label.BEHIND, labels)
    cup = on & (np.linalg.norm(local - np.array([0.2, 0.1]), axis=-1) < 0.07)
    labels = np.where(cup, Label.ON_TOP, labels)
    depth = np.where(cup, depth * 0.95, depth)
    depth[:, :6] = np.nan
    labels[:, :6] = Label.UNKNOWN
    return depth.astype(np.float32), labels.astype(np.uint8)


def each(pose_at: Callable[[int], Floats | None], stamps_ns: ArrayLike) -> tuple[Floats, Bools]:
    """Return the poses (n, 4, 4) at stamps (n,), and which of them are known."""
    poses = [pose_at(int(stamp)) for stamp in np.asarray(stamps_ns)]
    known = np.array([pose is not None for pose in poses], dtype=bool)
    return np.array([np.eye(4) if p is None else p for p in poses]).reshape(-1, 4, 4), known


class MadeUpRecording(Recording):
    """A recording that answers from the truth, its localisation a few centimetres off."""

    def __init__(self, *, stops: int = 8, seed: int = 1) -> None:
        rng = np.random.default_rng(seed)
        self.input = Input.of("made_up.mcap")
        self.names = FrameNames("map", "odom", "base_footprint", "head_camera", "laser")
        self.stops = stops
        self.start_ns = START_NS
        self.end_ns = START_NS + stops * STOP_NS
        self.warnings = []
        self.offsets = rng.normal(size=(stops, 3)) * np.array([0.05, 0.05, 0.03])

    def close(self) -> None:
        """There is no file."""

    def stamp(self, index: int) -> int:
        """The middle of a stop."""
        return START_NS + index * STOP_NS + STOP_NS // 2

    def localised(self, index: int) -> Pose2:
        """A stop's pose as the robot believed it."""
        return true_pose(index, self.stops) @ Pose2.from_array(self.offsets[index])

    def depth_stamps(self) -> Ints:
        """See `Recording`."""
        return np.array([self.stamp(i) for i in range(self.stops)], dtype=np.int64)

    def depth_frames(self, stamps_ns: Ints | None = None) -> Iterator[DepthFrame]:
        """See `Recording`."""
        k = np.array([[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]])
        for i in range(self.stops):
            shot = snapshot(self, i)
            yield DepthFrame(shot.stamp_ns, shot.depth, k, shot.depth_message, base_from_camera())

    def scan_stamps(self) -> Ints:
        """See `Recording`."""
        return np.array([self.stamp(i) for i in range(self.stops)], dtype=np.int64)

    def scans(
        self,
        start_ns: int | None = None,
        end_ns: int | None = None,
        *,
        stamps_ns: Ints | None = None,
    ) -> Iterator[LaserScan]:
        """See `Recording`."""
        for i in range(self.stops):
            stamp = self.stamp(i)
            if stamps_ns is not None and stamp not in stamps_ns:
                continue
            if (start_ns is None or stamp >= start_ns) and (end_ns is None or stamp <= end_ns):
                yield scan(true_pose(i, self.stops), stamp)

    def base_from_laser(self, stamp_ns: int) -> Floats:
        """See `Recording`."""
        pose = np.eye(4)
        pose[:3, 3] = [0.17, 0.0, LASER_HEIGHT]
        return pose

    def fixed_from_base(self, stamp_ns: int) -> Floats | None:
        """See `Recording`."""
        return self._between(stamp_ns, self.localised)

    def odom_from_base(self, stamp_ns: int) -> Floats | None:
        """See `Recording`."""
        origin = true_pose(0, self.stops).inverse()
        return self._between(stamp_ns, lambda i: origin @ true_pose(i, self.stops))

    def fixed_from_bases(self, stamps_ns: ArrayLike) -> tuple[Floats, Bools]:
        """See `Recording`."""
        return each(self.fixed_from_base, stamps_ns)

    def odom_from_bases(self, stamps_ns: ArrayLike) -> tuple[Floats, Bools]:
        """See `Recording`."""
        return each(self.odom_from_base, stamps_ns)

    def pose_stamps(self) -> Ints:
        """See `Recording`."""
        return np.linspace(self.start_ns, self.end_ns, 20 * self.stops).astype(np.int64)

    def _between(self, stamp_ns: int, pose: object) -> Floats:
        assert callable(pose)
        places = np.stack([pose(i).as_array() for i in range(self.stops)])
        return Trajectory(self.depth_stamps(), places).at(stamp_ns).lifted()


def scan(map_from_base: Pose2, stamp_ns: int) -> LaserScan:
    """A scan of the four walls."""
    angles = np.arange(-2.1, 2.1, 4.2 / 240)
    laser = map_from_base @ Pose2(0.17, 0, 0)
    beams = laser.rotate(np.column_stack([np.cos(angles), np.sin(angles)]))
    ranges = cast_level(WORLD.walls, laser.translation, beams).astype(np.float32)
    return LaserScan(stamp_ns, "laser", -2.1, 2.1, 4.2 / 240, 0.0, 0.03, 0.05, 30.0, ranges)


def snapshot(recording: MadeUpRecording, index: int) -> Snapshot:
    """One stop's snapshot, its depth recorded as compressedDepth, its colour as raw."""
    depth, labels = render(true_pose(index, recording.stops))
    stamp = recording.stamp(index)
    colour = np.stack([40 * labels, 255 - 40 * labels, 90 + 0 * labels], axis=-1).astype(np.uint8)
    return Snapshot(
        index=index,
        stamp_ns=stamp,
        start_ns=stamp - STOP_NS // 4,
        end_ns=stamp + STOP_NS // 4,
        images=3,
        depth=depth,
        camera=CAMERA,
        base_from_camera=base_from_camera(),
        map_from_base=recording.localised(index),
        odom_from_base=Pose2.projected(recording.odom_from_base(stamp)),
        depth_message=CompressedImage(
            stamp, "head_camera", "16UC1; compressedDepth png", bytes(12) + encode_depth(depth)
        ),
        colour_message=Image(
            stamp,
            "head_camera",
            CAMERA.height,
            CAMERA.width,
            "bgr8",
            False,
            3 * CAMERA.width,
            colour.tobytes(),
        ),
    )


def results(*, stops: int = 8, seed: int = 1) -> list[object]:
    """All that a run records, in its order."""
    rng = np.random.default_rng(seed)
    recording = MadeUpRecording(stops=stops, seed=seed)
    shots = tuple(snapshot(recording, i) for i in range(stops))
    poses = tuple(true_pose(i, stops) for i in range(stops))
    taken = filled(
        Snapshots,
        shots,
        (SetAside("viewpoint", recording.stamp(2) + 7, "the robot was moving"),),
        "stops",
    )
    calibration = _calibration(shots)
    segmented = _segmentation(recording, shots)
    outlined, surface, legs = _outline(poses, rng), _surface(poses, rng), _legs(rng)
    parts: list[list[object]] = [
        [taken],
        [calibration],
        [TablesFound(segmented.candidates), segmented],
        _odometry(recording, poses),
        _registration(recording, poses, rng),
        [outlined],
        [surface],
        [legs],
        [_cross_check(), legs],
    ]
    run: list[object] = [recording]
    for index, (name, part) in enumerate(zip(pipeline.STAGES, parts, strict=True)):
        run += [StageStarted(name, index), *part, StageFinished(name, index, 0.3 + 0.2 * index)]
    return [*run, table_model(recording, poses), *beside(outlined, surface, legs)]


def _calibration(shots: tuple[Snapshot, ...]) -> Calibration:
    beliefs = Beliefs(
        Common(roll=0.004, pitch=0.004, height=0.003),
        scale=0.005,
        view_tilt=0.002,
        view_lift=0.0005,
        lean_share=(1.0, 0.5),
    )
    known = unadjusted(beliefs, len(shots))
    values = known.values.copy()
    values[:2] = 0.001, -0.002
    values[FIELD.start : FIELD.start + 4] = 0.003, 0.001, 0.0, 0.004
    columns, rows = np.meshgrid(np.linspace(-1, 1, 16), np.linspace(-1, 1, 12))
    bowl = 0.006 * (columns**2 + rows**2)
    return Calibration(
        adjustment=replace(known, values=values),
        beliefs=beliefs,
        floor_pixels=80_000,
        floor_rms_before=0.012,
        floor_rms_after=0.004,
        recorded=shots,
        snapshots=shots,
        warnings=(),
        turns=np.zeros(len(shots)),
        floor=LevelResiduals(before=bowl, after=0.1 * bowl),
        top=LevelResiduals(before=0.5 * bowl, after=0.05 * bowl),
        sees_top=True,
    )


def _segmentation(recording: MadeUpRecording, shots: tuple[Snapshot, ...]) -> Segmentation:
    views = []
    for shot in shots:
        labels = render(true_pose(shot.index, recording.stops))[1]
        sees = shot.index != 5
        top = int(np.sum(labels == Label.TOP))
        views.append(
            filled(
                ViewSegmentation,
                shot.index,
                labels,
                sees,
                None if sees else "too few pixels of the top",
                HEIGHT,
                top,
            )
        )
    aside = outline() + np.array([1.6, 1.2])
    candidates = (
        filled(
            TableCandidate,
            TABLE.x,
            TABLE.y,
            HEIGHT,
            0.96,
            (0, 1, 2, 3, 4, 6, 7),
            0.9,
            0.8,
            outline(),
            True,
            None,
        ),
        filled(
            TableCandidate,
            TABLE.x + 1.6,
            TABLE.y + 1.2,
            0.5,
            0.3,
            (3,),
            0.1,
            0.1,
            aside,
            False,
            "seen by one view",
        ),
    )
    return filled(Segmentation, tuple(views), HEIGHT, 0.001, candidates, ())


def _odometry(recording: MadeUpRecording, poses: tuple[Pose2, ...]) -> list[object]:
    stamps = recording.pose_stamps()
    truth = Trajectory(recording.depth_stamps(), np.stack([pose.as_array() for pose in poses]))
    drive = np.stack([truth.at(stamp).as_array() for stamp in stamps.tolist()])
    localised = np.stack(
        [Pose2.projected(recording.fixed_from_base(t)).as_array() for t in stamps.tolist()]
    )
    wheels = np.stack(
        [Pose2.projected(recording.odom_from_base(t)).as_array() for t in stamps.tolist()]
    )
    events: list[object] = []
    for i, stamp in enumerate(stamps.tolist()):
        pose = Pose2.from_array(drive[i])
        beams = scan(pose, stamp)
        points = (
            np.column_stack([np.cos(beams.angles), np.sin(beams.angles)]) * beams.ranges[:, None]
        )
        placed = (pose @ Pose2(0.17, 0, 0)).apply(points)
        threshold = 0.05 + 0.02 * float(np.sin(i / 9))
        events.append(OdometryScan(stamp, pose, placed, threshold, 0.004))
        if i % 10 == 0:
            events.append(OdometryMap(stamp, placed))
    result = filled(
        Odometry,
        Trajectory(stamps, drive + np.array([0.02, 0.01, 0.0])),
        Trajectory(stamps, localised),
        Trajectory(stamps, wheels),
        "laser",
        len(stamps),
        2,
        np.zeros((0, 2), dtype=np.int64),
        (),
    )
    return [*events, result]


def _registration(
    recording: MadeUpRecording, poses: tuple[Pose2, ...], rng: np.random.Generator
) -> list[object]:
    stops = len(poses)
    events: list[object] = []
    scans = []
    for i in range(stops):
        beams = scan(poses[i], 0)
        points = (
            np.column_stack([np.cos(beams.angles), np.sin(beams.angles)]) * beams.ranges[:, None]
        )
        points = Pose2(0.17, 0, 0).apply(points)
        directions = points / np.linalg.norm(points, axis=1)[:, None]
        scans.append(filled(StopScan, i, points, -directions, 12))
    pairs = []
    for source in range(stops):
        for target in (source - 1, source - 2):
            if target < 0 and target % stops == source:
                continue
            other = target % stops
            used = (source, other) != (5, 3)
            measured = poses[other].inverse() @ poses[source] @ Pose2(*(rng.normal(size=3) * 0.002))
            clouds = [
                np.column_stack([scans[i].points, np.zeros(len(scans[i].points))])
                for i in (source, other)
            ]
            start = measured @ Pose2(0.3, -0.2, 0.1)
            events.append(PairStarted(source, other, start, *clouds))
            for k in range(12):
                rmse = 0.004 + 0.03 * np.exp(-k / 3) if used else 0.03
                events.append(
                    filled(
                        PairIteration,
                        source,
                        other,
                        k,
                        measured @ Pose2(*(np.array([0.3, -0.2, 0.1]) * 0.5 ** (k + 1))),
                        1 - 0.6 * np.exp(-k / 2),
                        rmse,
                        900 + 20 * k,
                    )
                )
            kind = "depth" if target == source - 2 else ("loop" if target < 0 else "laser")
            reason = None if used else "the overlap is a plane that slides"
            pair = filled(
                Pair,
                source,
                other,
                kind,
                measured,
                np.eye(3) * 1e5,
                0.95,
                0.004,
                1100,
                used,
                reason,
            )
            pairs.append(pair)
    used_stops = tuple(i != 5 for i in range(stops))
    checks = tuple(
        filled(
            StopCheck,
            i,
            used_stops[i],
            LaserStatistics(0.0012, 0.8, 0.95, 0.02, 0.9, 0.001),
            () if used_stops[i] else ("edges 31 mm apart",),
        )
        for i in range(stops)
    )
    stamps = recording.pose_stamps()
    truth = Trajectory(recording.depth_stamps(), np.stack([pose.as_array() for pose in poses]))
    drive = np.stack([truth.at(stamp).as_array() for stamp in stamps.tolist()])
    warning = ProcessWarning(
        "recording.topic_choice", "registration", "a made-up doubt", recording.stamp(5)
    )
    result = filled(
        Registration,
        poses,
        np.eye(3 * stops) * 1e-6,
        np.diag([1e-4, 1e-4, 1e-4]),
        tuple(pose @ Pose2(0.01, -0.01, 0.01) for pose in poses),
        used_stops,
        checks,
        tuple(pairs),
        tuple(scans),
        Trajectory(stamps, drive),
        "laser",
        0.001,
        (warning,),
    )
    return [*scans, *events, result]


def _ring(points: int) -> tuple[Floats, Floats]:
    """Points along the outline, and their outward normals, both in the map."""
    corners = outline()
    places, normals = [], []
    for k in range(4):
        a, b = corners[k], corners[(k + 1) % 4]
        share = np.linspace(0, 1, points // 4, endpoint=False)[:, None]
        places.append(a + share * (b - a))
        along = (b - a) / np.linalg.norm(b - a)
        normals.append(np.tile([along[1], -along[0]], (points // 4, 1)))
    return np.concatenate(places), np.concatenate(normals)


def _outline(poses: tuple[Pose2, ...], rng: np.random.Generator) -> Outline:
    views = []
    for i, pose in enumerate(poses):
        places, normals = _ring(400)
        noisy = places + normals * rng.normal(size=(400, 1)) * 0.002
        back = pose.inverse()
        local = back.apply(noisy)
        near = np.einsum("ij,ij->i", pose.translation - places, normals) > 0
        kind = np.where(near, EdgeKind.TABLE, rng.choice(4, p=[0.85, 0.05, 0.06, 0.04], size=400))
        grid = np.stack(np.meshgrid(np.linspace(-0.58, 0.58, 30), np.linspace(-0.38, 0.38, 20)), -1)
        top = back.apply(TABLE.apply(grid.reshape(-1, 2)))
        views.append(
            ViewEdges(
                index=i,
                points=local,
                normals=back.rotate(normals),
                sigma=np.full(400, 0.002),
                kind=kind.astype(np.uint8),
                is_near=near,
                widening=np.zeros(400),
                hole=np.zeros(400),
                metres_per_px=np.full(400, 0.003),
                pixels=np.zeros((400, 2)),
                camera_xy=np.array([0.1, 0.0]),
                drop=0.4,
                axis=np.array([0.8, 0.0, -0.6]),
                top=top,
                free=top + 2.0,
            )
        )
    heights = {i: HEIGHT + 0.001 * float(rng.normal()) for i in range(len(poses))}
    return filled(Outline, tuple(views), HEIGHT, 0.0008, heights, 0.025, 0.002, ())


def _surface(poses: tuple[Pose2, ...], rng: np.random.Generator) -> Surface:
    corners = outline()
    statuses = ("measured", "measured", "inferred", "unseen")
    edges = tuple(
        filled(
            SurfaceEdge,
            np.array([corners[k], corners[(k + 1) % 4]]),
            statuses[k],
            0.001 if k < 3 else None,
            (0.97, 0.9, 0.4, 0.0)[k],
        )
        for k in range(4)
    )
    places, normals = _ring(800)
    residuals = 0.0015 * rng.normal(size=800) + 0.002 * np.sin(np.linspace(0, 6, 800))
    angles = np.linspace(0, 2 * np.pi, 73)[:-1]
    oval = TABLE.apply(np.column_stack([0.62 * np.cos(angles), 0.45 * np.sin(angles)]))
    dimensions = {
        "length": FittedFigure(LENGTH, 0.002, budget={"noise": 1e-6, "depth": 2e-6, "mount": 1e-6}),
        "width": FittedFigure(WIDTH, 0.0015, "inferred"),
    }
    candidates = (
        filled(Primitive, "rectangle", TABLE, dimensions, corners, 410.0, 0.98, 0.97, residuals),
        filled(
            Primitive,
            "ellipse",
            TABLE,
            {"major": FittedFigure(1.24, 0.01), "minor": FittedFigure(0.9, 0.01)},
            oval,
            2200.0,
            0.0,
            0.31,
            residuals * 20,
        ),
        filled(
            Primitive,
            "parallelogram",
            TABLE,
            {**dimensions, "angle": FittedFigure(1.571, 0.002)},
            corners,
            418.0,
            0.02,
            0.97,
            residuals,
        ),
    )
    return filled(
        Surface,
        "rectangle",
        TABLE,
        np.diag([1e-6, 2e-6, 1e-6]),
        np.diag([1e-6, 1e-6, 1e-6]),
        FittedFigure(HEIGHT, 0.001),
        None,
        dimensions,
        None,
        corners,
        edges,
        0.98,
        candidates,
        dict(enumerate(poses)),
        places + normals * residuals[:, None],
        residuals,
        corners * 1.0,
        (),
        TABLE.apply(np.array([[0.62, -0.2], [0.98, -0.2], [0.98, 0.16], [0.62, 0.16]])),
    )


def leg_places() -> Floats:
    """Four places under the top's corners."""
    return TABLE.apply(
        np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
        * np.array([LENGTH / 2 - 0.07, WIDTH / 2 - 0.07])
    )


def _cross_check() -> CrossCheck:
    offset = np.array([0.004, -0.001, 0.002])
    return filled(
        CrossCheck,
        offset,
        np.diag([1e-6, 1e-6, 1e-6]),
        offset[:2],
        np.full(2, 0.001),
        0.002,
        900,
        7,
    )


def _legs(rng: np.random.Generator) -> Legs:
    legs = []
    for k, (x, y) in enumerate(leg_places()):
        angles = rng.uniform(0, 2 * np.pi, 60)
        points = np.array([x, y]) + 0.025 * np.column_stack([np.cos(angles), np.sin(angles)])
        shape, size = ("circle", {"diameter": FittedFigure(0.05, 0.001)})
        if k == 3:
            shape, size = (
                "rectangle",
                {"length": FittedFigure(0.05, 0.001), "width": FittedFigure(0.05, None)},
            )
        legs.append(
            filled(
                Leg,
                shape,
                float(x),
                float(y),
                0.35,
                "inferred" if k == 2 else "measured",
                0.002,
                size,
                points,
                6,
            )
        )
    stray = TABLE.apply(np.array([[0.1, -0.8]])) + 0.03 * rng.normal(size=(40, 2))
    rejected = (
        filled(
            RejectedCluster,
            float(stray[:, 0].mean()),
            float(stray[:, 1].mean()),
            stray,
            "a chair's leg: outside the top",
        ),
    )
    evidence = np.concatenate([leg.points for leg in legs] + [stray])
    return filled(Legs, tuple(legs), rejected, evidence, ())


def table_model(recording: MadeUpRecording, poses: tuple[Pose2, ...]) -> m.TableModel:
    """The finished model: one side not seen, one stop not used."""
    model = rectangle_model(
        x=TABLE.x, y=TABLE.y, yaw=TABLE.yaw, length=LENGTH, width=WIDTH, height=HEIGHT
    )
    statuses = ("measured", "measured", "inferred", "unseen")
    edges = tuple(
        structs.replace(edge, status=status, sigma=None if status == "unseen" else 0.001)
        for edge, status in zip(model.surface.edges, statuses, strict=True)
    )
    width = m.Dimension(value=WIDTH, sigma=0.0015, status="inferred")
    dimensions = {**model.surface.dimensions, "width": width}
    return structs.replace(
        model,
        surface=structs.replace(model.surface, edges=edges, dimensions=dimensions),
        snapshots=tuple(
            m.SnapshotPose(
                stamp_ns=recording.stamp(i),
                map_from_base=m.PlanarPose(x=pose.x, y=pose.y, yaw=pose.yaw),
                sigma=m.PoseSigma(xy=0.001, yaw=0.001),
                used=i != 5,
                reason=None if i != 5 else "edges 31 mm apart",
            )
            for i, pose in enumerate(poses)
        ),
        verdict=m.Verdict(level="doubtful", reasons=("one side of the top was not seen",)),
        warnings=(
            m.WarningEntry(
                code="recording.topic_choice",
                stage="recording",
                message="two depth topics",
                stamp_ns=None,
            ),
            m.WarningEntry(
                code="recording.topic_choice",
                stage="registration",
                message="a made-up doubt",
                stamp_ns=recording.stamp(5),
            ),
        ),
    )


def beside(outlined: Outline, surface: Surface, legs: Legs) -> list[object]:
    """What a run hands on of two more tables: one that is modelled, one that is not."""
    parts = [OfTable(1, one) for one in (outlined, surface, _cross_check(), legs)]
    model = rectangle_model(x=TABLE.x + 1.6, y=TABLE.y + 1.2, length=0.9, width=0.6, height=0.5)
    failure = "none of 8 views shows enough of it"
    return [*parts, OtherTable(1, model), OtherTable(2, failure)]


def emptied(surface: Surface) -> Surface:
    """A surface of which nothing but a hull is known."""
    nothing = np.zeros((0, 2))
    return replace(
        surface,
        shape="mesh",
        dimensions={},
        candidates=(),
        points=nothing,
        residuals=np.zeros(0),
        edges=(),
    )


__all__ = ["MadeUpRecording", "emptied", "results"]
