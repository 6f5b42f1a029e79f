"""The laser scanner at ankle height, and its errors.

Errors of ranges by the colour of the surface, and other errors of millimetres, were measured by
Kneip, Tache, Caprari and Siegwart (2009), "Characterization of the compact Hokuyo URG-04LX 2D
laser range finder".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats, compose, wrap_angles
from tablemap.simulation.attitude import Attitude
from tablemap.simulation.drive import Drive
from tablemap.simulation.scenario import Laser
from tablemap.simulation.scene import Scene
from tablemap.simulation.seeds import Generators, clipped_normal
from tablemap.simulation.world import Person

MOUNT = (0.1675, 0.0, 0.1844)
"""Where the scanner sits in the base, as published: metres, no rotation."""

ANGLE_MIN, ANGLE_MAX, BEAMS = -2.1, 2.1, 721
RANGE_MIN, RANGE_MAX = 0.05, 60.0
INCREMENT = (ANGLE_MAX - ANGLE_MIN) / (BEAMS - 1)

_HARMONICS = 3
_SUBBEAMS = 3
_SPOT = 0.06  # echoes closer together than this in range (metres) are one


def time_increment(laser: Laser) -> float:
    """Return the seconds from beam to beam: the mirror turns once a scan."""
    return laser.turn_seconds * INCREMENT / (2 * np.pi)


@dataclass(frozen=True)
class LaserErrors:
    """The laser's errors that the seed drew: range r reads as scale r + bias + slope min(r, 3 m).

    - ``x``, ``y``, ``yaw``: the true scanner's pose relative to the published one
    - ``dark``: metres by which black surfaces read further than white ones
    - ``bend``: (3, 2), metres, factors of cosine and sine of a beam's angle, of its double and of
      its triple; their sum is added to the range
    """

    scale: float
    bias: float
    bias_slope: float
    x: float
    y: float
    yaw: float
    dark: float = 0.0
    bend: tuple[tuple[float, float], ...] = ()

    @staticmethod
    def drawn(laser: Laser, rng: np.random.Generator, generator: Generators) -> LaserErrors:
        """Draw the errors of one recording; none is more than 2.5 sigma.

        ``generator`` gives newer errors their own random numbers, so that older draws stay as they
        were.
        """
        unit = np.clip(rng.normal(size=6), -2.5, 2.5)
        return LaserErrors(
            float(1 + laser.scale_sigma * unit[0]),
            float(laser.bias_sigma * unit[1]),
            float(laser.bias_slope_sigma * unit[2]),
            float(laser.mount_sigma * unit[3]),
            float(laser.mount_sigma * unit[4]),
            float(np.deg2rad(laser.mount_yaw_sigma_deg) * unit[5]),
            float(laser.dark_sigma * np.abs(clipped_normal(generator("laser dark"), 1)[0])),
            tuple(
                (float(c), float(s))
                for c, s in laser.bend_sigma
                / np.sqrt(_HARMONICS)
                * clipped_normal(generator("laser bend"), (_HARMONICS, 2))
            ),
        )

    def bent(self, angles: Floats) -> Floats:
        """Return metres (n,) that are added to ranges at angles (n,)."""
        turns = np.multiply.outer(angles, np.arange(1, len(self.bend) + 1))
        parts = np.array(self.bend).reshape(-1, 2)
        return np.asarray(np.cos(turns) @ parts[:, 0] + np.sin(turns) @ parts[:, 1])


def scan(
    scene: Scene,
    people: tuple[Person, ...],
    drive: Drive,
    attitude: Attitude,
    seconds: Floats,
    *,
    laser: Laser,
    errors: LaserErrors,
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """Return the (n, beams) ranges of scans that start at (n,) times; the base moves meanwhile."""
    subbeams = _SUBBEAMS if laser.beam_deg else 1
    beam = time_increment(laser)
    times = (seconds[:, None] + np.arange(BEAMS) * beam).ravel()
    # Within a scan the base moves by millimetres: interpolate between its first and last pose.
    first, last = drive.base(seconds), drive.base(seconds + BEAMS * beam)
    turn = wrap_angles(last[:, 2] - first[:, 2])
    step = np.column_stack([last[:, :2] - first[:, :2], turn])
    done = np.arange(BEAMS) / BEAMS
    base = (first[:, None, :] + done[:, None] * step[:, None, :]).reshape(-1, 3)
    mounting = np.array([[MOUNT[0] + errors.x, MOUNT[1] + errors.y, errors.yaw]])
    lasers = compose(base, mounting)
    origins = np.column_stack([lasers[:, :2], np.full(len(times), MOUNT[2])])
    angles = np.tile(ANGLE_MIN + INCREMENT * np.arange(BEAMS), len(seconds))
    width = np.deg2rad(laser.beam_deg)
    within = (np.arange(subbeams) - (subbeams - 1) / 2) / subbeams * width
    heading = (lasers[:, 2] + angles)[:, None] + within
    rays = np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=-1)
    starts = np.repeat(origins, subbeams, axis=0)
    rays = rays.reshape(-1, 3)
    leans = attitude.leans(seconds)
    if leans.any():
        foot = np.repeat(base * (1.0, 1.0, 0.0), subbeams, axis=0)
        leans = np.repeat(leans, subbeams * BEAMS, axis=0)
        yaws = np.repeat(base[:, 2], subbeams)
        starts = foot + _leaned(starts - foot, leans, yaws)
        rays = _leaned(rays, leans, yaws)
    hits = scene.cast(starts, rays)
    ranges = hits.distance
    if errors.dark:
        reflectances = np.array([part.reflectance for part in scene.parts] + [1.0])
        ranges = ranges + errors.dark * (1 - reflectances[hits.parts])
    for person in people:
        ankles = person.ankles(times)
        for side in range(2):
            middle = np.repeat(ankles[:, side], subbeams, axis=0)
            ranges = np.minimum(
                ranges, _to_circle(starts[:, :2], rays[:, :2], middle, person.ankle)
            )
    echoes = _echo(ranges.reshape(-1, subbeams), rng)
    noisy = errors.scale * echoes + errors.bias
    noisy += errors.bias_slope * np.minimum(echoes, 3.0)
    if laser.bend_sigma:
        noisy += errors.bent(angles)
    noisy += laser.noise_sigma * rng.standard_normal(len(noisy))
    lost = rng.random(len(noisy)) < laser.dropout
    # The scanner reports whole millimetres; without noise this rounding would add an error.
    rounded = np.round(noisy, 3) if laser.noise_sigma else noisy
    rounded = np.where(lost | ~(rounded < RANGE_MAX) | (rounded < RANGE_MIN), np.inf, rounded)
    return rounded.astype(np.float32).reshape(len(seconds), BEAMS)


def _leaned(vectors: Floats, leans: Floats, yaws: Floats) -> Floats:
    """Turn (n, 3) vectors with a base of these yaws that leans by (n, 2) roll and pitch.

    The angles are tenths of a degree: a turn is the cross product with its vector.
    """
    c, s = np.cos(yaws), np.sin(yaws)
    about = np.column_stack(
        [c * leans[:, 0] - s * leans[:, 1], s * leans[:, 0] + c * leans[:, 1], np.zeros(len(yaws))]
    )
    return np.asarray(vectors + np.cross(about, vectors))


def _to_circle(origins: Floats, rays: Floats, middles: Floats, diameter: float) -> Floats:
    """Return the distance (n,) at which unit rays enter circles, inf where they pass."""
    offset = middles - origins
    along = np.sum(offset * rays, axis=1)
    squared = (diameter / 2) ** 2 - (np.sum(offset**2, axis=1) - along**2)
    hit = (squared > 0) & (along > 0)
    return np.where(hit, along - np.sqrt(np.maximum(squared, 0.0)), np.inf)


def _echo(ranges: Floats, rng: np.random.Generator) -> Floats:
    """Merge the parts of each beam (n, k): near echoes win, thin ones mix with the background."""
    nearest = ranges.min(axis=1)
    near = ranges < (nearest + _SPOT)[:, None]
    near[~np.isfinite(nearest)] = True
    share = near.mean(axis=1)
    finite = np.where(np.isfinite(ranges), ranges, 0.0)
    front = np.where(np.isfinite(nearest), np.sum(finite * near, axis=1) / near.sum(axis=1), np.inf)
    rest = np.where(near, np.inf, ranges).min(axis=1)
    chance = rng.random((2, len(ranges)))
    thin = share < 0.5
    behind = np.where(thin & (chance[0] < 0.35), rest, front)
    mixes = (share < 1) & (chance[1] < 0.15) & (rest < front + 1.0)
    between = share * front + (1 - share) * np.where(np.isfinite(rest), rest, 0.0)
    return np.where(mixes, between, behind)
