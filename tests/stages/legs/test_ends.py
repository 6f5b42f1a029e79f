"""Things that end below the top: seen to end there, or ending where no view looks."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from shapely.geometry import Polygon

from tablemap.geometry import Floats, Pose2
from tablemap.stages.legs import Legs
from tablemap.stages.legs.ends import UpperEnd, _leaning, upper_end
from tablemap.stages.legs.layout import Frame
from tests.making.leg_scenes import ROOM, TABLE, Scene, drive, errors_of, four, legs_of

MIDDLE = Pose2(0.2, 0.1)


def _table() -> tuple[Scene, Floats]:
    """Return a table of 1.6 by 0.9 m on four square legs of 5 cm, and their places."""
    scene = Scene(table=TABLE, length=1.6, width=0.9, walls=ROOM)
    truth = four(scene, inset=0.08)
    scene.boxes = [(x, y, 0.05, 0.05, TABLE.yaw) for x, y in truth]
    return scene, truth


def _pedestal() -> tuple[Scene, Floats]:
    """Return a round table of 1.1 m on one column of 10 cm, and its place."""
    scene = Scene(table=MIDDLE, length=1.1, width=1.1, shape="circle", walls=ROOM)
    scene.circles = [(MIDDLE.x, MIDDLE.y, 0.05)]
    return scene, np.array([[MIDDLE.x, MIDDLE.y]])


def _person(at: Pose2) -> list[tuple[float, ...]]:
    """Return someone who sits and looks along x: shins, thighs, body, and the feet of the chair."""
    boxes: list[tuple[float, ...]] = []
    for side in (-0.11, 0.11):
        shin, thigh = at.apply(np.array([[0.42, side], [0.2, side]]))
        boxes.append((*shin, 0.1, 0.1, at.yaw, 0.0, 0.53))
        boxes.append((*thigh, 0.55, 0.13, at.yaw, 0.48, 0.62))
    boxes.append((at.x, at.y, 0.25, 0.38, at.yaw, 0.45, 1.2))
    for u, v in ((0.18, 0.18), (-0.18, 0.18), (-0.18, -0.18), (0.18, -0.18)):
        boxes.append((*at.apply(np.array([u, v])), 0.035, 0.035, at.yaw, 0.0, 0.45))
    return boxes


def _reasons(legs: Legs, place: Floats) -> list[str]:
    return [c.reason for c in legs.rejected if np.hypot(c.x - place[0], c.y - place[1]) < 0.06]


def _codes(legs: Legs) -> list[str]:
    return [warning.code for warning in legs.warnings]


@pytest.mark.parametrize(("height", "inset"), [(0.3, 0.25), (0.45, 0.25), (0.53, 0.12)])
def test_a_post_with_a_gap_above_it_is_no_leg(height: float, inset: float) -> None:
    """Views see through between two posts and the top: each is refused, and where it ends said."""
    scene, truth = _table()
    places = TABLE.apply(np.array([[0.45, 0.45 - inset], [-0.45, inset - 0.45]]))
    scene.boxes += [(x, y, 0.1, 0.1, TABLE.yaw, 0.0, height) for x, y in places]
    legs = legs_of(scene, with_depth=True)
    assert len(legs.legs) == 4
    assert errors_of(legs, truth).max() < 0.004
    assert "accuracy.unsure_legs" not in _codes(legs)
    for place in places:
        (reason,) = _reasons(legs, place)
        said = float(reason.split("it ends ")[1].split(" cm above the floor")[0])
        assert said == pytest.approx(100 * height, abs=2)


def test_without_a_laser_a_gap_above_a_post_speaks_as_well() -> None:
    """Two posts that are mirror images stand in the corners: depth alone sees where they end."""
    scene, truth = _table()
    places = TABLE.apply(np.array([[0.5, 0.33], [-0.5, 0.33], [0.5, -0.33], [-0.5, -0.33]]))
    scene.boxes += [(x, y, 0.08, 0.08, TABLE.yaw, 0.0, 0.56) for x, y in places]
    legs = legs_of(scene, with_depth=True, laser=False, scans_between=0, scans_per_stop=1)
    assert len(legs.legs) == 4
    assert errors_of(legs, truth).max() < 0.015
    assert sum("does not reach the top" in one.reason for one in legs.rejected) == 4


@pytest.mark.parametrize("height", [0.53, 0.66])
def test_a_post_whose_end_is_hidden_is_left_out_and_said(height: float) -> None:
    """The edge of the top hides its end, and four legs of another size carry the top: a doubt."""
    scene, truth = _table()
    place = TABLE.apply(np.array([0.35, 0.17]))
    scene.boxes.append((*place, 0.1, 0.1, TABLE.yaw, 0.0, height))
    legs = legs_of(scene, with_depth=True)
    assert len(legs.legs) == 4
    assert errors_of(legs, truth).max() < 0.004
    (warning,) = [each for each in legs.warnings if each.code == "accuracy.unsure_legs"]
    said = [float(value) for value in re.findall(r"-?\d+\.\d+", warning.message)]
    assert said == pytest.approx(list(place), abs=0.02)
    assert any("4 legs of 5 cm carry the top" in reason for reason in _reasons(legs, place))


@pytest.mark.parametrize("table", [_table, _pedestal], ids=["four legs", "pedestal"])
def test_a_seated_person_lends_the_table_no_leg(table: object) -> None:
    """Shins of 10 cm stand under the top up to the thighs, whose end it hides: a doubt is said."""
    scene, truth = table()  # type: ignore[operator]
    across = 0.5 * scene.width + 0.2
    for x, side in ((0.3, 1.0), (-0.3, -1.0)):
        place = Pose2(x if len(truth) > 1 else 0.0, side * across, -side * np.pi / 2)
        scene.boxes += _person(scene.table @ place)
    legs = legs_of(scene, with_depth=True)
    assert len(legs.legs) == len(truth)
    assert errors_of(legs, truth).max() < 0.005
    assert all(leg.position_sigma and leg.position_sigma < 0.005 for leg in legs.legs)
    assert "accuracy.unsure_legs" in _codes(legs)


@pytest.mark.parametrize("width", [0.1, 0.14])
def test_a_column_between_four_legs_is_one_of_them(width: float) -> None:
    """In the middle no view sees it meet the top, and it is not made like the legs: it is one."""
    scene, truth = _table()
    scene.circles = [(TABLE.x, TABLE.y, width / 2)]
    legs = legs_of(scene, with_depth=True)
    assert len(legs.legs) == 5
    assert errors_of(legs, np.vstack([truth, [TABLE.x, TABLE.y]])).max() < 0.004
    assert all(leg.position_sigma and leg.position_sigma < 0.004 for leg in legs.legs)
    assert "accuracy.unsure_legs" not in _codes(legs)


@pytest.mark.parametrize("width", [0.03, 0.12])
def test_a_pair_between_four_legs_is_placed_as_surely(width: float) -> None:
    """Two legs of another size, seen from all sides, are not half hidden: they differ by design."""
    scene, truth = _table()
    pair = TABLE.apply(np.array([[0.0, 0.37], [0.0, -0.37]]))
    scene.circles = [(x, y, width / 2) for x, y in pair]
    legs = legs_of(scene, with_depth=True)
    assert len(legs.legs) == 6
    assert errors_of(legs, np.vstack([truth, pair])).max() < 0.004
    assert all(leg.position_sigma and leg.position_sigma < 0.004 for leg in legs.legs)


def test_legs_that_splay_are_followed_up_to_the_top() -> None:
    """Feet 16 cm outside of the upper ends: the views see through above them, and follow them."""
    scene, truth = _table()
    scene.boxes = []
    inwards = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    at_laser = TABLE.inverse().apply(truth)
    for low in np.arange(0.0, 0.72, 0.04):
        for x, y in TABLE.apply(at_laser + 0.2 * (low - 0.16) * inwards):
            scene.boxes.append((x, y, 0.05, 0.05, TABLE.yaw, low, low + 0.04))
    legs = legs_of(scene, with_depth=True)
    assert len(legs.legs) == 4
    assert errors_of(legs, truth).max() < 0.006


def test_missing_depth_above_a_post_says_nothing() -> None:
    """Only what is seen behind the gap shows it: a camera without it leaves the end open."""
    scene, _ = _table()
    place = TABLE.apply(np.array([0.45, 0.2]))
    scene.boxes.append((*place, 0.1, 0.1, TABLE.yaw, 0.0, 0.4))
    _, snapshots, registration, surface = drive(
        scene, np.random.default_rng(0), with_depth=True, scans_between=0, scans_per_stop=1
    )
    poses = dict(enumerate(registration.map_from_base))
    frame = Frame(surface, Polygon(surface.outline))
    seen = upper_end(snapshots, poses, frame, place, 0.05)
    assert seen.is_below and seen.height == pytest.approx(0.4, abs=0.02)
    blind = tuple(
        replace(one, depth=np.where(one.depth > 1.6, np.nan, one.depth)) for one in snapshots
    )
    hidden = upper_end(blind, poses, frame, place, 0.05)
    assert not hidden.is_below and not hidden.is_at_top


@pytest.mark.parametrize(
    ("end", "below", "at_top"),
    [
        (UpperEnd(), False, False),
        (UpperEnd(height=0.5, gap=0.1, shown=1, hidden=0.2), False, False),
        (UpperEnd(height=0.5, gap=0.1, shown=2, hidden=0.2), True, False),
        (UpperEnd(height=0.5, gap=0.1, shown=2, opposed=1, hidden=0.03), False, True),
        (UpperEnd(hidden=0.03), False, True),
        (UpperEnd(hidden=0.1), False, False),
    ],
    ids=["unseen", "one view", "two views", "contradicted", "followed", "hidden"],
)
def test_views_must_agree_on_an_end(end: UpperEnd, below: bool, at_top: bool) -> None:
    """Two views show a gap unless others saw the thing go on; to the top is to its last 6 cm."""
    assert (end.is_below, end.is_at_top) == (below, at_top)


def test_rows_too_few_and_too_far_apart_lean_nowhere() -> None:
    """What is bridged in the middle of a wide gap is larger here than what was seen."""
    on = np.zeros((14, 1), dtype=bool)
    on[[2, 10]] = True
    off, up = np.full(on.shape, 0.01), 0.01 * np.arange(14)
    assert _leaning(on, off, np.zeros(1), up) == (0.0, 0.0)
