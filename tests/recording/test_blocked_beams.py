"""Beams of the laser that meet the robot itself are left out, and said."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tablemap.recording import open_recording
from tablemap.recording.blocked import blocked
from tablemap.recording.messages import LaserScan
from tablemap.stages.legs.scans import _cleaned
from tests.making.rewriting import Change, Entry, edit, rewrite


def shelled(low_deg: float, high_deg: float, *, at: float) -> Change:
    """Return what puts a part of the robot, rough by a centimetre, before some beams."""
    rng = np.random.default_rng(0)

    def change(entry: Entry) -> Iterable[Entry]:
        if entry.type != "LaserScan":
            return [entry]
        scan = entry.message
        angles = np.degrees(scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges)))
        inside = (angles > low_deg) & (angles < high_deg)
        part = at + rng.normal(0, 0.005, len(angles))
        ranges = np.where(inside, part, scan.ranges).astype(np.float32)
        return [edit(entry, ranges=ranges)]

    return change


@pytest.mark.parametrize(("low", "high"), [(60.0, 180.0), (-38.0, -30.0)], ids=["shell", "post"])
def test_the_robots_own_parts_are_left_out(
    tmp_path: Path, plain_recording: Path, low: float, high: float
) -> None:
    """All beams that meet it read minus infinity in every scan, and the others as before."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", shelled(low, high, at=0.25))
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        (warning,) = recording.warnings
        assert warning.code == "recording.own_body"
        assert "0.25 m" in warning.message
        for ours, theirs in zip(recording.scans(), plain.scans(), strict=True):
            degrees = np.degrees(ours.angles)
            assert np.isneginf(ours.ranges[(degrees > low) & (degrees < high)]).all()
            outside = (degrees < low - 2) | (degrees > high + 2)
            np.testing.assert_array_equal(ours.ranges[outside], theirs.ranges[outside])


def test_what_is_near_now_and_then_is_a_thing_of_the_room() -> None:
    """A table's leg that half of the scans see near by is not the robot."""
    scans = [_scan(near=range(10, 40) if i % 2 else range(50, 60)) for i in range(20)]
    assert blocked(scans) is None


def test_few_places_tell_nothing() -> None:
    """In five scans a wall may stay at one distance by chance."""
    assert blocked([_scan(near=range(10, 40)) for _ in range(5)]) is None
    assert blocked([_scan(near=range(10, 40)) for _ in range(6)]) is not None


def test_behind_the_robots_own_part_nothing_is_known_to_be_free() -> None:
    """Where a driver has no infinity for nothing seen, minus infinity stays unknown."""
    scan = _scan(near=range(10, 40))
    own = blocked([scan] * 6)
    assert own is not None
    nothing = np.where(np.arange(100) > 90, 0.0, own.removed(scan).ranges)
    cleaned = _cleaned(replace(scan, ranges=nothing.astype(np.float32))).ranges
    assert np.isnan(cleaned[9:41]).all()
    assert np.isinf(cleaned[92:]).all()


def _scan(near: range) -> LaserScan:
    ranges = np.full(100, 3.0, dtype=np.float32)
    ranges[near] = 0.3
    return LaserScan(
        stamp_ns=0,
        frame_id="laser",
        angle_min=-1.0,
        angle_max=0.98,
        angle_increment=0.02,
        time_increment=0.0,
        scan_time=0.0,
        range_min=0.05,
        range_max=20.0,
        ranges=ranges,
    )
