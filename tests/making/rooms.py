"""Rooms of line segments, a laser that drives round in them, and what it would have recorded."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from tablemap.geometry import Bools, Floats, Ints, Pose2, interpolate, wrap_angles
from tablemap.inputs import Input
from tablemap.recording import FrameNames, Recording
from tablemap.recording.messages import CompressedImage, LaserScan
from tablemap.stages.snapshots import Camera, Snapshot
from tests.making.casting import Box, cast_level

SECOND = 1_000_000_000
BASE_FROM_LASER = np.eye(4)
BASE_FROM_LASER[:3, 3] = (0.1675, 0.0, 0.1844)


def room(seed: int, *, size: tuple[float, float] = (6.0, 5.0)) -> Floats:
    """Return (n, 4) segments: walls, four table legs round the origin, cupboards at the walls."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-0.4, 0.4), rng.uniform(-0.4, 0.4)
    boxes = [Box(x, y, *size, yaw=rng.uniform(-0.5, 0.5)), *table_legs(0.05)]
    for _ in range(5):
        angle = rng.uniform(-np.pi, np.pi)
        reach = 0.42 * np.array(size) * [np.cos(angle), np.sin(angle)]
        sizes = rng.uniform(0.2, 0.9, 2)
        boxes.append(Box(*reach, *sizes, yaw=rng.uniform(-np.pi, np.pi)))
    return np.vstack([box.sides() for box in boxes])


def corridor(yaw: float, *, leg: float = 0.06) -> Floats:
    """Return (n, 4) segments: two walls along ``yaw`` without an end in sight, four table legs."""
    ends = np.array([[-40.0, -2.4], [40.0, -2.4], [-40.0, 2.6], [40.0, 2.6]])
    walls = Pose2(0.0, 0.0, yaw).apply(ends).reshape(2, 4)
    return np.vstack([walls, *(box.sides() for box in table_legs(leg))])


def table_legs(side: float) -> list[Box]:
    """Return four square legs round the origin."""
    return [Box(x, y, side, side) for x in (-0.5, 0.5) for y in (-0.3, 0.3)]


@dataclass
class Drive:
    """A lap round the origin with stops, at 0.3 m/s, and what was recorded of it."""

    segments: Floats
    seed: int = 0
    stops: int = 8
    radius: float = 1.4
    localisation_sigma: tuple[float, float] = (0.06, 0.045)
    wheel_error: float = 0.03
    wheels: bool = True
    laser: bool = True
    range_sigma: float = 0.01
    time_increment: float = 3e-5
    person: bool = False
    standing_s: float = 1.2
    rate_hz: float = 15.0
    names: FrameNames = field(init=False)

    def __post_init__(self) -> None:
        """Lay out the true path at the scans' rate, the wheels' and the localisation's."""
        rng = np.random.default_rng(self.seed)
        moving_s = 2 * np.pi * self.radius / self.stops / 0.3
        lap_s = self.standing_s + moving_s
        times = np.arange(0.0, self.stops * lap_s, 1 / self.rate_hz)
        lap, within = np.divmod(times, lap_s)
        share = np.clip((within - self.standing_s) / moving_s, 0.0, 1.0)
        share = share * share * (3 - 2 * share)
        angle = -2 * np.pi * (lap + share) / self.stops
        self.stamps = (times * SECOND).astype(np.int64) + SECOND
        self.true = np.stack(
            [self.radius * np.cos(angle), self.radius * np.sin(angle), angle + np.pi], axis=1
        )
        self.stop_stamps = [
            int((k * lap_s + self.standing_s / 2) * SECOND) + SECOND for k in range(self.stops)
        ]
        self.half_stop_ns = int(0.45 * self.standing_s * SECOND)
        step = self._steps(self.true)
        scale = 1 + rng.normal(0, self.wheel_error, 3)
        noise = rng.normal(0, 1, step.shape) * np.abs(step) * 0.05
        self.wheel_poses = self._chain(step * scale + noise)
        jumps = rng.normal(0, 1, (self.stops + 1, 3)) * [
            self.localisation_sigma[0],
            self.localisation_sigma[0],
            self.localisation_sigma[1],
        ]
        self.localised = (
            self.true + jumps[np.minimum((lap + 0.5 + share / 2).astype(int), self.stops)]
        )
        self.names = FrameNames(
            "map",
            "odom" if self.wheels else None,
            "base_link",
            "camera",
            "laser" if self.laser else None,
        )
        self.start_ns, self.end_ns = int(self.stamps[0]), int(self.stamps[-1])
        self.input = Input.of("drive.mcap")
        self.warnings: list[object] = []

    @staticmethod
    def _steps(poses: Floats) -> Floats:
        located = [Pose2.from_array(p) for p in poses]
        return np.array([(a.inverse() @ b).as_array() for a, b in itertools.pairwise(located)])

    @staticmethod
    def _chain(steps: Floats) -> Floats:
        pose, poses = Pose2(0.3, -0.2, 0.7), [Pose2(0.3, -0.2, 0.7).as_array()]
        for step in steps:
            pose = pose @ Pose2.from_array(step)
            poses.append(pose.as_array())
        return np.array(poses)

    def true_at(self, stamp_ns: float) -> Pose2:
        """Return the true pose of the base in the map."""
        yaw = np.unwrap(self.true[:, 2])
        columns = [self.true[:, 0], self.true[:, 1], yaw]
        return Pose2.from_array([np.interp(stamp_ns, self.stamps, c) for c in columns])

    def _at(self, poses: Floats, stamp_ns: int) -> Floats | None:
        if not self.stamps[0] <= stamp_ns <= self.stamps[-1]:
            return None
        i = int(np.clip(np.searchsorted(self.stamps, stamp_ns), 1, len(self.stamps) - 1))
        first, second = (Pose2.from_array(poses[k]).lifted() for k in (i - 1, i))
        span = float(self.stamps[i] - self.stamps[i - 1])
        return interpolate(first, second, (stamp_ns - float(self.stamps[i - 1])) / span)

    def fixed_from_base(self, stamp_ns: int) -> Floats | None:
        """Return the localised pose."""
        return self._at(self.localised, stamp_ns)

    def odom_from_base(self, stamp_ns: int) -> Floats | None:
        """Return the wheels' pose."""
        return self._at(self.wheel_poses, stamp_ns) if self.wheels else None

    def fixed_from_bases(self, stamps_ns: Floats) -> tuple[Floats, Bools]:
        """Return the localised poses, and which are known."""
        return self._all(self.fixed_from_base, stamps_ns)

    def odom_from_bases(self, stamps_ns: Floats) -> tuple[Floats, Bools]:
        """Return the wheels' poses, and which are known."""
        return self._all(self.odom_from_base, stamps_ns)

    @staticmethod
    def _all(one: Callable[[int], Floats | None], stamps_ns: Floats) -> tuple[Floats, Bools]:
        poses = [one(int(stamp)) for stamp in stamps_ns]
        known = np.array([pose is not None for pose in poses], dtype=bool)
        return np.array([np.eye(4) if p is None else p for p in poses]).reshape(-1, 4, 4), known

    def pose_stamps(self) -> Ints:
        """Return the stamps of the localised poses."""
        return self.stamps

    def base_from_laser(self, stamp_ns: int) -> Floats:
        """Return the HSR's mounting."""
        return BASE_FROM_LASER

    def scan_stamps(self) -> Ints:
        """Return the stamps of the scans."""
        return self.stamps if self.laser else self.stamps[:0]

    def scans(
        self,
        start_ns: int | None = None,
        end_ns: int | None = None,
        *,
        stamps_ns: Ints | None = None,
    ) -> Iterator[LaserScan]:
        """Cast the HSR's 721 beams from the moving base, noise by stamp so that it repeats."""
        if not self.laser:
            return
        increment = 4.2 / 720
        bearing = -2.1 + increment * np.arange(721)
        for stamp in self.stamps if stamps_ns is None else np.intersect1d(self.stamps, stamps_ns):
            if (start_ns is not None and stamp < start_ns) or (
                end_ns is not None and stamp > end_ns
            ):
                continue
            rng = np.random.default_rng([self.seed, int(stamp)])
            beam_ns = stamp + self.time_increment * SECOND * np.arange(721)
            first, last = self.true_at(beam_ns[0]), self.true_at(beam_ns[-1])
            step = first.inverse() @ last
            share = np.linspace(0, 1, 721)
            yaw = first.yaw + share * step.yaw
            place = first.translation + share[:, None] * (last.translation - first.translation)
            mount = BASE_FROM_LASER[:2, 3]
            origin = place + np.stack(
                [
                    np.cos(yaw) * mount[0] - np.sin(yaw) * mount[1],
                    np.sin(yaw) * mount[0] + np.cos(yaw) * mount[1],
                ],
                axis=1,
            )
            segments = self.segments
            if self.person:
                t = (stamp - self.stamps[0]) / SECOND
                x, y = 2.1 * np.cos(0.5 * t), 2.0 * np.sin(0.4 * t)
                segments = np.vstack([segments, Box(x, y, 0.3, 0.3, yaw=t).sides()])
            beams = np.stack([np.cos(yaw + bearing), np.sin(yaw + bearing)], axis=1)
            ranges = cast_level(segments, origin, beams)
            ranges = ranges + rng.normal(0, self.range_sigma, 721)
            ranges[rng.uniform(size=721) < 0.01] = np.inf
            yield LaserScan(
                int(stamp),
                "laser",
                -2.1,
                2.1,
                increment,
                self.time_increment,
                1 / 30,
                0.05,
                60.0,
                ranges.astype(np.float32),
            )

    def snapshots(self) -> tuple[Snapshot, ...]:
        """Return a snapshot without depth for each stop."""
        camera = Camera(4, 3, 4.0, 4.0, 2.0, 1.5)
        image = CompressedImage(0, "camera", "", b"")
        made = []
        for i, stamp in enumerate(self.stop_stamps):
            fixed, odom = self.fixed_from_base(stamp), self.odom_from_base(stamp)
            assert fixed is not None
            made.append(
                Snapshot(
                    i,
                    stamp,
                    stamp - self.half_stop_ns,
                    stamp + self.half_stop_ns,
                    1,
                    np.full((3, 4), np.nan, dtype=np.float32),
                    camera,
                    np.eye(4),
                    Pose2.projected(fixed),
                    None if odom is None else Pose2.projected(odom),
                    image,
                    None,
                )
            )
        return tuple(made)

    def recording(self) -> Recording:
        """Return this drive as what the estimators take."""
        return cast(Recording, self)

    def truth(self) -> Floats:
        """Return (n, 3) true poses at the stops."""
        return np.array([self.true_at(stamp).as_array() for stamp in self.stop_stamps])


def relative_errors(estimated: Floats, truth: Floats) -> tuple[Floats, Floats]:
    """Return (n,) metres and (n,) radians that are left after the best fit in SE(2)."""
    a, b = (
        estimated[:, :2] - estimated[:, :2].mean(axis=0),
        truth[:, :2] - truth[:, :2].mean(axis=0),
    )
    turn = np.arctan2(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), np.sum(a * b))
    place = np.linalg.norm(Pose2(0, 0, float(turn)).apply(a) - b, axis=1)
    yaw = estimated[:, 2] + turn - truth[:, 2]
    return place, np.abs(wrap_angles(yaw))
