"""Which part of a turn of its laser a scan took is believed only where it is clear."""

from __future__ import annotations

import numpy as np
import pytest

from tablemap.geometry import Pose2
from tablemap.recording.messages import LaserScan
from tablemap.stages.odometry import as_turning, sweep_motion
from tablemap.stages.registration.laser.sweep import told_share

SPEED = 0.4  # metres a second


def scan(time_increment: float) -> LaserScan:
    """Make a scan of half a turn."""
    beams = 181
    return LaserScan(
        stamp_ns=2_000_000_000,
        frame_id="laser",
        angle_min=-np.pi / 2,
        angle_max=np.pi / 2,
        angle_increment=np.pi / (beams - 1),
        time_increment=time_increment,
        scan_time=0.0,
        range_min=0.1,
        range_max=10.0,
        ranges=np.full(beams, 2.0, dtype=np.float32),
    )


def base_at(stamp_ns: int) -> Pose2:
    """Drive straight ahead."""
    return Pose2(SPEED * stamp_ns * 1e-9, 0.0, 0.0)


@pytest.mark.parametrize("seconds", [0.1, -0.1, 0.0])
def test_the_motion_of_a_sweep_has_the_sign_of_its_time(seconds: float) -> None:
    """A driver that turns the order of the beams round says a negative time_increment."""
    motion, duration = sweep_motion(scan(seconds / 180), base_at)
    assert duration == pytest.approx(seconds)
    if seconds:
        assert motion is not None
        assert motion.x == pytest.approx(SPEED * seconds)
    else:
        assert motion is None


def test_a_laser_that_turns_takes_half_its_time_for_half_a_turn() -> None:
    """The time from scan to scan is that of a whole turn."""
    assert as_turning(scan(0.0), 0.2).sweep_seconds == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("found", "taken", "expected"),
    [
        (None, 0.0, 0.0),
        ((0.5, 0.05), 0.0, 0.5),
        ((-0.5, 0.05), 0.0, -0.5),
        ((0.5, 0.2), 0.0, 0.0),  # not clear
        ((0.05, 0.001), 0.0, 0.0),  # clear, and too small to matter
        ((0.05, 0.02), 0.5, 0.05),  # brings to an end what began
        ((0.02, 0.001), 0.5, 0.0),
        ((1.4, 0.01), 0.5, 0.0),  # no laser takes longer than a turn
    ],
)
def test_only_a_clear_share_is_taken(
    found: tuple[float, float] | None, taken: float, expected: float
) -> None:
    """The first step must be clear, the next ones may be small."""
    assert told_share(found, taken) == expected
