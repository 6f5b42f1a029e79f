"""Chairs among a table's legs: which of the two a place belongs to."""

from __future__ import annotations

import numpy as np
import pytest
from shapely.geometry import Polygon

from tablemap.config import LegsConfig, SensorsConfig
from tablemap.geometry import Floats, Pose2
from tablemap.stages.legs import Legs, find_legs
from tablemap.stages.legs.chairs import chair_like, chair_squares
from tablemap.stages.legs.layout import Frame, rectangles
from tests.making.leg_scenes import Scene, drive, four, surface_of

SENSORS = SensorsConfig()

TABLE = Pose2(0.4, -0.3, 0.6)
ROOM = [
    (-3.0, -3.0, 3.0, -3.0),
    (3.0, -3.0, 3.0, 3.0),
    (3.0, 3.0, -3.0, 3.0),
    (-3.0, 3.0, -3.0, -3.0),
]
LOW = Scene(table=TABLE, length=0.9, width=0.55, height=0.45, walls=ROOM)
FEET = 0.19 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])


def frame_of(scene: Scene) -> Frame:
    """Return the frame of a scene's top."""
    surface = surface_of(scene, {})
    return Frame(surface, Polygon(surface.outline))


def with_chairs(scene: Scene, legs: Floats, chairs: list[Pose2], seat: float = 0.45) -> Scene:
    """Return the scene with square legs of 5 cm, and chairs at poses in the table's frame."""
    boxes: list[tuple[float, ...]] = [(x, y, 0.05, 0.05, TABLE.yaw) for x, y in legs]
    for place in chairs:
        pose = TABLE @ place
        feet = pose.apply(FEET)
        boxes += [(x, y, 0.035, 0.035, pose.yaw, 0.0, seat) for x, y in feet]
        boxes.append((pose.x, pose.y, 0.42, 0.42, pose.yaw, seat - 0.03, seat))
        back = pose.apply(np.array([0.2, 0.0]))
        boxes.append((*back, 0.025, 0.4, pose.yaw, seat, 0.9))
    return Scene(
        boxes=boxes,
        table=TABLE,
        length=scene.length,
        width=scene.width,
        height=scene.height,
        walls=ROOM,
        shape=scene.shape,
    )


def found(scene: Scene, *, with_depth: bool = False, seed: int = 0) -> Legs:
    """Return the legs of a drive round the scene."""
    rng = np.random.default_rng(seed)
    given = drive(scene, rng, scans_between=8, scans_per_stop=4, with_depth=with_depth)
    return find_legs(*given, config=LegsConfig(), sensors=SENSORS)


def errors(legs: Legs, truth: Floats) -> Floats:
    """Return the distance of each true leg to the nearest found one, metres."""
    places = np.array([(leg.x, leg.y) for leg in legs.legs]).reshape(-1, 2)
    return np.asarray(np.linalg.norm(truth[:, None] - places[None], axis=2).min(axis=1))


@pytest.mark.parametrize(
    "with_depth",
    [pytest.param(False, marks=pytest.mark.slow), True],
    ids=["laser alone", "with depth"],
)
def test_chairs_beside_a_low_table_cost_none_of_its_legs(with_depth: bool) -> None:
    """Legs 50 cm apart and a chair's foot beyond the top make a square of a chair's size."""
    truth = four(LOW, inset=0.025)
    chairs = [Pose2(0.73, -0.23, 0.05), Pose2(-0.71, 0.23, np.pi), Pose2(0.2, 0.53, np.pi / 2)]
    legs = found(with_chairs(LOW, truth, chairs), with_depth=with_depth)
    assert len(legs.legs) == 4
    assert errors(legs, truth).max() < 0.006


def test_chair_close_beside_a_low_table_lends_it_no_leg() -> None:
    """Feet 5 cm beyond a low top stand up to its height, and carry a seat instead."""
    truth = four(LOW, inset=0.025)
    legs = found(with_chairs(LOW, truth, [Pose2(0.69, -0.05)]), with_depth=True)
    assert len(legs.legs) == 4
    assert errors(legs, truth).max() < 0.006
    feet = (TABLE @ Pose2(0.69, -0.05)).apply(FEET[1:3])
    refused = np.array([(cluster.x, cluster.y) for cluster in legs.rejected])
    assert np.linalg.norm(feet[:, None] - refused[None], axis=2).min(axis=1).max() < 0.03


def test_what_ends_below_a_low_top_does_not_carry_it() -> None:
    """A stack of 20 cm in a corner under a top of 45 cm: the camera looks through above it."""
    truth = four(LOW, inset=0.025)
    scene = with_chairs(LOW, truth, [])
    stack = TABLE.apply(np.array([0.28, 0.15]))
    scene.boxes.append((*stack, 0.06, 0.06, TABLE.yaw, 0.0, 0.2))
    legs = found(scene, with_depth=True)
    assert len(legs.legs) == 4
    reasons = [c.reason for c in legs.rejected if np.hypot(*(stack - (c.x, c.y))) < 0.04]
    assert reasons and all("does not reach the top" in reason for reason in reasons)


def test_tidy_chairs_round_a_pedestal_are_no_legs() -> None:
    """Feet of two chairs that face each other are symmetric, and wholly explained by chairs."""
    scene = Scene(table=TABLE, length=1.2, width=0.8)
    chairs = [Pose2(0.6, 0.0, 0.0), Pose2(-0.6, 0.0, np.pi)]
    legs = found(with_chairs(scene, TABLE.apply(np.zeros((1, 2))), chairs))
    assert len(legs.legs) == 1
    assert errors(legs, TABLE.apply(np.zeros((1, 2)))).max() < 0.006


def test_three_corners_take_no_place_of_the_tables_own_set() -> None:
    """Two of the table's legs and a foot at a right angle to them say nothing against the legs."""
    places = np.concatenate([four(LOW, inset=0.025), TABLE.apply(np.array([[0.02, 0.31]]))])
    frame = frame_of(LOW)
    assert chair_like(frame, places, set()) == {0, 1, 2, 3, 4}
    assert chair_like(frame, places, {0, 1, 2, 3}) == {4}


def test_whole_chairs_take_a_symmetric_set_that_is_their_own() -> None:
    """Inner feet of facing chairs are theirs, one hidden or not; of one chair and two legs not."""
    frame = frame_of(Scene(table=TABLE, length=1.2, width=0.8))
    near, far = Pose2(0.6, 0.0), Pose2(-0.6, 0.0, np.pi)
    places = TABLE.apply(np.concatenate([near.apply(FEET), far.apply(FEET)]))
    inner = {1, 2, 5, 6}
    assert chair_like(frame, places, inner) == set(range(8))
    assert chair_like(frame, places[:7], inner) == set(range(7))
    alone = places[[0, 1, 2, 3, 5, 6]]
    assert chair_like(frame, alone, {1, 2, 4, 5}) == {0, 3}


def test_no_place_belongs_to_a_whole_chair_and_to_three_corners() -> None:
    """A leg at a right angle to two feet of a chair that is seen whole makes no second chair."""
    frame = frame_of(Scene(table=TABLE, length=1.6, width=0.9))
    chair = Pose2(0.2, 0.45, np.pi / 2).apply(FEET)
    leg = chair[1] + [-0.4, 0.0]
    places = TABLE.apply(np.vstack([chair, leg, leg + np.array([3.0, 0.0])]))
    assert chair_squares(frame, places) == [frozenset({0, 1, 2, 3})]
    assert chair_squares(frame, places[[0, 1, 2, 4]])


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_places_make_no_chair(count: int) -> None:
    """Nothing to compare is an answer, not an error."""
    places = four(LOW)[:count]
    assert chair_like(frame_of(LOW), places, set()) == set()
    assert chair_squares(frame_of(LOW), places) == []


def test_feet_about_a_low_top_are_no_ring_of_legs() -> None:
    """Two chairs that stand symmetrically 4 cm off a low table: its own four legs are under it."""
    truth = four(LOW, inset=0.025)
    scene = with_chairs(LOW, truth, [Pose2(0.68, 0.0), Pose2(-0.68, 0.0, np.pi)])
    legs = found(scene)
    assert len(legs.legs) == 4
    assert errors(legs, truth).max() < 0.006


def test_a_pedestal_is_no_third_corner_of_a_chair() -> None:
    """Two feet beyond the top at a right angle to its middle do not make a chair of the column."""
    frame = frame_of(Scene(table=TABLE, length=0.7, width=0.7))
    places = TABLE.apply(np.array([[0.0, 0.0], [0.4, 0.0], [0.4, 0.4]]))
    assert chair_like(frame, places, set()) == set()
    aside = places + 0.12
    assert chair_like(frame, aside, set()) == {0, 1, 2}


@pytest.mark.parametrize(
    ("place", "size", "stands"),
    [
        ((1.26, 0.72), 0.058, True),
        ((1.27, 0.73), 0.064, True),
        ((1.31, 0.72), 0.058, False),
        ((1.26, 0.72), 0.035, False),
    ],
)
def test_four_alike_things_in_a_rectangle_are_legs(
    place: tuple[float, float], size: float, stands: bool
) -> None:
    """The fourth is of the legs' size, and within 3 cm of where three others leave it."""
    places = np.array([(0.0, 0.0), (1.26, 0.0), (0.0, 0.72), (0.6, 0.35), place])
    sizes = np.array([0.058, 0.059, 0.057, 0.080, size])
    found = rectangles(Pose2(0.3, -0.2, 0.4).apply(places), sizes)
    assert found == ([(0, 1, 2, 4)] if stands else [])


def test_a_chair_is_no_rectangle_of_legs() -> None:
    """Its feet are too near to each other."""
    assert rectangles(FEET, np.full(4, 0.035)) == []
