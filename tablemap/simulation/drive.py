"""The robot's drive: its true pose at any time, and the pose that it publishes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely

from tablemap.geometry import Floats, Pose2, compose, inverses, wrap_angles
from tablemap.simulation.scenario import Localisation, Robot, Wheels
from tablemap.simulation.world import World

CAMERA_AHEAD = 0.11
TF_PERIOD = 0.05
"""Seconds between two published poses."""

_LEAD = 0.4
_EASE = 1.5  # the peak of the eased speed over its mean


@dataclass(frozen=True, eq=False)
class Drive:
    """The true drive.

    - ``stops``: (k, 2), first and last second of each stop
    - ``distances``: (k,) metres along the path, of the stops
    - ``headings``: (k,) radians by which the robot looks past its aim at the stops
    - ``rests``: (m, 2), first and last second of each rest of the head, one or several a stop
    - ``pans``: (m,) radians by which the head is turned to the left then, about the base's vertical
      axis
    - ``tilts``: (m,) radians by which the camera looks down then
    """

    world: World
    stops: Floats
    distances: Floats
    headings: Floats
    rests: Floats
    pans: Floats
    tilts: Floats
    aim: float

    @property
    def duration(self) -> float:
        """Seconds from the start of the first stop to the end of the last."""
        return float(self.stops[-1, 1])

    def standing(self, seconds: Floats) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Return which times fall into a stop."""
        i = np.clip(np.searchsorted(self.stops[:, 0], seconds, side="right") - 1, 0, None)
        return np.asarray(seconds <= self.stops[i, 1])

    def base(self, seconds: Floats) -> Floats:
        """Return the base's true poses in the map: (n, 3) x, y, yaw."""
        distance = eased(seconds, self.stops, self.distances)
        places = np.asarray(
            shapely.get_coordinates(
                shapely.line_interpolate_point(self.world.path, distance % self.world.path.length)
            )
        )
        past = eased(seconds, self.stops, self.headings)
        return np.column_stack([places, self._facing(places) + past])

    def tilt(self, seconds: Floats) -> Floats:
        """Return the angle by which the camera looks down, radians."""
        return eased(seconds, self.rests, self.tilts)

    def pan(self, seconds: Floats) -> Floats:
        """Return the angle by which the head is turned to the left, radians."""
        return eased(seconds, self.rests, self.pans)

    def _facing(self, places: Floats) -> Floats:
        """Return the yaw (n,) that faces the table: between its middle and its nearest part."""
        middle = self.world.map_from_table.translation
        top = shapely.Polygon(self.world.map_from_table.apply(self.world.top.outline)).convex_hull
        points = shapely.points(places)
        nearest = shapely.get_coordinates(
            shapely.line_interpolate_point(
                top.exterior, shapely.line_locate_point(top.exterior, points)
            )
        )
        target = self.aim * middle + (1 - self.aim) * nearest
        return np.asarray(np.arctan2(target[:, 1] - places[:, 1], target[:, 0] - places[:, 0]))


def eased(seconds: Floats, spans: Floats, values: Floats) -> Floats:
    """Interpolate values that are constant in spans (m, 2) of time, with smooth transitions."""
    if len(values) == 1:
        return np.full(len(seconds), values[0])
    i = np.clip(np.searchsorted(spans[:, 0], seconds, side="right") - 1, 0, len(values) - 2)
    leave, arrive = spans[i, 1], spans[i + 1, 0]
    done = np.clip((seconds - leave) / (arrive - leave), 0.0, 1.0)
    return np.asarray(values[i] + (values[i + 1] - values[i]) * done**2 * (3 - 2 * done))


def draw_drive(robot: Robot, world: World, rng: np.random.Generator) -> Drive:
    """Draw a clockwise drive round the table, with a stop at each viewpoint."""
    closed = robot.span_deg >= 360
    span = np.deg2rad(robot.span_deg)
    if closed:
        start = rng.uniform(-np.pi, np.pi)
        azimuths = start - np.arange(robot.stops) * span / robot.stops
    else:
        half = np.linspace(0.5, -0.5, robot.stops) if robot.stops > 1 else np.zeros(1)
        azimuths = world.away_from_wall + half * span
    jitter = rng.normal(0, np.deg2rad(2.0), robot.stops)
    distances = _where(world, azimuths + jitter)
    distances = np.unwrap(distances, period=world.path.length)
    gaps = np.abs(np.diff(distances))
    looks = _looks(robot)
    stops = np.zeros((robot.stops, 2))
    stops[0] = 0.0, looks[-1, 1]
    for k, gap in enumerate(gaps):
        arrive = stops[k, 1] + max(_EASE * gap / robot.speed, 0.5)
        stops[k + 1] = arrive, arrive + looks[-1, 1]
    headings = rng.normal(0, np.deg2rad(2.5), robot.stops)
    rests = (stops[:, None, :1] + looks).reshape(-1, 2)
    pans = np.tile(np.deg2rad(robot.pan_deg), robot.stops)
    drive = Drive(world, stops, distances, headings, rests, pans, np.zeros(len(rests)), 0.7)
    gazes = drive.base(rests.mean(axis=1)) + pans[:, None] * (0.0, 0.0, 1.0)
    tilts = np.array([_tilt(gaze, world, robot.camera_height) for gaze in gazes])
    return replace(drive, tilts=tilts)


def _looks(robot: Robot) -> Floats:
    """Return (n, 2): start and end of the head's rests, seconds after the stop began."""
    moves = _EASE * np.abs(np.diff(robot.pan_deg)) / robot.pan_speed_deg
    starts = np.concatenate([[0.0], np.cumsum(robot.stop_seconds + moves)])
    return np.column_stack([starts, starts + robot.stop_seconds])


def _where(world: World, azimuths: Floats) -> Floats:
    """Return the distance along the path at which each direction from the table meets it."""
    middle = world.map_from_table.translation
    found = []
    for azimuth in azimuths:
        far = middle + 20.0 * np.array([np.cos(azimuth), np.sin(azimuth)])
        crossing = shapely.LineString([middle, far]).intersection(world.path)
        found.append(world.path.project(shapely.points(shapely.get_coordinates(crossing)[0])))
    return np.array(found)


def _tilt(gaze: Floats, world: World, camera_height: float) -> float:
    """Aim the camera so that the near and the far rim of the top lie about the image's middle."""
    looking = Pose2.from_array(gaze)
    rim = (looking.inverse() @ world.map_from_table).apply(world.top.outline)
    ahead = np.linalg.norm(rim - (CAMERA_AHEAD, 0.0), axis=1)
    seen = np.abs(np.arctan2(rim[:, 1], rim[:, 0] - CAMERA_AHEAD)) < np.deg2rad(32)
    if not seen.any():
        seen[:] = True
    down = np.arctan2(camera_height - world.top.height, ahead[seen])
    return float(np.clip((down.min() + down.max()) / 2, np.deg2rad(8), np.deg2rad(60)))


@dataclass(frozen=True, eq=False)
class Belief:
    """The poses that the robot publishes, (n, 3) each, at ``seconds`` (n,)."""

    seconds: Floats
    odom_from_base: Floats
    map_from_odom: Floats
    map_from_base: Floats


def believe(
    drive: Drive, wheels: Wheels, localisation: Localisation, rng: np.random.Generator
) -> Belief:
    """Draw wheel odometry that drifts and a localisation that wanders and jumps."""
    seconds = np.arange(-_LEAD, drive.duration + _LEAD + TF_PERIOD, TF_PERIOD)
    true = drive.base(seconds)
    steps = _relative(true[:-1], true[1:])
    moved = np.linalg.norm(steps[:, :2], axis=1)
    scale = 1 + wheels.scale_sigma * rng.normal()
    yaw_scale = 1 + wheels.yaw_scale_sigma * rng.normal()
    noise = rng.normal(size=steps.shape) * np.sqrt(moved)[:, None]
    noise *= (
        wheels.noise_per_sqrt_metre,
        wheels.noise_per_sqrt_metre,
        np.deg2rad(wheels.yaw_noise_deg_per_sqrt_metre),
    )
    start = rng.uniform((-1, -1, -np.pi), (1, 1, np.pi))
    odom = _chained(start, steps * (scale, scale, yaw_scale) + noise)
    error = _localisation_error(drive, localisation, seconds, moved, rng)
    recorded = true + error
    return Belief(seconds, odom, compose(recorded, inverses(odom)), recorded)


def _localisation_error(
    drive: Drive,
    localisation: Localisation,
    seconds: Floats,
    moved: Floats,
    rng: np.random.Generator,
) -> Floats:
    """Draw errors (n, 3): one a stop, which changes on the way to the next, and a slow wander."""
    spread = np.array([1.0, 1.0, 0.0]) * localisation.sigma
    spread[2] = np.deg2rad(localisation.yaw_sigma_deg)
    jumps = rng.normal(size=(len(drive.stops), 3)) * spread
    leave, arrive = drive.stops[:-1, 1], drive.stops[1:, 0]
    when = leave + (arrive - leave) * rng.uniform(0.2, 0.8, len(leave))
    error = jumps[np.searchsorted(when, seconds, side="right")]
    spread = np.array([1.0, 1.0, 0.0]) * localisation.wander
    spread[2] = np.deg2rad(localisation.yaw_wander_deg)
    kept = np.exp(-moved / 0.5)
    wander = np.zeros_like(error)
    pushes = rng.normal(size=(len(moved), 3)) * spread * np.sqrt(1 - kept**2)[:, None]
    for k in range(len(moved)):
        wander[k + 1] = kept[k] * wander[k] + pushes[k]
    return np.asarray(error + wander)


def _relative(first: Floats, second: Floats) -> Floats:
    step = compose(inverses(first), second)
    step[:, 2] = wrap_angles(step[:, 2])
    return step


def _chained(start: Floats, steps: Floats) -> Floats:
    """Chain steps in the moving frame (a midpoint rule is not needed: steps are millimetres)."""
    yaw = start[2] + np.concatenate([[0.0], np.cumsum(steps[:, 2])])
    c, s = np.cos(yaw[:-1]), np.sin(yaw[:-1])
    dx, dy = c * steps[:, 0] - s * steps[:, 1], s * steps[:, 0] + c * steps[:, 1]
    x = start[0] + np.concatenate([[0.0], np.cumsum(dx)])
    y = start[1] + np.concatenate([[0.0], np.cumsum(dy)])
    return np.column_stack([x, y, yaw])
