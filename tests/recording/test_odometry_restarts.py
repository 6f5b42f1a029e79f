"""Wheel odometry that starts again under way is joined, and is no motion."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tablemap.geometry import Pose2
from tablemap.recording import Recording, open_recording
from tests.making.rewriting import DIALECTS, SECOND, Change, Dialect, Entry, rewrite, with_edges


def restarted(
    source: Path, *seconds: float, answer_s: float = 0.0, silent_s: float = 0.0, localised: bool
) -> Change:
    """Let the odometry start again so many seconds after the begin.

    The localisation makes up for it ``answer_s`` later. The node is silent for ``silent_s`` before.
    Without ``localised`` nothing but the odometry is recorded.
    """
    with open_recording(source) as plain:
        begins = [plain.start_ns + round(each * SECOND) for each in seconds]
        starts = [Pose2.projected(plain.odom_from_base(each)) for each in begins]  # type: ignore[arg-type]

    def moved(parent: str, child: str, stamp_ns: int, pose: Pose2) -> Pose2 | None:
        late = round(answer_s * SECOND) if parent == "map" else 0
        times = sum(stamp_ns >= begin + late for begin in begins)
        if parent == "map" and child == "odom":
            return (pose @ starts[times - 1] if times else pose) if localised else None
        if parent == "odom":
            if any(0 < begin - stamp_ns < silent_s * SECOND for begin in begins):
                return None
            return starts[times - 1].inverse() @ pose if times else pose
        return pose

    def change(entry: Entry) -> Iterable[Entry]:
        changed = with_edges(entry, moved) if entry.type == "TFMessage" else entry
        return [] if changed is None else [changed]

    return change


def far_off(recording: Recording, plain: Recording, *, fixed: bool) -> np.ndarray:
    """Return how far poses lie from those of the plain recording, (n,) metres; all are known."""
    stamps = plain.pose_stamps()
    look_up = "fixed_from_bases" if fixed else "odom_from_bases"
    ours, theirs = (getattr(each, look_up)(stamps) for each in (recording, plain))
    assert ours[1].all()
    return np.linalg.norm((ours[0] - theirs[0])[:, :3, 3], axis=1)


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("answer_s", [0.0, 1.5])
def test_the_localisation_makes_up_for_it(
    tmp_path: Path, plain_recording: Path, dialect: Dialect, answer_s: float
) -> None:
    """All poses are those of the drive without the restart, also before the localisation's answer.

    The join adds the millimetres that the speed changes within one sample.
    """
    change = restarted(plain_recording, 12.3, answer_s=answer_s, localised=True)
    path = rewrite(plain_recording, tmp_path / "r.mcap", change, dialect=dialect)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        (warning,) = recording.warnings
        assert warning.code == "recording.odometry_restart"
        assert warning.stamp_ns is not None
        assert abs(warning.stamp_ns - plain.start_ns - 12.3 * SECOND) < 0.1 * SECOND
        assert far_off(recording, plain, fixed=False).max() < 0.01
        assert far_off(recording, plain, fixed=True).max() < 0.02


def test_it_starts_again_twice(tmp_path: Path, plain_recording: Path) -> None:
    """Each restart is joined to what was joined before."""
    change = restarted(plain_recording, 8.1, 19.4, localised=True)
    path = rewrite(plain_recording, tmp_path / "r.mcap", change)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        (warning,) = recording.warnings
        assert "starts again 2 times" in warning.message
        assert far_off(recording, plain, fixed=False).max() < 0.01
        assert far_off(recording, plain, fixed=True).max() < 0.02


def test_wheels_alone(tmp_path: Path, plain_recording: Path) -> None:
    """Without a localisation the odometry's own origin tells a restart."""
    path = rewrite(
        plain_recording, tmp_path / "r.mcap", restarted(plain_recording, 12.3, localised=False)
    )
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        assert recording.names.fixed == "odom"
        assert [each.code for each in recording.warnings] == ["recording.odometry_restart"]
        assert far_off(recording, plain, fixed=False).max() < 0.01


def test_a_silence_before_it(tmp_path: Path, plain_recording: Path) -> None:
    """After seconds of silence the localisation tells the motion; without one it is doubted."""
    silent = {"silent_s": 3.0}
    for localised, code in ((True, "recording"), (False, "accuracy")):
        change = restarted(plain_recording, 12.3, **silent, localised=localised)  # type: ignore[arg-type]
        path = rewrite(plain_recording, tmp_path / "r.mcap", change)
        with open_recording(plain_recording) as plain, open_recording(path) as recording:
            restarts = [each for each in recording.warnings if "restart" in each.code]
            assert [each.code for each in restarts] == [f"{code}.odometry_restart"]
            if localised:
                after = plain.start_ns + 13 * SECOND
                ours, theirs = (each.fixed_from_base(after) for each in (recording, plain))
                assert ours is not None
                assert theirs is not None
                assert np.linalg.norm((ours - theirs)[:3, 3]) < 1e-6
            else:
                assert "for 3." in restarts[0].message


def test_a_jump_of_the_localisation_is_no_restart(tmp_path: Path, plain_recording: Path) -> None:
    """A correction of 60 cm leaves the odometry as it was, and says nothing of it."""
    with open_recording(plain_recording) as plain:
        begin = plain.start_ns + 12 * SECOND

    def corrected(entry: Entry) -> Iterable[Entry]:
        def moved(parent: str, child: str, stamp_ns: int, pose: Pose2) -> Pose2:
            late = parent == "map" and child == "odom" and stamp_ns > begin
            return replace(pose, x=pose.x + 0.6) if late else pose

        changed = with_edges(entry, moved) if entry.type == "TFMessage" else entry
        return [] if changed is None else [changed]

    path = rewrite(plain_recording, tmp_path / "r.mcap", corrected)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        assert recording.warnings == []
        assert far_off(recording, plain, fixed=False).max() < 1e-9
