"""The offset of a sensor's clock: as it is set, as the motion shows it, or none and named."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats, Ints
from tablemap.recording.channels import Stamped
from tablemap.recording.clocks import (
    SECOND_NS,
    SUSPECT_S,
    ClockDifference,
    Way,
    difference,
    offset_beside_log,
    offset_by_change,
    offset_of_stops,
    stands_at,
)
from tablemap.recording.robot_poses import RobotPoses
from tablemap.recording.tf.collector import TransformCollector
from tablemap.recording.tf.frame_roles import FrameNames
from tablemap.recording.tf.frames import TransformTree

_STEP_NS = SECOND_NS // 50
_MOST_STEPS = 50_000
_MOST_PAIRS = 600
_LONGEST_PAIR_NS = 6 * SECOND_NS // 10
_MOST_CHANGE = 0.3  # metres: a pixel that now shows another thing says no more than this

Pairs = tuple[Ints, Ints, Floats]
"""Stamps (n,) and (n,) of two messages each, and how much they differ (n,)."""


@dataclass(frozen=True, eq=False)
class ClockedSensor:
    """A sensor whose clock is compared with that of TF.

    - ``what``: its name in messages for people
    - ``frame``: its frame in TF
    - ``setting``: name of the setting for its offset
    - ``stamped``: the stamps of its messages
    - ``changes``: decodes messages and compares them in pairs
    - ``is_cheap``: whether it decodes them so fast that this is done without a suspicion
    """

    what: str
    frame: str
    setting: str
    stamped: Stamped
    changes: Callable[[], Pairs]
    is_cheap: bool = False


@dataclass(frozen=True)
class Settled:
    """The seconds to add to a sensor's stamps, and what is to be said."""

    offset_s: float
    warning: ProcessWarning | None


def settled(sensor: ClockedSensor, robot: RobotPoses, collector: TransformCollector) -> Settled:
    """Return the offset of a sensor's clock where the motion shows it, or else what is open."""
    found = difference(sensor.stamped.lags_s(), tf_lags(robot.tree, robot.names, collector))
    way = _way(robot, sensor.frame)
    if found is None or not found.is_suspect:
        return Settled(0.0, None) if way is None else _beside_log(sensor, way)
    if found.is_steady and way is not None:
        offset = _shown(sensor, way, found)
        if offset is not None and abs(offset) <= SUSPECT_S:
            return Settled(0.0, None)  # the messages take longer on their way, and no more
        if offset is not None:
            return _moved(sensor, offset, "the log and the motion show")
    if not found.is_named:
        return Settled(0.0, ProcessWarning("recording.clock", "recording", _open(sensor, found)))
    return Settled(0.0, ProcessWarning("accuracy.clock", "recording", _doubt(sensor, found)))


def span_apart(stamps_ns: Ints, poses_ns: Ints, setting: str) -> str:
    """Say how images without any pose lie to the poses, and with which setting they meet."""
    first = (int(poses_ns[0]) - int(stamps_ns[0])) / SECOND_NS
    span = (int(poses_ns[-1]) - int(poses_ns[0])) / SECOND_NS
    return (
        f"No depth image has a pose at its stamp: the poses cover {span:.1f} s, from "
        f"{first:+.1f} s after the first image. If the two clocks differ, --set "
        f"topics.{setting}=SECONDS moves the images' stamps."
    )


def compared(measured: Iterable[tuple[int, Floats]]) -> Pairs:
    """Compare each measurement (n,) with the one before it in time, if it is near enough."""
    first, second, change = [], [], []
    last: tuple[int, Floats] | None = None
    for stamp_ns, values in measured:
        values = values.ravel()
        near = last is not None and stamp_ns - last[0] <= _LONGEST_PAIR_NS
        if last is not None and near and len(values) == len(last[1]):
            both = np.isfinite(values) & np.isfinite(last[1])
            if both.any():
                first.append(last[0])
                second.append(stamp_ns)
                off = np.abs(values[both] - last[1][both])
                change.append(float(np.minimum(off, _MOST_CHANGE).mean()))
        last = stamp_ns, values
    return np.array(first, np.int64), np.array(second, np.int64), np.array(change)


def run_of(stamps_ns: Ints, most: int = _MOST_PAIRS) -> Ints:
    """Return stamps in runs of neighbours that are spread over the drive, at most so many."""
    runs = -(-len(stamps_ns) // most)
    length = 24
    kept: Ints = stamps_ns[(np.arange(len(stamps_ns)) // length) % max(runs, 1) == 0]
    return kept


def _moved(sensor: ClockedSensor, offset_s: float, shown: str) -> Settled:
    message = (
        f"The {sensor.what}'s clock is {_apart(offset_s)} that of TF, as {shown}; its stamps were "
        f"moved (--set topics.{sensor.setting}={offset_s:.3f})."
    )
    return Settled(offset_s, ProcessWarning("recording.clock", "recording", message))


def _beside_log(sensor: ClockedSensor, way: Way) -> Settled:
    """Settle a clock by the motion alone, as for a log whose times are the stamps themselves."""
    by_stops = offset_of_stops(sensor.stamped.stamps_ns, way)
    shown = "the motion shows, though the log does not"
    if by_stops is not None:
        return _moved(sensor, by_stops, shown)
    found = offset_beside_log(*sensor.changes(), way) if sensor.is_cheap else None
    if found is None:
        return Settled(0.0, None)
    if found.is_sure:
        return _moved(sensor, found.seconds, shown)
    message = (
        f"What the {sensor.what} sees does not change when TF says that the robot moves; its clock "
        f"seems to be {_apart(found.seconds)} that of TF, but other times would do nearly as well: "
        f"set the clocks (chrony, ptp), or say --set topics.{sensor.setting}={found.seconds:.1f}."
    )
    return Settled(0.0, ProcessWarning("accuracy.clock", "recording", message))


def _shown(sensor: ClockedSensor, way: Way, found: ClockDifference) -> float | None:
    """Return the offset that the motion shows, None where it shows none."""
    shown = offset_by_change(*sensor.changes(), way, about_s=found.seconds)
    if shown is not None:
        return shown.decided(found.seconds)
    stamps = sensor.stamped.stamps_ns
    if stands_at(stamps + round(found.seconds * SECOND_NS), way):
        return 0.0 if stands_at(stamps, way) else found.seconds
    return None


def tf_lags(tree: TransformTree, names: FrameNames, collector: TransformCollector) -> Floats:
    """Return the lags (n,) of the transforms that carry the base, seconds."""
    edges = tree.moving_edges(names.odom or names.fixed, names.carrier)
    lags = [collector.lags.get((edge.parent, edge.child)) for edge in edges]
    known = [each.seconds() for each in lags if each is not None]
    return max(known, key=len, default=np.zeros(0))


def _way(robot: RobotPoses, frame: str) -> Way | None:
    """Return the way of a sensor's frame by the wheels, or by the localisation without them."""
    names = robot.names
    target = names.odom or names.fixed
    edges = robot.tree.moving_edges(target, names.carrier)
    if not edges:
        return None
    first = max(int(edge.stamps_ns[0]) for edge in edges)
    last = min(int(edge.stamps_ns[-1]) for edge in edges)
    if last <= first:
        return None
    step = max(_STEP_NS, (last - first) // _MOST_STEPS)
    stamps = np.arange(first, last + 1, step, dtype=np.int64)
    return Way.of(stamps, *robot.tree.lookup(target, frame, stamps))


def _apart(offset_s: float) -> str:
    return f"{abs(offset_s):.2f} s {'behind' if offset_s > 0 else 'ahead of'}"


def _open(sensor: ClockedSensor, found: ClockDifference) -> str:
    when = "later" if found.seconds > 0 else "sooner"
    return (
        f"The {sensor.what}'s messages were logged {abs(found.seconds):.2f} s {when} after their "
        "stamps than those of TF, and the motion does not show whether its clock is off or their "
        f"way is longer; where the clock is, --set topics.{sensor.setting}={found.seconds:.3f}."
    )


def _doubt(sensor: ClockedSensor, found: ClockDifference) -> str:
    steady = "" if found.is_steady else ", and by no steady time,"
    return (
        f"The {sensor.what}'s clock seems to be {_apart(found.seconds)} that of TF{steady} by the "
        "times at which both were logged, and no motion confirms it: set the clocks (chrony, "
        f"ptp), or say --set topics.{sensor.setting}={found.seconds:.3f}."
    )
