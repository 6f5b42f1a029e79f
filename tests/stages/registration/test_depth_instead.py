"""A laser that places only some of the stops costs no view of the table."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tablemap.errors import ProcessWarning
from tablemap.pipeline import process
from tablemap.recording import open_recording
from tablemap.stages.registration.result import DepthStatistics, PoseSource, StopCheck
from tablemap.stages.registration.solution import Solution
from tablemap.stages.registration.stage import of_more_views
from tests.making.rewriting import Change, Entry, edit, rewrite


def solved(source: PoseSource, passed: list[bool], edge_points: list[float | None]) -> Solution:
    """Return a solution whose checks passed or not, with the points of the table's edge."""
    checks = tuple(
        StopCheck(i, ok, None if seen is None else DepthStatistics(edge_points=seen), ())
        for i, (ok, seen) in enumerate(zip(passed, edge_points, strict=True))
    )
    n = len(passed)
    return Solution(np.zeros((n, 3)), np.eye(3 * n), (), checks, source, 0.001, ())


def test_the_way_that_places_more_views_of_the_table_is_taken() -> None:
    """Depth has to place more than the laser does; with as many, the laser is the better one."""
    laser = solved("laser", [True, True, False], [None] * 3)
    depth = solved("depth", [True, True, True], [90.0, 80.0, 70.0])
    warnings: list[ProcessWarning] = []
    assert of_more_views(laser, depth, warnings) is depth
    assert [warning.code for warning in warnings] == ["registration.depth_instead"]
    assert "the laser places 2 of the 3 views" in warnings[0].message
    equal = replace(depth, checks=(replace(depth.checks[0], passed=False), *depth.checks[1:]))
    assert of_more_views(laser, equal, said := []) is laser
    assert said == []


def test_views_that_do_not_show_the_table_do_not_count() -> None:
    """Depth passes them unchecked, so that they speak neither for it nor against the laser."""
    laser = solved("laser", [True, True, False], [None] * 3)
    assert of_more_views(laser, solved("depth", [True] * 3, [90.0, 80.0, None]), []) is laser
    assert of_more_views(laser, solved("depth", [True] * 3, [None] * 3), []) is laser


def dies(last_ns: int) -> Change:
    """Let the laser send nothing after a stamp."""

    def change(entry: Entry) -> Iterable[Entry]:
        return [] if entry.type == "LaserScan" and entry.stamp_ns > last_ns else [entry]

    return change


def sees_two_metres(entry: Entry) -> Iterable[Entry]:
    """Let the laser see nothing of most of the room."""
    if entry.type != "LaserScan":
        return [entry]
    ranges = entry.message.ranges
    return [edit(entry, ranges=np.where(ranges > 2.0, np.float32(np.inf), ranges))]


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["dies", "is short"])
def test_no_view_is_lost_because_of_the_laser(
    tmp_path: Path, plain_recording: Path, fault: str
) -> None:
    """Whether it dies half way or sees two metres, all views are used and the sizes are right."""
    with open_recording(plain_recording) as plain:
        stamps = plain.scan_stamps()
    change = dies(int(stamps[len(stamps) // 2])) if fault == "dies" else sees_two_metres
    path = rewrite(plain_recording, tmp_path / "r.mcap", change)
    with open_recording(path) as recording:
        model = process(recording).model
    assert all(snapshot.used for snapshot in model.snapshots)
    length, width = (model.surface.dimensions[name] for name in ("length", "width"))
    assert length.value == pytest.approx(1.2, abs=0.01)
    assert width.value == pytest.approx(0.8, abs=0.01)
    assert not [w for w in model.warnings if w.code == "accuracy.registration_failed"]
