"""Pixels that show the robot itself: what counts as such, and what does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tablemap.geometry import Bools, Floats, Pose2
from tablemap.stages.snapshots import Snapshot
from tablemap.stages.snapshots.own_body import own_body, without_own_body
from tests.making.leg_scenes import TABLE, Scene, drive, four

BARS = {
    "across the image": ((130, 150), (0, 320), 0.95),
    "a hand at the lower rim": ((180, 240), (120, 190), 0.5),
    "a forearm at one side": ((60, 240), (0, 40), 0.7),
}


def _views(scene: Scene, **settings: object) -> tuple[Snapshot, ...]:
    given = {"scans_between": 0, "scans_per_stop": 1, "with_depth": True, "laser": False}
    rng = np.random.default_rng(2)
    return drive(scene, rng, **given, **settings)[1]  # type: ignore[arg-type]


def _table() -> Scene:
    scene = Scene(table=TABLE)
    scene.boxes = [(x, y, 0.06, 0.06, TABLE.yaw) for x, y in four(scene)]
    return scene


def _carrying(
    views: tuple[Snapshot, ...], rows: tuple[int, int], columns: tuple[int, int], away: float
) -> tuple[list[Snapshot], Bools]:
    """Put something at ``away`` metres into all images; return its pixels, too."""
    rng = np.random.default_rng(3)
    shown = np.zeros(views[0].depth.shape, dtype=bool)
    shown[slice(*rows), slice(*columns)] = True

    def held(depth: Floats) -> Floats:
        thing = away + rng.normal(0.0, 0.001, depth.shape)
        return np.where(shown, thing, depth).astype(np.float32)

    return [replace(one, depth=held(one.depth)) for one in views], shown


@pytest.mark.parametrize("bar", BARS.values(), ids=BARS.keys())
def test_what_the_robot_carries_is_left_out_and_said(
    bar: tuple[tuple[int, int], tuple[int, int], float],
) -> None:
    """It keeps its depth, and other views see through its places: it goes with a narrow border."""
    views, shown = _carrying(_views(_table()), *bar)
    cleared, notes = without_own_body(views)
    lost = np.isnan(cleared[0].depth) & ~np.isnan(views[0].depth)
    assert (lost & shown).sum() == shown.sum()
    beside = np.pad(shown, 4, mode="edge")
    grown = np.zeros_like(shown)
    for row in range(9):
        for column in range(9):
            grown |= beside[row : row + shown.shape[0], column : column + shown.shape[1]]
    assert not (lost & ~grown).any()
    assert [note.code for note in notes] == ["snapshots.own_body"]
    assert f"{bar[2]:.2f} m from the camera" in notes[0].message


@pytest.mark.parametrize("shape", ["circle", "rectangle"])
def test_a_table_that_looks_alike_from_all_sides_stays(shape: str) -> None:
    """Driven round exactly, a round top and its column keep their depth: the views agree on it."""
    scene = Scene(table=Pose2(0.2, 0.1), length=0.9, width=0.9, shape=shape)
    scene.circles = [(0.2, 0.1, 0.05)]
    views = _views(scene, pose_sigma=0.0, distance=1.0)
    assert own_body(views) is None
    assert without_own_body(views) == (list(views), ())


def test_a_robot_that_stays_where_it_is_has_no_body_to_see() -> None:
    """From one place everything keeps its depth: nothing tells the robot from the world."""
    views, _ = _carrying(_views(_table(), arc=0.0), *BARS["a hand at the lower rim"])
    assert own_body(views) is None


def test_few_views_remove_nothing() -> None:
    """Three views may agree by chance."""
    views, _ = _carrying(_views(_table(), stops=3), *BARS["across the image"])
    assert own_body(views) is None
