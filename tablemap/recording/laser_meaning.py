"""What the numbers of a laser scan mean: in which unit its ranges and its angles are.

ROS asks for metres and radians (REP 103), and some drivers keep to neither. No room has walls at
two hundred metres, and no laser turns by more than a circle; which unit a range has is told by the
robot's motion: in the right one, scans from two places show one room.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.recording.laser_mount import LEAST_SHARE, Mount, agreement
from tablemap.recording.messages import LaserScan

_NO_ROOM = 80.0  # metres, of a scan's median range: lasers of robots see less far
_USUAL = 2.5  # metres
_FEWEST = 10  # different ranges of one scan: fewer are no room
_UNITS = {0.001: "millimetres", 0.01: "centimetres", 0.0254: "inches"}  # in metres
_CIRCLE = 1.02 * 2.0 * np.pi  # radians: the first and the last beam may overlap
_DEGREE = np.pi / 180.0


@dataclass(frozen=True)
class LaserMeaning:
    """How scans as recorded become metres and radians.

    - ``unit``: metres, of a range
    - ``limit_unit``: metres, of ``range_min`` and ``range_max``
    - ``end_unit``, ``step_unit``: radians, of the first and last angle, and of the angle between
      two beams; the latter is 0 where it follows from the ends
    - ``is_usable``: False where the ranges are no distances
    """

    unit: float = 1.0
    limit_unit: float = 1.0
    end_unit: float = 1.0
    step_unit: float = 1.0
    is_usable: bool = True

    def of(self, scan: LaserScan) -> LaserScan:
        """Return a recorded scan in metres and radians."""
        if self == _PLAIN:
            return scan
        first, last = scan.angle_min * self.end_unit, scan.angle_max * self.end_unit
        step = scan.angle_increment * self.step_unit
        if not self.step_unit:
            step = (last - first) / max(len(scan.ranges) - 1, 1)
        return replace(
            scan,
            angle_min=first,
            angle_max=last,
            angle_increment=step,
            range_min=scan.range_min * self.limit_unit,
            range_max=scan.range_max * self.limit_unit,
            ranges=scan.ranges * np.float32(self.unit),
        )


_PLAIN = LaserMeaning()


def is_plain(scan: LaserScan) -> bool:
    """Tell whether the numbers of a recorded scan can be metres and radians."""
    return _of_angles(scan) == _PLAIN and _middle([scan]) < _NO_ROOM


def told(
    scans: Sequence[LaserScan], bases: Floats, mount: Mount, topic: str
) -> tuple[LaserMeaning, list[ProcessWarning]]:
    """Return what a laser's numbers mean, and what is to be said of them.

    ``scans`` are as recorded, from different places; ``bases`` (n, 3) are the base's poses there.
    """
    meaning = _of_angles(scans[0])
    said = [] if meaning == _PLAIN else [_note(_angles_said(meaning, topic))]
    middle = _middle(scans)
    if middle < _NO_ROOM:
        return meaning, said
    is_limited = max(scan.range_max for scan in scans) > middle
    choices = [
        replace(meaning, unit=unit, limit_unit=unit if is_limited else 1.0) for unit in _UNITS
    ]
    shares = [agreement([each.of(scan) for scan in scans], bases, mount) for each in choices]
    seen = f"The ranges of the laser on {topic} are {middle:.0f} m in the middle, which is no room"
    if all(share is None for share in shares):
        likely = min(choices, key=lambda each: abs(np.log(middle * each.unit / _USUAL)))
        message = (
            f"{seen}; they were taken as {_UNITS[likely.unit]}, but the robot turned too little "
            "to show that they are: let the driver send metres."
        )
        return likely, [*said, ProcessWarning("accuracy.laser_meaning", "recording", message)]
    share, best = max(
        zip((share or 0.0 for share in shares), choices, strict=True), key=itemgetter(0)
    )
    if share < LEAST_SHARE:
        message = f"{seen}, and in no unit do they fit the robot's motion: it was not used."
        return replace(meaning, is_usable=False), [*said, _note(message)]
    message = f"{seen}; in {_UNITS[best.unit]} they fit the robot's motion, and were taken so."
    return best, [*said, _note(message)]


def _note(message: str) -> ProcessWarning:
    return ProcessWarning("recording.laser_meaning", "recording", message)


def _of_angles(scan: LaserScan) -> LaserMeaning:
    """Return what a scan's angles mean: beams go round once, and the ends agree with the steps."""
    ends = abs(scan.angle_max - scan.angle_min)
    steps = abs(scan.angle_increment) * (len(scan.ranges) - 1)
    if len(scan.ranges) < 2 or not np.isfinite([ends, steps]).all():
        return _PLAIN
    if steps == 0.0 and ends > 0.0:
        return replace(_of_angles(_stepped(scan)), step_unit=0.0)
    is_wide = [_CIRCLE < angle < _CIRCLE / _DEGREE for angle in (ends, steps)]
    end_unit, step_unit = (_DEGREE if wide else 1.0 for wide in is_wide)
    return LaserMeaning(end_unit=end_unit, step_unit=step_unit)


def _stepped(scan: LaserScan) -> LaserScan:
    """Return a scan with the step between beams that follows from its first and last one."""
    step = (scan.angle_max - scan.angle_min) / (len(scan.ranges) - 1)
    return replace(scan, angle_increment=step)


def _angles_said(meaning: LaserMeaning, topic: str) -> str:
    if meaning.step_unit == 0.0:
        also = " and are in degrees" if meaning.end_unit != 1.0 else ""
        return (
            f"Scans of the laser on {topic} have an angle_increment of 0: the beams' angles were "
            f"taken from angle_min and angle_max{also}."
        )
    names = []
    if meaning.end_unit != 1.0:
        names += ["angle_min", "angle_max"]
    if meaning.step_unit != 1.0:
        names += ["angle_increment"]
    return (
        f"Beams of the laser on {topic} would go round more than once: {', '.join(names)} "
        f"{'was' if len(names) == 1 else 'were'} read as degrees."
    )


def _middle(scans: Sequence[LaserScan]) -> float:
    """Return the median of the different ranges as recorded, 0 without as many as a room gives.

    A number that stands for nothing seen counts once.
    """
    ranges = np.concatenate([scan.ranges for scan in scans])
    measured = np.unique(ranges[np.isfinite(ranges) & (ranges > 0.0)])
    return float(np.median(measured)) if len(measured) >= _FEWEST else 0.0
