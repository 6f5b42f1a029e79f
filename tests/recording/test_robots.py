"""Several robots in one recording: the camera's own is taken, with its laser, and said."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tablemap.config import TopicsConfig
from tablemap.errors import RecordingError
from tablemap.geometry import Pose2
from tablemap.recording import Recording, inspect, open_recording
from tests.making.rewriting import (
    DIALECTS,
    Change,
    Dialect,
    Entry,
    reframed,
    rewrite,
    with_edges,
)

ELSEWHERE = Pose2(2.0, -1.0, 1.0)


def is_robots(entry: Entry) -> bool:
    """Tell whether the second robot logs this too: poses and scans, and no images."""
    return entry.type in ("TFMessage", "LaserScan")


def driven_elsewhere(entry: Entry) -> Entry:
    """Return the second robot's: it is in another place, and its laser sees something else."""
    if entry.type == "LaserScan":
        return replace(entry, message=replace(entry.message, ranges=entry.message.ranges * 0.7))

    def moved(parent: str, child: str, _: int, pose: Pose2) -> Pose2:
        return ELSEWHERE @ pose if (parent, child) == ("map", "odom") else pose

    return with_edges(entry, moved) or entry


def by_topic(own: str, *, camera: str | None = None) -> Change:
    """Put two robots with equal frame names in namespaces, the one with the camera in ``own``."""
    other = "/robot2" if own != "/robot2" else "/robot1"

    def change(entry: Entry) -> Iterable[Entry]:
        if is_robots(entry):
            yield replace(driven_elsewhere(entry), topic=f"{other}{entry.topic}")
            yield replace(entry, topic=f"{own}{entry.topic}")
        else:
            yield replace(entry, topic=f"{own if camera is None else camera}{entry.topic}")

    return change


def by_prefix(entry: Entry) -> Iterable[Entry]:
    """Let two robots share one /tf, each with a prefix; the second one has the camera."""

    def named(robot: str) -> Callable[[str], str]:
        return lambda frame: frame if frame == "map" else f"{robot}/{frame}"

    if is_robots(entry):
        first = reframed(driven_elsewhere(entry), named("a_robot"))
        yield first if entry.type == "TFMessage" else replace(first, topic="/a_robot/base_scan")
    second = reframed(entry, named("robot1"))
    yield second if entry.type == "TFMessage" else replace(second, topic=f"/robot1{entry.topic}")


def assert_same(recording: Recording, plain: Recording) -> None:
    """Check that poses and scans are those of the robot with the camera."""
    stamps = plain.pose_stamps()
    poses, known = recording.fixed_from_bases(stamps)
    assert known.all()
    assert np.allclose(poses, plain.fixed_from_bases(stamps)[0], atol=1e-9)
    for ours, theirs in zip(recording.scans(), plain.scans(), strict=True):
        assert np.allclose(ours.ranges, theirs.ranges)
    assert len(list(recording.depth_frames())) == len(plain.depth_stamps())


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("own", ["/robot1", "/robot2"])
def test_robots_with_topics_of_their_own(
    tmp_path: Path, plain_recording: Path, dialect: Dialect, own: str
) -> None:
    """Two robots send equal frames: those in the camera's namespace are taken, and it is said."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", by_topic(own), dialect=dialect)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        assert_same(recording, plain)
        (warning,) = recording.warnings
    assert warning.code == "recording.topic_choice"
    assert f"the transforms of {own} were taken" in warning.message
    info = inspect(path)
    assert warning in info.warnings
    assert not info.missing


def test_camera_in_no_robots_namespace(tmp_path: Path, plain_recording: Path) -> None:
    """Where nothing tells whose the camera is, the sentence asks; the setting answers."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", by_topic("/robot2", camera="/eye"))
    with pytest.raises(RecordingError, match=r"/robot1, /robot2.*topics\.robot=NAME"):
        open_recording(path)
    assert any("topics.robot" in each for each in inspect(path).missing)
    given = TopicsConfig(robot="robot2")
    with (
        open_recording(plain_recording) as plain,
        open_recording(path, topics=given) as recording,
    ):
        assert_same(recording, plain)
    with pytest.raises(RecordingError, match=r"'robot3'.*/robot1, /robot2"):
        open_recording(path, topics=TopicsConfig(robot="robot3"))


@pytest.mark.parametrize("dialect", DIALECTS)
def test_robots_that_share_one_tree(
    tmp_path: Path, plain_recording: Path, dialect: Dialect
) -> None:
    """Robots with prefixed frames below one map: the base and the laser are the camera's own."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", by_prefix, dialect=dialect)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        assert recording.names.base == "robot1/base_footprint"
        assert recording.names.odom == "robot1/odom"
        assert recording.names.laser == "robot1/base_range_sensor_link"
        assert_same(recording, plain)
        assert any("a_robot" in each.message for each in recording.warnings)


def test_unknown_robot_is_refused(tmp_path: Path, plain_recording: Path) -> None:
    """A robot that has no camera is answered with the depth topics that there are."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", by_prefix)
    with pytest.raises(RecordingError, match=r"robot 'a_robot'.*/robot1/.*depth"):
        open_recording(path, topics=TopicsConfig(robot="a_robot"))
