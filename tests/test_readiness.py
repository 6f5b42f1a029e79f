"""What ``info`` says of each role: missing, weak or fine, and why."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tablemap.readiness import inspect
from tests.making import messages as w
from tests.making.command import tablemap_here

SECOND = w.SECOND


def said(recording: Path) -> dict[str, tuple[str, str]]:
    """The state and the words of each role."""
    return {each.role: (each.state, each.says) for each in inspect(recording).fitness}


def test_a_good_lap_is_fine(demo_recording: Path) -> None:
    """In every role, with the figures that say so."""
    roles = said(demo_recording)
    assert {state for state, _ in roles.values()} == {"fine"}
    assert list(roles) == [
        "depth",
        "calibration",
        "localisation",
        "stops",
        "laser",
        "odometry",
        "clocks",
    ]
    assert roles["stops"][1].startswith("8 stops, at most 50 degrees apart")
    assert roles["laser"][1].startswith("451 scans of 241 degrees, ")
    assert roles["depth"][1].startswith("16 images of 640 x 480, 9")


def coarse(recorder: w.RosRecorder, stamp_ns: int) -> None:
    """Write depth that an 8-bit encoder has passed through."""
    values = (w.millimetres() // 39 * 39).astype(np.uint16)
    recorder.image(f"{w.PREFIX}/image_rect_raw", stamp_ns, values, "16UC1")


def dark(recorder: w.RosRecorder, stamp_ns: int) -> None:
    """Write depth of which two thirds were not measured."""
    values = w.millimetres()
    values[:, ::3] = values[:, 1::3] = 0
    recorder.image(f"{w.PREFIX}/image_rect_raw", stamp_ns, values, "16UC1")


def late(recorder: w.RosRecorder, stamp_ns: int) -> None:
    """Write depth whose stamps are 1.2 s before their time in the log."""
    topic = f"{w.PREFIX}/image_rect_raw"
    log_ns = stamp_ns + 12 * SECOND // 10
    recorder.image(topic, stamp_ns, w.millimetres(), "16UC1", log_ns=log_ns)


@pytest.mark.parametrize(
    ("depth", "role", "words"),
    [
        (coarse, "depth", "in steps of 39 mm"),
        (dark, "depth", "32 % of their pixels measured"),
        (late, "clocks", "clock"),
    ],
)
def test_what_is_weak_is_said(
    depth: Callable[[w.RosRecorder, int], None], role: str, words: str, tmp_path: Path
) -> None:
    """With its figure; the recording can be processed all the same."""
    recording = tmp_path / "lap.mcap"
    w.write_drive(recording, depth=depth)
    state, says = said(recording)[role]
    assert state == "weak"
    assert words in says
    assert tablemap_here("info", recording, "--check").returncode == 0


def test_a_narrow_laser_and_one_that_sees_little_are_weak(tmp_path: Path) -> None:
    """As for an open hall."""
    narrow = tmp_path / "narrow.mcap"
    w.write_drive(narrow, scan_fields={"angle_min": -0.5, "angle_increment": 1 / 30})
    assert said(narrow)["laser"] == (
        "weak",
        "51 scans of 57 degrees, 100 % of beams return; a wider view places the stops better",
    )
    ranges = np.full(46, np.inf, np.float32)
    ranges[:9] = 2.0
    open_hall = tmp_path / "hall.mcap"
    w.write_drive(open_hall, scan_fields={"angle_min": -2.25, "ranges": ranges})
    assert "20 % of beams return" in said(open_hall)["laser"][1]
    assert said(open_hall)["laser"][0] == "weak"


def test_poses_that_stop_while_the_robot_moves_are_weak(tmp_path: Path) -> None:
    """A gap in /tf, and images after its end."""
    gap = tmp_path / "gap.mcap"
    _write_with_poses(gap, lambda tick: not 12 < tick < 28)
    state, says = said(gap)["localisation"]
    assert state == "weak"
    assert "1.6 s of motion" in says
    ended = tmp_path / "ended.mcap"
    _write_with_poses(ended, lambda tick: tick < 32)
    state, says = said(ended)["localisation"]
    assert state == "weak"
    assert "4 of 6 depth images" in says


def _write_with_poses(recording: Path, is_there: Callable[[int], bool]) -> None:
    recorder = w.RosRecorder(recording)
    recorder.transforms(w.START_NS, w.STATIC_EDGES, topic="/tf_static")
    for tick in range(10 * (w.IMAGES - 1) + 1):
        stamp_ns = w.START_NS + tick * SECOND // 10
        if is_there(tick):
            recorder.transforms(stamp_ns, w.drive_edges(stamp_ns))
        if tick % 10 == 0:
            recorder.camera_info(f"{w.PREFIX}/camera_info", stamp_ns)
            w.raw_depth(recorder, stamp_ns)
    recorder.finish()


def test_what_no_topic_has_is_missing(tmp_path: Path) -> None:
    """Each in its line, where processing cannot work and where it can."""
    empty = tmp_path / "empty.mcap"
    w.write_drive(empty, depth=None, transforms=False)
    assert {role: state for role, (state, _) in said(empty).items()} == {
        "depth": "missing",
        "localisation": "missing",
    }
    blind = tmp_path / "blind.mcap"
    _write_with_poses(blind, lambda tick: True)
    assert said(blind)["laser"][0] == "missing"
    assert tablemap_here("info", blind, "--check").returncode == 0


def test_check_finds_what_only_the_poses_show(tmp_path: Path) -> None:
    """All topics are there, and no image has a pose: ``process`` could not work."""
    recording = tmp_path / "lap.mcap"
    _write_with_poses(recording, lambda tick: 43 < tick < 47)
    done = tablemap_here("info", recording, "--check")
    assert done.returncode == 1
    assert "missing: No depth image has a pose at its stamp" in done.stdout


def test_half_a_log_is_judged(demo_recording: Path, tmp_path: Path) -> None:
    """As one that is still being copied."""
    half = tmp_path / "half.mcap"
    data = demo_recording.read_bytes()
    half.write_bytes(data[: len(data) // 2])
    done = tablemap_here("info", half, "--json")
    document = json.loads(done.stdout)
    roles = {each["role"]: each for each in document["fitness"]}
    assert roles["stops"]["state"] == "weak"
    assert roles["stops"]["says"].endswith("six to ten are better")
    assert roles["depth"]["state"] == "fine"
    shown = tablemap_here("info", half).stdout
    assert f"  weak     stops         {roles['stops']['says']}" in shown.splitlines()
