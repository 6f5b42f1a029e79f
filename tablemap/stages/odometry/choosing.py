"""The scans that odometry needs, chosen by the recorded motion before any of them is decoded."""

from __future__ import annotations

import math

import numpy as np

from tablemap.config import OdometryConfig, SensorsConfig
from tablemap.geometry import Bools, Floats, Ints, wrap_angle, wrap_angles

_STILL_SPEED, _STILL_TURN = 0.02, math.radians(2.0)  # metres and radians a second
_WITHOUT_WHEELS = 1 / 4  # of the motion between two scans: the localisation predicts it poorly


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
    """Return the stamps of the scans to place: those before which the base moved.

    Of each standstill these are the first and the last scan: the poses between are interpolated.
    ``poses`` (n, 3) is the recorded motion at the scans' stamps (n,), ``known`` (n,) where it was
    recorded. The first scan also needs a ``localised`` pose. A jump of the localisation is no
    motion, but a scan after it is needed to find the base again.
    """
    begun = known & np.logical_or.accumulate(known & localised)
    share = 1.0 if on_wheels else _WITHOUT_WHEELS
    moved, turned = share * config.moved, share * math.radians(config.turned_deg)
    stands = _standing(stamps_ns[begun], poses[begun], on_wheels=on_wheels)
    chosen: list[int] = []
    last: tuple[int, float, float, float] | None = None
    rested: int | None = None
    is_at_rest = False
    for stamp, (x, y, yaw), stood in zip(
        stamps_ns[begun].tolist(), poses[begun].tolist(), stands.tolist(), strict=True
    ):
        if last is not None:
            far = math.hypot(x - last[1], y - last[2])
            turn = abs(wrap_angle(yaw - last[3]))
            seconds = (stamp - last[0]) * 1e-9
            jumped = not on_wheels and is_jump(far, turn, seconds, sensors)
            if far > moved or turn > turned or jumped:
                if rested is not None:
                    chosen.append(rested)
            elif not stood or is_at_rest:
                rested = stamp if stood else rested
                continue
        chosen.append(stamp)
        last = stamp, x, y, yaw
        rested, is_at_rest = None, stood
    if rested is not None:
        chosen.append(rested)
    return np.array(chosen, dtype=np.int64)


def _standing(stamps_ns: Ints, poses: Floats, *, on_wheels: bool) -> Bools:
    """Return at which stamps (n,) the base stood, as far as is known.

    Without wheels that is not known: the localisation also moves where the base stands.
    """
    if not on_wheels or len(stamps_ns) < 2:
        return np.ones(len(stamps_ns), dtype=bool)
    seconds = np.maximum(np.diff(stamps_ns), 1) * 1e-9
    steps = np.diff(poses, axis=0)
    speed = np.hypot(steps[:, 0], steps[:, 1]) / seconds
    turn = np.abs(wrap_angles(steps[:, 2])) / seconds
    still = (speed < _STILL_SPEED) & (turn < _STILL_TURN)
    return np.concatenate([still[:1], still])


def is_jump(far: float, turn: float, seconds: float, sensors: SensorsConfig) -> bool:
    """Tell whether a base cannot have moved so far (metres, radians) in so short a time."""
    # Two centimetres and half a degree: a localisation may jitter by so much between two scans.
    fastest = sensors.localisation_jump_turn_deg_odometry
    return (
        far > sensors.localisation_jump_speed * seconds + 0.02
        or math.degrees(turn) > fastest * seconds + 0.5
    )
