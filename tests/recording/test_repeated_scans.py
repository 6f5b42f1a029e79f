"""What a hung driver sends again is left out, and what a robot that stands sees again is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tablemap.recording import open_recording
from tablemap.recording.silence import repeated_elsewhere
from tests.making.rewriting import (
    DIALECTS,
    Change,
    Dialect,
    Entry,
    depth_of,
    edit,
    restamped,
    rewrite,
    with_depth,
)

SECOND = 1_000_000_000
Read = Callable[[Entry], np.ndarray | None]
Write = Callable[[Entry, np.ndarray], Entry]


def poses(*places: tuple[float, float]) -> np.ndarray:
    """Return (n, 4, 4) poses at x in metres and yaw in degrees."""
    made = np.tile(np.eye(4), (len(places), 1, 1))
    for pose, (x, yaw_deg) in zip(made, places, strict=True):
        yaw = np.radians(yaw_deg)
        pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
        pose[0, 3] = x
    return made


@pytest.mark.parametrize("last", [(0.4, 0.0), (0.0, 30.0), (0.0, -179.0)])
def test_what_is_said_again_from_elsewhere_is_old(last: tuple[float, float]) -> None:
    """It has the number of the message that it repeats; what was said at the first place stays."""
    way = poses((0.0, 0.0), (0.001, 0.0), (0.02, 0.0), last, (1.0, 0.0))
    repeats = repeated_elsewhere(np.array([7, 7, 7, 7, 9]), way, np.ones(5, bool))
    assert repeats.tolist() == [-1, -1, 0, 0, -1]


def test_a_robot_that_stands_may_see_the_same_again() -> None:
    """As with a simulated laser without noise, with poses that jitter by centimetres or not."""
    for way in (poses(*[(0.0, 0.0)] * 4), poses((0.0, 0.0), (0.02, 0.5), (0.0, -0.5), (0.03, 0.0))):
        assert (repeated_elsewhere(np.array([7, 7, 7, 7]), way, np.ones(4, bool)) == -1).all()


def test_where_no_pose_is_known_nothing_is_old() -> None:
    """Motion cannot be told there; an old scan may come long after the first."""
    way = poses((0.0, 0.0), (5.0, 0.0), (0.0, 0.0), (5.0, 0.0))
    known = np.array([True, False, True, True])
    assert repeated_elsewhere(np.array([7, 7, 8, 7]), way, known).tolist() == [-1, -1, -1, 0]
    assert len(repeated_elsewhere(np.zeros(0, int), np.zeros((0, 4, 4)), np.zeros(0, bool))) == 0


def hung(first_ns: int, last_ns: int, values_of: Read, with_values: Write) -> Change:
    """Let a sensor repeat its values from one stamp to another."""
    held: list[np.ndarray] = []

    def change(entry: Entry) -> Iterable[Entry]:
        values = values_of(entry)
        if values is not None:
            if first_ns <= entry.stamp_ns <= last_ns:
                held.append(values)
                values = held[0]
            entry = with_values(entry, values)
        return [entry]

    return change


def ranges_of(entry: Entry) -> np.ndarray | None:
    """Return the ranges of a scan; None of other messages."""
    return entry.message.ranges if entry.type == "LaserScan" else None


def with_ranges(entry: Entry, ranges: np.ndarray) -> Entry:
    """Return a scan with other ranges."""
    return edit(entry, ranges=ranges)


def values_of_depth(entry: Entry) -> np.ndarray | None:
    """Return the values of a depth image; None of other messages."""
    return depth_of(entry) if entry.is_depth else None


@pytest.mark.parametrize("dialect", DIALECTS)
def test_scans_of_a_driver_that_hung_are_left_out(
    tmp_path: Path, plain_recording: Path, dialect: Dialect
) -> None:
    """Those of eight seconds with a stop in them; it is said once, with their number."""
    with open_recording(plain_recording) as plain:
        stamps = plain.scan_stamps()
        begin = int(stamps[0]) + 10 * SECOND
        odom, _ = plain.odom_from_bases(stamps)
    end = begin + 8 * SECOND
    change = hung(begin, end, ranges_of, with_ranges)
    path = rewrite(plain_recording, tmp_path / "r.mcap", change, dialect=dialect)
    with open_recording(path) as recording:
        (warning,) = recording.warnings
        left = recording.scan_stamps()
        assert [scan.stamp_ns for scan in recording.scans()] == left.tolist()
    assert warning.code == "recording.silent_sensor"
    during = (stamps >= begin) & (stamps <= end)
    far = np.linalg.norm(odom[:, :2, 3] - odom[np.argmax(during), :2, 3], axis=1) > 0.01
    assert not np.isin(stamps[during & far], left).any()
    assert np.isin(stamps[~during], left).all()
    assert f"{len(stamps) - len(left)} of {len(stamps)} scans were left out" in warning.message


def without_noise(places: dict[int, tuple[int, ...]]) -> Change:
    """Measure the same at the same place, as simulated lasers do; ``places`` are by stamp."""
    seen: dict[tuple[int, ...], np.ndarray] = {}

    def change(entry: Entry) -> Iterable[Entry]:
        if entry.type == "LaserScan":
            ranges = seen.setdefault(places[entry.stamp_ns], entry.message.ranges)
            entry = edit(entry, ranges=ranges)
        return [entry]

    return change


def test_equal_scans_of_a_standing_robot_are_kept(tmp_path: Path, plain_recording: Path) -> None:
    """Without noise the scans of a stop are the same, and nothing is said."""
    with open_recording(plain_recording) as plain:
        stamps = plain.scan_stamps()
        odom, _ = plain.odom_from_bases(stamps)
    millimetres = np.round(1e3 * odom[:, :2].reshape(len(odom), -1)).astype(int)
    places = dict(zip(stamps.tolist(), map(tuple, millimetres.tolist()), strict=True))
    assert len(set(places.values())) < 0.9 * len(places)
    path = rewrite(plain_recording, tmp_path / "r.mcap", without_noise(places))
    with open_recording(path) as recording:
        assert recording.warnings == []
        assert np.array_equal(recording.scan_stamps(), stamps)
        alike = [scan.ranges.tobytes() for scan in recording.scans()]
    assert len(set(alike)) < 0.9 * len(alike)


ROS: tuple[Dialect, ...] = ("ros1", "ros2")


@pytest.mark.parametrize("dialect", ROS)
def test_depth_images_that_a_driver_sends_again_are_left_out(
    tmp_path: Path, plain_recording: Path, dialect: Dialect
) -> None:
    """Those of later stops that show what the third stop showed; it is said once."""
    with open_recording(plain_recording) as plain:
        stamps = plain.depth_stamps()
    change = hung(int(stamps[2]), int(stamps[4]), values_of_depth, with_depth)
    path = rewrite(plain_recording, tmp_path / "r.mcap", change, dialect=dialect)
    with open_recording(path) as recording:
        (warning,) = recording.warnings
        assert recording.depth_stamps().tolist() == np.delete(stamps, [3, 4]).tolist()
    assert warning.code == "recording.silent_sensor"
    assert f"2 of {len(stamps)} images were left out" in warning.message


def test_equal_depth_of_a_standing_robot_is_kept(tmp_path: Path, plain_recording: Path) -> None:
    """An image that comes again at its own stop, without noise, is as good as the first."""

    def again(entry: Entry) -> Iterable[Entry]:
        yield entry
        if entry.is_depth:
            yield replace(restamped(entry, 1_000_000), log_ns=entry.log_ns + 1_000_000)

    path = rewrite(plain_recording, tmp_path / "r.mcap", again)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        assert recording.warnings == []
        assert len(recording.depth_stamps()) == 2 * len(plain.depth_stamps())
