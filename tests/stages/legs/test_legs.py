"""Legs: their place, size and shape; walls, chairs and what else must be refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapely.geometry import Point, Polygon

from tablemap.config import LegsConfig
from tablemap.geometry import Floats, Pose2
from tablemap.model.outlines import simple_polygon
from tablemap.stages.legs import Leg, find_legs
from tablemap.stages.legs.adjoining import find_adjoining
from tablemap.stages.legs.depth import Reach
from tablemap.stages.legs.layout import Frame
from tablemap.stages.legs.missing import infer_missing
from tablemap.stages.legs.shapes import seen_in_part
from tablemap.stages.surface import FittedFigure
from tests.making.leg_scenes import ROOM, SENSORS, TABLE, Scene, drive, errors_of, four, legs_of


def _chair(at: Pose2) -> list[tuple[float, ...]]:
    """A chair whose seat faces -x of its pose: legs, seat and back."""
    boxes: list[tuple[float, ...]] = []
    for u, v in ((0.2, 0.2), (-0.2, 0.2), (-0.2, -0.2), (0.2, -0.2)):
        x, y = at.apply(np.array([u, v]))
        boxes.append((x, y, 0.035, 0.035, at.yaw, 0.0, 0.9 if u > 0 else 0.43))
    boxes.append((at.x, at.y, 0.42, 0.42, at.yaw, 0.43, 0.46))
    back = at.apply(np.array([0.2, 0.0]))
    boxes.append((back[0], back[1], 0.02, 0.4, at.yaw, 0.6, 0.9))
    return boxes


def test_four_round_legs_are_placed_to_millimetres() -> None:
    """Poses 2 mm off, a beam of finite width, a biased range: place 4 mm, size 2 mm."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = four(scene)
    scene.circles = [(x, y, 0.025) for x, y in truth]
    legs = legs_of(scene)
    assert len(legs.legs) == 4
    assert errors_of(legs, truth).max() < 0.004
    for leg in legs.legs:
        assert leg.shape == "circle" and leg.status == "measured"
        diameter = leg.dimensions["diameter"]
        assert diameter.value == pytest.approx(0.05, abs=0.002)
        assert diameter.sigma is not None and diameter.sigma < 0.003
        assert leg.position_sigma is not None and 0.0003 < leg.position_sigma < 0.004


@pytest.mark.parametrize("cross", [(0, 1, 3, 2), (0, 2, 1, 3)])
def test_an_outline_that_crosses_itself_is_looked_under(cross: tuple[int, ...]) -> None:
    """A bow tie, as a failed fit may leave it, has legs looked for under its larger part."""
    scene = Scene(table=TABLE, walls=ROOM)
    scene.circles = [(x, y, 0.025) for x, y in four(scene)]
    recording, snapshots, registration, surface = drive(scene, np.random.default_rng(0))
    crossed = replace(surface, outline=surface.outline[list(cross)])
    assert not Polygon(crossed.outline).is_valid
    legs = find_legs(
        recording, snapshots, registration, crossed, config=LegsConfig(), sensors=SENSORS
    )
    assert find_adjoining(crossed, legs) is None
    under = simple_polygon(crossed.outline).buffer(0.05)
    assert all(under.contains(Point(leg.x, leg.y)) for leg in legs.legs)


def test_square_legs_are_told_from_round_ones() -> None:
    """Support lines of a square swing by 40 %: its shape, side and yaw come out."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = four(scene)
    scene.boxes = [(x, y, 0.06, 0.06, TABLE.yaw) for x, y in truth]
    legs = legs_of(scene)
    assert len(legs.legs) == 4
    assert errors_of(legs, truth).max() < 0.004
    for leg in legs.legs:
        assert leg.shape == "rectangle"
        assert leg.dimensions["length"].value == pytest.approx(0.06, abs=0.0025)
        off = (leg.yaw - TABLE.yaw + np.pi / 4) % (np.pi / 2) - np.pi / 4
        assert abs(np.degrees(off)) < 4


def test_poses_off_by_5_mm_cost_no_leg_and_sigmas_say_so() -> None:
    """With worse poses the errors stay within three of the stated sigmas."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = four(scene)
    scene.circles = [(x, y, 0.03) for x, y in truth]
    legs = legs_of(scene, seed=3, pose_sigma=0.005, drive_sigma=0.008)
    errors = errors_of(legs, truth)
    assert len(legs.legs) == 4
    assert errors.max() < 0.009
    sigmas = np.array([leg.position_sigma for leg in legs.legs], dtype=np.float64)
    assert errors.max() < 3.5 * sigmas.max()


def test_metal_legs_of_one_centimetre_arelegs_of() -> None:
    """A thin leg falls between beams at times: the views together find it."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = four(scene)
    scene.circles = [(x, y, 0.006) for x, y in truth]
    legs = legs_of(scene)
    assert len(legs.legs) == 4
    assert errors_of(legs, truth).max() < 0.005
    assert legs.legs[0].dimensions["diameter"].value == pytest.approx(0.012, abs=0.003)


def test_wall_beside_the_table_is_no_leg() -> None:
    """A wall 6 cm behind the table leads on beyond it, and the legs before it are found."""
    scene = Scene(table=Pose2())
    behind = -0.46
    scene.walls = [(-2.5, behind, 2.5, behind), (2.5, behind, 2.5, 3), (-2.5, behind, -2.5, 3)]
    truth = four(scene)
    scene.boxes = [(x, y, 0.05, 0.05, 0.0) for x, y in truth]
    legs = legs_of(scene, arc=np.pi, stops=6)
    assert len(legs.legs) == 4
    assert errors_of(legs, truth).max() < 0.006


def test_chairs_pushed_in_are_refused_with_reasons() -> None:
    """Two chairs under the top: their legs stop at the seat, and none becomes the table's."""
    scene = Scene(table=TABLE, length=1.6, width=0.8, walls=ROOM)
    truth = four(scene)
    scene.boxes = [(x, y, 0.06, 0.06, TABLE.yaw) for x, y in truth]
    for place in (Pose2(0.25, 0.45, np.pi / 2), Pose2(-0.2, -0.45, -np.pi / 2)):
        scene.boxes += _chair(TABLE @ place)
    legs = legs_of(scene, with_depth=True)
    assert len(legs.legs) == 4
    assert errors_of(legs, truth).max() < 0.006
    assert len(legs.rejected) >= 4
    assert all(cluster.reason for cluster in legs.rejected)


def test_pedestal_is_one_leg_in_the_middle() -> None:
    """A round table on a column of 10 cm."""
    scene = Scene(table=Pose2(0.2, 0.1), length=0.9, width=0.9, shape="circle", walls=ROOM)
    scene.circles = [(0.2, 0.1, 0.05)]
    legs = legs_of(scene)
    assert [leg.shape for leg in legs.legs] == ["circle"]
    assert legs.legs[0].dimensions["diameter"].value == pytest.approx(0.1, abs=0.003)
    assert np.hypot(legs.legs[0].x - 0.2, legs.legs[0].y - 0.1) < 0.004


def test_panels_are_rectangles_across_the_table() -> None:
    """Two sides of board, 60 by 2.5 cm."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = TABLE.apply(np.array([[0.5, 0.0], [-0.5, 0.0]]))
    scene.boxes = [(x, y, 0.025, 0.6, TABLE.yaw) for x, y in truth]
    legs = legs_of(scene)
    assert len(legs.legs) == 2
    assert errors_of(legs, truth).max() < 0.006
    for leg in legs.legs:
        assert leg.dimensions["length"].value == pytest.approx(0.6, abs=0.01)
        assert leg.dimensions["width"].value == pytest.approx(0.025, abs=0.008)


def test_what_moved_during_the_drive_is_refused() -> None:
    """A foot that stood under the table for two of eight stops is no leg."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = four(scene)
    scene.circles = [(x, y, 0.03) for x, y in truth]
    rng = np.random.default_rng(5)
    recording, snapshots, registration, surface = drive(
        scene, rng, scans_between=0, scans_per_stop=4
    )
    foot = TABLE.apply(np.array([0.1, 0.2]))
    visited = Scene(table=TABLE, walls=ROOM, circles=[*scene.circles, (*foot, 0.05)])
    second = np.random.default_rng(5)
    other = drive(visited, second, scans_between=0, scans_per_stop=4)[0]
    recording.all[:8] = other.all[:8]
    legs = find_legs(
        recording, snapshots, registration, surface, config=LegsConfig(), sensors=SENSORS
    )
    assert len(legs.legs) == 4
    near = [c for c in legs.rejected if np.hypot(c.x - foot[0], c.y - foot[1]) < 0.06]
    assert near and "moved" in near[0].reason


def test_results_repeat_bit_for_bit() -> None:
    """The same recording gives the same legs."""
    scene = Scene(table=TABLE, walls=ROOM, circles=[(*p, 0.025) for p in four(Scene(table=TABLE))])
    given = drive(scene, np.random.default_rng(1), scans_between=4, scans_per_stop=4)
    first = find_legs(*given, config=LegsConfig(), sensors=SENSORS)
    second = find_legs(*given, config=LegsConfig(), sensors=SENSORS)
    assert [(leg.x, leg.y, leg.dimensions) for leg in first.legs] == [
        (leg.x, leg.y, leg.dimensions) for leg in second.legs
    ]


def test_bare_floor_gives_a_warning_and_no_leg() -> None:
    """Nothing under the top: an empty result that says so."""
    legs = legs_of(Scene(table=TABLE, walls=ROOM), scans_between=0)
    assert legs.legs == ()
    (warning,) = legs.warnings
    assert warning.code == "legs.none_found"
    assert "Nothing upright was seen" in warning.message
    assert "record views" in warning.message


def test_depth_alone_places_legs_to_a_centimetre() -> None:
    """Without a laser four legs of 6 cm come from the depth below the top, with wider sigmas."""
    scene = Scene(table=TABLE)
    truth = four(scene)
    scene.boxes = [(x, y, 0.06, 0.06, TABLE.yaw) for x, y in truth]
    legs = legs_of(scene, with_depth=True, laser=False, scans_between=0, scans_per_stop=1)
    assert "legs.no_laser" in [warning.code for warning in legs.warnings]
    assert len(legs.legs) == 4
    assert errors_of(legs, truth).max() < 0.015
    assert all(leg.position_sigma and leg.position_sigma >= 0.005 for leg in legs.legs)


def test_one_stop_is_enough_for_no_crash() -> None:
    """A single view ends in a result, whatever it holds."""
    scene = Scene(table=TABLE, walls=ROOM, circles=[(*p, 0.025) for p in four(Scene(table=TABLE))])
    legs = legs_of(scene, stops=1)
    assert len(legs.legs) <= 4


def test_panels_seen_along_their_faces_stay_whole() -> None:
    """From near their own plane one beam in ten is lost: pieces of a face are no silhouettes."""
    scene = Scene(table=TABLE, length=1.4, width=0.9, walls=ROOM)
    truth = TABLE.apply(np.array([[0.6, 0.0], [-0.6, 0.0]]))
    scene.boxes = [(x, y, 0.03, 0.8, TABLE.yaw) for x, y in truth]
    rng = np.random.default_rng(2)
    given = drive(scene, rng, stops=12, distance=1.1, scans_between=12, scans_per_stop=2)
    given[0].all = [
        replace(scan, ranges=np.where(rng.random(len(scan.ranges)) < 0.1, np.inf, scan.ranges))
        for scan in given[0].all
    ]
    legs = find_legs(*given, config=LegsConfig(), sensors=SENSORS)
    assert len(legs.legs) == 2
    assert errors_of(legs, truth).max() < 0.006
    for leg in legs.legs:
        assert leg.dimensions["length"].value == pytest.approx(0.8, abs=0.012)
        assert leg.dimensions["width"].value == pytest.approx(0.03, abs=0.010)


def test_a_leg_that_a_box_hides_is_inferred() -> None:
    """Three corners of four, the last inside a box: it is put by symmetry, and said to be."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = four(scene)
    scene.circles = [(x, y, 0.03) for x, y in truth[:3]]
    scene.boxes = [(*truth[3], 0.3, 0.3, TABLE.yaw, 0.0, 0.6)]
    legs = legs_of(scene)
    inferred = [leg for leg in legs.legs if leg.status == "inferred"]
    assert len(legs.legs) == 4 and len(inferred) == 1
    assert np.hypot(inferred[0].x - truth[3][0], inferred[0].y - truth[3][1]) < 0.01
    assert inferred[0].position_sigma is not None and inferred[0].position_sigma >= 0.01
    assert inferred[0].seen_by == "nothing"
    assert "legs.inferred" in [warning.code for warning in legs.warnings]


def test_a_corner_that_is_open_has_no_leg() -> None:
    """Three legs and a corner that the laser sees through: nothing is put there."""
    scene = Scene(table=TABLE, walls=ROOM)
    scene.circles = [(x, y, 0.03) for x, y in four(scene)[:3]]
    legs = legs_of(scene)
    assert [leg.status for leg in legs.legs] == ["measured"] * 3


def _leg(place: Floats, seen_by: str = "depth") -> Leg:
    size = {"diameter": FittedFigure(0.05, 0.01)}
    x, y = float(place[0]), float(place[1])
    return Leg("circle", x, y, 0.0, "measured", 0.008, size, np.zeros((0, 2)), 2, seen_by)


@pytest.mark.parametrize(
    ("seen", "count"),
    [(Reach(0, 0), 1), (Reach(0, 5), 0), (Reach(2, 5), 0), (Reach(5, 2), 1)],
    ids=["hidden", "open", "mostly open", "something there"],
)
def test_without_a_laser_the_camera_decides_what_may_be_inferred(seen: Reach, count: int) -> None:
    """Three legs seen by depth: the fourth corner is filled unless a view saw through it."""
    scene = Scene(table=TABLE)
    surface = drive(scene, np.random.default_rng(0), stops=1, scans_per_stop=1)[3]
    frame = Frame(surface, Polygon(surface.outline))
    truth = four(scene)
    legs = [_leg(place + 0.01 * np.array([1, -1]) ** k) for k, place in enumerate(truth[:3])]
    found = infer_missing(legs, [], None, lambda *_: seen, frame, config=LegsConfig())
    assert len(found) == count
    for leg in found:
        assert (
            leg.status == "inferred" and np.hypot(leg.x - truth[3][0], leg.y - truth[3][1]) < 0.03
        )
        # Three places 8 mm off, and tables that are not quite symmetric.
        assert leg.position_sigma == pytest.approx(np.sqrt(3 * 0.008**2 + 0.01**2))


def test_three_legs_without_symmetry_infer_nothing() -> None:
    """Three that are no corners of the top's own rectangle say nothing of a fourth."""
    scene = Scene(table=TABLE)
    surface = drive(scene, np.random.default_rng(0), stops=1, scans_per_stop=1)[3]
    frame = Frame(surface, Polygon(surface.outline))
    places = TABLE.apply(np.array([[0.5, 0.3], [-0.2, 0.3], [0.1, -0.3]]))
    legs = [_leg(place) for place in places]
    looked = Reach(0, 0)
    assert infer_missing(legs, [], None, lambda *_: looked, frame, config=LegsConfig()) == []


def test_legs_close_before_a_wall_are_told_from_it() -> None:
    """Rear legs 3 cm before a wall: no board is made of them and what is seen of it between."""
    scene = Scene(table=Pose2())
    wall = -0.40
    scene.walls = [(-2.5, wall, 2.5, wall), (2.5, wall, 2.5, 3), (-2.5, wall, -2.5, 3)]
    truth = four(scene)
    scene.boxes = [(x, y, 0.05, 0.05, 0.0) for x, y in truth]
    scene.boxes.append((0.0, wall - 0.1, 5.0, 0.2, 0.0, 0.0, 2.0))
    legs = legs_of(scene, arc=np.pi, stops=6, with_depth=True)
    assert len(legs.legs) == 4
    assert errors_of(legs, truth).max() < 0.012


def sized(diameter: float) -> Leg:
    """Return a round leg that was measured to a millimetre."""
    size = {"diameter": FittedFigure(diameter, 0.001)}
    return Leg("circle", 0.0, 0.0, 0.0, "measured", 0.001, size, np.zeros((0, 2)), 2, "laser")


def test_a_leg_unlike_the_others_may_be_half_hidden() -> None:
    """Its place is as unsure as half of what was not seen of it; without a pair none is usual."""
    alike = [sized(0.05), sized(0.05)]
    widened = seen_in_part([alike, [sized(0.02)]])
    assert [leg.position_sigma for leg in widened[:2]] == [0.001, 0.001]
    assert widened[2].position_sigma == pytest.approx(np.hypot(0.001, 0.015))
    single = seen_in_part([[sized(0.05)], [sized(0.02)]])
    assert [leg.position_sigma for leg in single] == [0.001, 0.001]


def test_a_panel_beside_legs_keeps_its_place() -> None:
    """A desk stands on two legs and a panel: the panel is long, and not half hidden."""
    size = {"length": FittedFigure(0.6, 0.002), "width": FittedFigure(0.03, 0.002)}
    panel = replace(sized(0.05), shape="rectangle", dimensions=size)
    legs = seen_in_part([[panel], [sized(0.05), sized(0.05)]])
    assert [leg.position_sigma for leg in legs] == [0.001] * 3
