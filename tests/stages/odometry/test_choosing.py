"""The scans that odometry places, by the recorded motion alone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from tablemap.config import OdometryConfig, SensorsConfig
from tablemap.geometry import Floats, Ints
from tablemap.recording.messages import LaserScan
from tablemap.stages.odometry.choosing import chosen_scans
from tests.making.registered_laps import estimated
from tests.making.rooms import Drive, room

RATE_HZ = 20


def chosen(poses: Floats, *, on_wheels: bool = True, unknown: int = 0) -> Ints:
    """Choose among scans at 20 Hz; the first ``unknown`` have no localised pose."""
    stamps = (np.arange(len(poses)) * 1e9 / RATE_HZ).astype(np.int64)
    everywhere = np.ones(len(poses), dtype=bool)
    return chosen_scans(
        stamps,
        poses,
        everywhere,
        np.arange(len(poses)) >= unknown,
        config=OdometryConfig(),
        sensors=SensorsConfig(),
        on_wheels=on_wheels,
    )


def straight(seconds: float, *, speed: float) -> Floats:
    """Return the poses (n, 3) of a base that drives straight on."""
    poses = np.zeros((int(seconds * RATE_HZ), 3))
    poses[:, 0] = speed * np.arange(len(poses)) / RATE_HZ
    return poses


@pytest.mark.parametrize("seconds", [10, 1000])
def test_a_standing_base_needs_a_few_scans_however_long_it_stands(seconds: int) -> None:
    """They are all alike."""
    assert 2 <= len(chosen(straight(seconds, speed=0.0))) <= 6


@pytest.mark.parametrize("seconds", [10, 30, 90, 270])
def test_the_number_follows_the_way_and_not_the_time(seconds: int) -> None:
    """A slow drive of nine metres needs about as many scans as a fast one."""
    number = len(chosen(straight(seconds, speed=9 / seconds)))
    assert 200 <= number <= 1.5 * 9 / OdometryConfig().moved


def test_the_first_scan_has_a_localised_pose() -> None:
    """The odometry begins where the localisation put the base."""
    assert chosen(straight(10, speed=0.3), unknown=40)[0] == 2_000_000_000


def test_a_jump_of_the_localisation_is_followed_by_a_scan() -> None:
    """Without wheels the base may have moved; with them, so large a step is a motion anyway."""
    poses = straight(1, speed=0.0)
    poses[10:, 0] += 0.5
    assert 500_000_000 in chosen(poses, on_wheels=False)
    assert 500_000_000 in chosen(poses)


def test_only_chosen_scans_are_decoded() -> None:
    """A base that stands for long costs no more than one that stands for a moment."""

    class Counted(Drive):
        """A drive that counts the scans that were asked for."""

        asked = 0

        def scans(self, *span: int, stamps_ns: Ints | None = None) -> Iterator[LaserScan]:
            """Count and yield."""
            for scan in super().scans(*span, stamps_ns=stamps_ns):
                self.asked += 1
                yield scan

    drive = Counted(room(1), seed=1, stops=3, standing_s=6.0, rate_hz=10)
    odometry = estimated(drive)
    assert drive.asked == odometry.scans_used
    assert odometry.scans_used + odometry.scans_skipped == len(drive.stamps)
    moving = Counted(room(1), seed=1, stops=3, standing_s=0.6, rate_hz=10)
    assert odometry.scans_used <= estimated(moving).scans_used + 3 * 4
