"""Corrections of the odometry that come rarely, or not all the time: the wheels carry them on."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest

from tablemap.geometry import Pose2, planar
from tablemap.recording import open_recording
from tests.making.rewriting import SECOND, Change, Entry, rewrite, with_edges

Sent = list[tuple[int, Pose2]]


def localised(is_sent: Callable[[float], bool], sent: Sent, *, every: float = 0.0) -> Change:
    """Send ``map -> odom`` at some seconds of the drive only, and note in ``sent`` what was."""
    begin: list[int] = []

    def moved(parent: str, child: str, stamp_ns: int, pose: Pose2) -> Pose2 | None:
        if child != "odom":
            return pose
        begin.append(stamp_ns)
        late = not sent or stamp_ns - sent[-1][0] >= every * SECOND
        if not (late and is_sent((stamp_ns - begin[0]) / SECOND)):
            return None
        sent.append((stamp_ns, pose))
        return pose

    def change(entry: Entry) -> Iterable[Entry]:
        changed = with_edges(entry, moved) if entry.type == "TFMessage" else entry
        return [] if changed is None else [changed]

    return change


@pytest.mark.parametrize(
    ("is_sent", "every", "first"),
    [
        (lambda _: True, 10.0, 2),
        (lambda second: second > 12, 0.0, 0),
        (lambda second: second < 12, 0.0, 12),
        (lambda second: second < 8 or second > 20, 0.0, 8),
    ],
    ids=["rare", "starts late", "ends early", "a gap"],
)
def test_the_wheels_carry_it_on(
    tmp_path: Path,
    plain_recording: Path,
    is_sent: Callable[[float], bool],
    every: float,
    first: float,
) -> None:
    """Every image has a pose: the correction before (at the begin the first), times the wheels'."""
    sent: Sent = []
    path = rewrite(plain_recording, tmp_path / "r.mcap", localised(is_sent, sent, every=every))
    with open_recording(path) as recording:
        stamps = recording.depth_stamps()
        poses, known = recording.fixed_from_bases(stamps)
        wheels = planar(recording.odom_from_bases(stamps)[0])
        (warning,) = recording.warnings
    assert known.all()
    assert warning.code == "recording.localisation_gap"
    assert "map to odom" in warning.message
    when = np.array([stamp_ns for stamp_ns, _ in sent])
    # Between samples that are near or agree it is interpolated, as ever.
    for stamp, pose, wheel in zip(stamps, planar(poses), wheels, strict=True):
        last = max(int(np.searchsorted(when, stamp, side="right")) - 1, 0)
        expected = [sent[i][1] @ Pose2(*wheel) for i in (last, min(last + 1, len(sent) - 1))]
        apart = [np.hypot(pose[0] - each.x, pose[1] - each.y) for each in expected]
        assert min(apart) < 0.03


def test_between_two_corrections_that_differ_the_earlier_one_is_taken(
    tmp_path: Path, plain_recording: Path
) -> None:
    """A jump of the localisation is a jump, and no slow motion of the standing robot."""
    sent: Sent = []

    def jumped(parent: str, child: str, stamp_ns: int, pose: Pose2) -> Pose2 | None:
        return Pose2(pose.x + 0.3 * len(sent), pose.y, pose.yaw) if child == "odom" else pose

    def change(entry: Entry) -> Iterable[Entry]:
        changed = with_edges(entry, jumped) if entry.type == "TFMessage" else entry
        return [] if changed is None else [changed]

    rare = localised(lambda _: True, sent, every=10.0)
    path = rewrite(plain_recording, tmp_path / "r.mcap", rare, change)
    with open_recording(path) as recording:
        first, second = (stamp_ns for stamp_ns, _ in sent[:2])
        inside = np.linspace(first + SECOND, second - SECOND, 5).astype(np.int64)
        corrections, known = recording.tree.lookup("map", "odom", inside)
    assert known.all()
    np.testing.assert_allclose(corrections, corrections[:1].repeat(5, axis=0), atol=1e-12)
