"""A simulated recording before it is written: everything that is drawn from the seed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tablemap.geometry import Floats, wrap_angle
from tablemap.simulation.attitude import Attitude, draw_attitude
from tablemap.simulation.camera import CameraErrors, DepthCamera, map_from, recorded_mounting
from tablemap.simulation.drive import Belief, Drive, believe, draw_drive
from tablemap.simulation.laser import LaserErrors
from tablemap.simulation.meshes import MeshPart
from tablemap.simulation.scenario import Robot, Scenario
from tablemap.simulation.scene import Scene
from tablemap.simulation.seeds import Generators, generators
from tablemap.simulation.shapes import surface_truth
from tablemap.simulation.visibility import TopSeen, places_on_top, top_seen
from tablemap.simulation.world import World, draw_world

_FIRST_STAMP_NS = 1_700_000_000_000_000_000
_NEVER = np.inf


@dataclass(frozen=True, eq=False)
class Simulation:
    """A world, a drive and a robot's errors; images and scans are made when it is written.

    - ``image_seconds``, ``scan_seconds``: stamps, from the start of the first stop on
    - ``moved_second``: when furniture is moved; inf: never
    """

    scenario: Scenario
    seed: int
    world: World
    drive: Drive
    attitude: Attitude
    belief: Belief
    camera: DepthCamera
    laser_errors: LaserErrors
    image_seconds: Floats
    scan_seconds: Floats
    moved_second: float

    def stamp_ns(self, second: float) -> int:
        """Return the stamp of a time of the drive."""
        return _FIRST_STAMP_NS + self.seed * 1_000_000_000_000 + round(second * 1e6) * 1000

    def rest_at(self, second: float) -> int:
        """Return the index of the head's rest at a time, or of the last one before it."""
        return int(np.searchsorted(self.drive.rests[:, 0], second, side="right")) - 1

    def resting_at(self, second: float) -> int | None:
        """Return the index of the head's rest during which a time falls, None in between."""
        rest = self.rest_at(second)
        return rest if rest >= 0 and second <= self.drive.rests[rest, 1] else None

    def parts(self, *, moved: bool) -> tuple[MeshPart, ...]:
        """Return all parts in the room that are not glass, before or after the move."""
        standing = tuple(part for part in self.world.parts if not part.glass)
        return standing + (self.world.after if moved else self.world.before)

    def scene(self, second: float) -> Scene:
        """Return everything that camera and laser can meet at a time, without glass."""
        moved = bool(second >= self.moved_second)
        if self.world.people:
            walking = [part for person in self.world.people for part in person.parts(second)]
            return Scene([*self.parts(moved=moved), *walking])
        if moved not in self._scenes:
            self._scenes[moved] = Scene(self.parts(moved=moved))
        return self._scenes[moved]

    @cached_property
    def _scenes(self) -> dict[bool, Scene]:
        return {}

    def map_from_camera(self, second: float) -> Floats:
        """Return the true (4, 4) pose of the optical frame."""
        at = np.array([second])
        pan, tilt = self.attitude.turns(at)[0]
        mounting = recorded_mounting(
            self.scenario.robot.camera_height, float(self.drive.tilt(at)[0] + tilt)
        )
        # The head turns about the base's vertical axis, and the camera's errors turn with it.
        base = self.drive.base(at)[0]
        looking = base + (self.drive.pan(at) + pan) * (0.0, 0.0, 1.0)
        pose = map_from(looking, self.camera.errors.applied(mounting))
        leaning = self.attitude.leaning(base, second)
        return pose if leaning is None else leaning @ pose

    @cached_property
    def generator(self) -> Generators:
        """The recording's random numbers by purpose."""
        return generators(self.scenario.name, self.seed)

    @cached_property
    def true_bases(self) -> Floats:
        """The (n, 3) true poses of the base at the images."""
        return self.drive.base(self.image_seconds)

    @cached_property
    def tops_seen(self) -> list[TopSeen]:
        """How much of the top each image shows."""
        places = places_on_top(self.world)
        seen: list[TopSeen] = []
        before: tuple[Scene, Floats] | None = None
        for second in self.image_seconds.tolist():
            now = self.scene(second), self.map_from_camera(second)
            if before and before[0] is now[0] and (before[1] == now[1]).all():
                seen.append(seen[-1])
            else:
                seen.append(top_seen(places, now[0], self.camera, now[1]))
            before = now
        return seen

    def truth(self) -> dict[str, object]:
        """Return the truth file: table, legs, the base at each image, the sensors' errors."""
        table, world = self.scenario.table, self.world
        # With the folds of a cloth or a rounded rim, the end of the top is not exactly defined.
        tolerance = (2 * table.edge_size if table.edge != "sharp" else 0.0) + (
            0.012 if table.cloth else 0.0
        )
        camera, laser = self.camera.errors, self.laser_errors
        snapshots = [
            {
                "stamp_ns": self.stamp_ns(second),
                "map_from_base": {"x": pose[0], "y": pose[1], "yaw": wrap_angle(pose[2])},
                "rest": self.resting_at(second),
                "top_in_image": round(seen.in_image, 4),
                "sees_top": round(seen.unhidden, 4),
            }
            for second, pose, seen in zip(
                self.image_seconds, self.true_bases.tolist(), self.tops_seen, strict=True
            )
        ]
        return {
            "schema": "tablemap/truth/1",
            "frame": "map",
            "scenario": self.scenario.name,
            "seed": self.seed,
            "surface": {
                **surface_truth(
                    world.top,
                    world.map_from_table,
                    thickness=None if table.cloth else table.thickness,
                    tolerance=tolerance,
                ),
                "relief": world.relief.truth(world.map_from_table) if world.relief else None,
            },
            "floor": world.waves.truth() if world.waves else None,
            "legs": [leg.truth(world.map_from_table) for leg in world.legs],
            "snapshots": snapshots,
            "sensor": {
                "depth_scale": camera.depth_scale,
                "focal_scale": camera.focal_scale,
                "pitch": camera.pitch,
                "roll": camera.roll,
                "camera_yaw": camera.yaw,
                "camera_x": camera.x,
                "camera_y": camera.y,
                "camera_z": camera.z,
                "bend": camera.bend.truth() if camera.bend else None,
                "warming": camera.warming,
                "corners": camera.corners,
                **self.attitude.truth(),
                "laser_range_scale": laser.scale,
                "laser_range_bias": laser.bias,
                "laser_range_bias_slope": laser.bias_slope,
                "laser_x": laser.x,
                "laser_y": laser.y,
                "laser_yaw": laser.yaw,
                "laser_dark": laser.dark,
                "laser_bend": laser.bend,
            },
        }


def simulate(scenario: Scenario, *, seed: int, nominal: bool = False) -> Simulation:
    """Draw a recording's world, drive and errors; ``nominal`` keeps the table's sizes as stated."""
    generator = generators(scenario.name, seed)
    world = draw_world(scenario, generator, nominal=nominal)
    drive = draw_drive(scenario.robot, world, generator("drive"))
    belief = believe(drive, scenario.wheels, scenario.localisation, generator("belief"))
    sensors = generator("sensors")
    camera = DepthCamera(scenario.camera, CameraErrors.drawn(scenario.camera, sensors, generator))
    laser_errors = LaserErrors.drawn(scenario.laser, sensors, generator)
    moved_second = _NEVER
    if scenario.surroundings.moved and len(drive.stops) > 1:
        half = len(drive.stops) // 2
        moved_second = float(drive.stops[half - 1 : half + 1].mean())
    return Simulation(
        scenario,
        seed,
        world,
        drive,
        draw_attitude(scenario, drive, generator),
        belief,
        camera,
        laser_errors,
        _image_seconds(scenario.robot, drive),
        _scan_seconds(scenario.robot, drive),
        moved_second,
    )


def _image_seconds(robot: Robot, drive: Drive) -> Floats:
    if robot.continuous_rate:
        return np.asarray(np.arange(0.1, drive.duration, 1 / robot.continuous_rate))
    within = (np.arange(robot.images_per_stop) + 1) / (robot.images_per_stop + 1)
    return (drive.rests[:, :1] + within * robot.stop_seconds).ravel()


def _scan_seconds(robot: Robot, drive: Drive) -> Floats:
    """Return the stamps of kept scans: many during stops, and at the log's set rate in motion."""
    if not robot.laser:
        return np.zeros(0)
    standing = np.arange(0.05, drive.stops[0, 1] - 0.03, 1 / robot.standing_scan_rate)
    seconds = (drive.stops[:, :1] + standing).ravel()
    moving = [
        np.arange(leave + 0.02, arrive - 0.03, 1 / robot.moving_scan_rate)
        for leave, arrive in zip(drive.stops[:-1, 1], drive.stops[1:, 0], strict=True)
    ]
    return np.sort(np.concatenate([seconds, *moving]))
