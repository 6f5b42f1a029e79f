"""Two sources that send one transform are told apart, named, and never mixed."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tablemap.geometry import Pose2
from tablemap.recording import inspect, open_recording
from tablemap.recording.tf.tracks import Track, by_continuity
from tests.making.rewriting import (
    DIALECTS,
    SECOND,
    Change,
    Dialect,
    Entry,
    restamped,
    rewrite,
    with_edges,
)

OFFSET = Pose2(0.25, -0.15, np.radians(10.0))


def second_source(
    edge: tuple[str, str],
    *,
    later_ns: int,
    every: int = 1,
    publisher: str = "",
    grows: bool = False,
) -> Change:
    """Send every n-th sample of an edge a second time, elsewhere and a little later."""
    count = 0
    first_ns = 0

    def shifted(parent: str, child: str, stamp_ns: int, pose: Pose2) -> Pose2:
        if (parent, child) != edge:
            return pose
        share = min((stamp_ns - first_ns) / (10 * SECOND), 1.0) if grows else 1.0
        return Pose2(OFFSET.x * share, OFFSET.y * share, OFFSET.yaw * share) @ pose

    def change(entry: Entry) -> Iterable[Entry]:
        nonlocal count, first_ns
        yield entry
        if entry.topic != "/tf":
            return
        first_ns = first_ns or entry.stamp_ns
        other = with_edges(entry, shifted, alone=True)
        if other is not None and count % every == 0:
            other = restamped(other, later_ns)
            yield replace(other, log_ns=entry.log_ns + later_ns, publisher=publisher)
        count += other is not None

    return change


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("edge", [("map", "odom"), ("odom", "base_footprint")])
@pytest.mark.parametrize("publisher", ["", "/other"])
def test_two_sources_of_one_transform(
    tmp_path: Path,
    plain_recording: Path,
    dialect: Dialect,
    edge: tuple[str, str],
    publisher: str,
) -> None:
    """Two that disagree are said with edge and distance, and the one that sends most is taken.

    Whether each has a channel of its own, as in ROS 1, or both share one.
    """
    change = second_source(edge, later_ns=25_000_000, every=3, publisher=publisher)
    path = rewrite(plain_recording, tmp_path / "r.mcap", change, dialect=dialect)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        stamps = plain.pose_stamps()
        for ours, theirs in (
            (recording.fixed_from_bases(stamps), plain.fixed_from_bases(stamps)),
            (recording.odom_from_bases(stamps), plain.odom_from_bases(stamps)),
        ):
            assert ours[1].all()
            assert np.allclose(ours[0], theirs[0], atol=1e-6)
        (warning,) = recording.warnings
    assert warning.code == "accuracy.tf_conflict"
    assert f"from {edge[0]} to {edge[1]}" in warning.message
    far = re.search(r"by up to ([0-9.]+) m and ([0-9.]+) degrees", warning.message)
    assert far is not None
    assert 0.15 < float(far[1]) < 0.8  # the offset turns with the place
    assert float(far[2]) == pytest.approx(10.0, abs=1.0)  # and the turn of 25 ms
    assert warning in inspect(path).warnings


@pytest.mark.parametrize("later_ns", [0, 10_000_000])
def test_sources_that_drift_apart(tmp_path: Path, plain_recording: Path, later_ns: int) -> None:
    """Wheels and a filter of them begin alike, and are decimetres apart after ten seconds."""
    change = second_source(("odom", "base_footprint"), later_ns=later_ns, every=2, grows=True)
    path = rewrite(plain_recording, tmp_path / "r.mcap", change)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        assert [w.code for w in recording.warnings] == ["accuracy.tf_conflict"]
        stamps = plain.pose_stamps()
        poses, _ = recording.odom_from_bases(stamps)
        apart = np.linalg.norm((poses - plain.odom_from_bases(stamps)[0])[:, :2, 3], axis=1)
        # While they agree to a centimetre nobody can tell whose a sample is.
        assert np.quantile(apart, 0.9) < 0.02
        assert apart.max() < 0.10


def test_a_static_transform_beside_a_moving_one(tmp_path: Path, plain_recording: Path) -> None:
    """A launch file's static map -> odom beside a localiser's is said; the localiser's is taken."""

    def pinned(entry: Entry) -> Iterable[Entry]:
        yield entry
        if entry.topic == "/tf_static":
            message = entry.message
            edge = message.transforms[0]
            header = replace(edge.header, frame_id="map")
            extra = replace(edge, header=header, child_frame_id="odom")
            yield replace(entry, message=replace(message, transforms=[extra]))

    path = rewrite(plain_recording, tmp_path / "r.mcap", pinned)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        stamps = plain.pose_stamps()
        assert np.allclose(
            recording.fixed_from_bases(stamps)[0], plain.fixed_from_bases(stamps)[0], atol=1e-6
        )
        (warning,) = recording.warnings
        assert "from map to odom" in warning.message


def test_two_mountings_of_one_camera(tmp_path: Path, plain_recording: Path) -> None:
    """A laser that a description and a calibration put in two places, 2 cm apart, is said.

    The last value counts, and the message says so: no one of the two sent more.
    """

    def moved(parent: str, child: str, _: int, pose: Pose2) -> Pose2:
        return Pose2(pose.x + 0.02, pose.y, pose.yaw) if child.startswith("base_range") else pose

    def twice(entry: Entry) -> Iterable[Entry]:
        yield entry
        if entry.topic == "/tf_static":
            other = with_edges(entry, moved, alone=True)
            assert other is not None
            yield replace(other, log_ns=entry.log_ns + 1)

    with open_recording(rewrite(plain_recording, tmp_path / "r.mcap", twice)) as recording:
        (warning,) = recording.warnings
        assert warning.code == "accuracy.tf_conflict"
        assert "0.02 m" in warning.message
        assert "the last one was taken" in warning.message
        taken = recording.base_from_laser(recording.start_ns)
    with open_recording(plain_recording) as plain:
        given = plain.base_from_laser(plain.start_ns)
    np.testing.assert_allclose(taken[:3, 3] - given[:3, 3], [0.02, 0.0, 0.0], atol=1e-9)


def test_a_relay_that_repeats_the_transforms_is_no_conflict(
    tmp_path: Path, plain_recording: Path
) -> None:
    """What a bridge logs a second time, on another channel or 3 ms later, is the same source."""

    def relayed(entry: Entry) -> Iterable[Entry]:
        yield entry
        if entry.topic == "/tf":
            yield replace(restamped(entry, 3_000_000), log_ns=entry.log_ns + 3_000_000)
            yield replace(entry, publisher="/bridge")

    with open_recording(rewrite(plain_recording, tmp_path / "r.mcap", relayed)) as recording:
        assert recording.warnings == []


def track(x: np.ndarray, *, rate: float = 20.0) -> Track:
    """Return samples along x."""
    poses = np.zeros((len(x), 7))
    poses[:, 0], poses[:, 6] = x, 1.0
    return Track((np.arange(len(x)) / rate * SECOND).astype(np.int64), poses)


def test_jumps_and_jitter_are_one_source() -> None:
    """A localisation that jumps now and then, jitters, or is silent for a while, is no two."""
    rng = np.random.default_rng(1)
    drive = np.cumsum(np.full(600, 0.3 / 20))
    jumps = np.cumsum(rng.choice([0.0, 0.2, -0.2], 600, p=[0.9, 0.05, 0.05]))
    jitter = rng.normal(0, 0.05, 600)
    for x in (drive, drive + jumps, jumps, jitter, drive + 0.4 * jitter):
        assert len(by_continuity(track(x))) == 1
    glitch = drive.copy()
    glitch[::97] += 1.0
    assert len(by_continuity(track(glitch))) == 1


def test_three_sources_are_told_apart() -> None:
    """Three localisers that send in turn give three tracks."""
    x = 0.01 * np.arange(600) / 3
    x[1::3] += 0.5
    x[2::3] -= 0.7
    parts = by_continuity(track(x))
    assert sorted(len(part.stamps_ns) for part in parts) == [200, 200, 200]
    assert all(np.ptp(np.diff(part.poses[:, 0])) < 1e-9 for part in parts)
