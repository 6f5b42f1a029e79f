"""The scans that odometry needs, chosen by the recorded motion before any of them is decoded."""

from __future__ import annotations

import math

import numpy as np

from tablemap.config import OdometryConfig, SensorsConfig
from tablemap.geometry import Bools, Floats, Ints, wrap_angle

_STANDING_EVERY = 8  # one of so many scans of a standing base is used: they are all alike
_MOST_STANDING = 4  # of one standstill, however long it lasts


def chosen_scans(
    stamps_ns: Ints,
    poses: Floats,
    known: Bools,
    localised: Bools,
    *,
    config: OdometryConfig,
    sensors: SensorsConfig,
    on_wheels: bool,
) -> Ints:
    """Return the stamps of the scans to place: those before which the base moved, and a few others.

    ``poses`` (n, 3) is the recorded motion at the scans' stamps (n,), ``known`` (n,) where it was
    recorded. The first scan also needs a ``localised`` pose. A jump of the localisation is no
    motion, but a scan after it is needed to find the base again.
    """
    begun = known & np.logical_or.accumulate(known & localised)
    turned = math.radians(config.turned_deg)
    chosen: list[int] = []
    last: tuple[int, float, float, float] | None = None
    standing = here = 0
    for stamp, (x, y, yaw) in zip(stamps_ns[begun].tolist(), poses[begun].tolist(), strict=True):
        if last is not None:
            far = math.hypot(x - last[1], y - last[2])
            turn = abs(wrap_angle(yaw - last[3]))
            seconds = (stamp - last[0]) * 1e-9
            jumped = not on_wheels and is_jump(far, turn, seconds, sensors)
            if far > config.moved or turn > turned or jumped:
                here = 0
            else:
                standing += 1
                if standing % _STANDING_EVERY or here >= _MOST_STANDING:
                    continue
                here += 1
        chosen.append(stamp)
        last = stamp, x, y, yaw
    return np.array(chosen, dtype=np.int64)


def is_jump(far: float, turn: float, seconds: float, sensors: SensorsConfig) -> bool:
    """Tell whether a base cannot have moved so far (metres, radians) in so short a time."""
    # Two centimetres and half a degree: a localisation may jitter by so much between two scans.
    fastest = sensors.localisation_jump_turn_deg_odometry
    return (
        far > sensors.localisation_jump_speed * seconds + 0.02
        or math.degrees(turn) > fastest * seconds + 0.5
    )
