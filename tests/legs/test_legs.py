"""Legs: their place, size and shape; walls, chairs and what else must be refused."""

from __future__ import annotations

import numpy as np
import pytest

from tablemap.config import LegsConfig
from tablemap.geometry import Floats, Pose2
from tablemap.legs import Legs, find_legs
from tests.legs.scene import Scene, drive, four

TABLE = Pose2(0.4, -0.3, 0.6)
ROOM = [(-3, -3, 3, -3), (3, -3, 3, 3), (3, 3, -3, 3), (-3, 3, -3, -3)]


def _found(scene: Scene, seed: int = 0, **settings: object) -> Legs:
    rng = np.random.default_rng(seed)
    arguments = {"scans_between": 8, "scans_per_stop": 4, **settings}
    given = drive(scene, rng, **arguments)  # type: ignore[arg-type]
    return find_legs(*given, config=LegsConfig())


def _errors(legs: Legs, truth: Floats) -> Floats:
    """Return each true leg's distance to the nearest found one."""
    places = np.array([[leg.x, leg.y] for leg in legs.legs])
    return np.linalg.norm(truth[:, None] - places[None], axis=2).min(axis=1)


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
    legs = _found(scene)
    assert len(legs.legs) == 4
    assert _errors(legs, truth).max() < 0.004
    for leg in legs.legs:
        assert leg.shape == "circle" and leg.status == "measured"
        diameter = leg.dimensions["diameter"]
        assert diameter.value == pytest.approx(0.05, abs=0.002)
        assert diameter.sigma is not None and diameter.sigma < 0.003
        assert leg.position_sigma is not None and 0.0003 < leg.position_sigma < 0.004


def test_square_legs_are_told_from_round_ones() -> None:
    """Support lines of a square swing by 40 %: its shape, side and yaw come out."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = four(scene)
    scene.boxes = [(x, y, 0.06, 0.06, TABLE.yaw) for x, y in truth]
    legs = _found(scene)
    assert len(legs.legs) == 4
    assert _errors(legs, truth).max() < 0.004
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
    legs = _found(scene, seed=3, pose_sigma=0.005, drive_sigma=0.008)
    errors = _errors(legs, truth)
    assert len(legs.legs) == 4
    assert errors.max() < 0.009
    sigmas = np.array([leg.position_sigma for leg in legs.legs], dtype=np.float64)
    assert errors.max() < 3.5 * sigmas.max()


def test_metal_legs_of_one_centimetre_are_found() -> None:
    """A thin leg falls between beams at times: the views together find it."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = four(scene)
    scene.circles = [(x, y, 0.006) for x, y in truth]
    legs = _found(scene)
    assert len(legs.legs) == 4
    assert _errors(legs, truth).max() < 0.005
    assert legs.legs[0].dimensions["diameter"].value == pytest.approx(0.012, abs=0.003)


def test_wall_beside_the_table_is_no_leg() -> None:
    """A wall 6 cm behind the table leads on beyond it, and the legs before it are found."""
    scene = Scene(table=Pose2())
    behind = -0.46
    scene.walls = [(-2.5, behind, 2.5, behind), (2.5, behind, 2.5, 3), (-2.5, behind, -2.5, 3)]
    truth = four(scene)
    scene.boxes = [(x, y, 0.05, 0.05, 0.0) for x, y in truth]
    legs = _found(scene, arc=np.pi, stops=6)
    assert len(legs.legs) == 4
    assert _errors(legs, truth).max() < 0.006


def test_chairs_pushed_in_are_refused_with_reasons() -> None:
    """Two chairs under the top: their legs stop at the seat, and none becomes the table's."""
    scene = Scene(table=TABLE, length=1.6, width=0.8, walls=ROOM)
    truth = four(scene)
    scene.boxes = [(x, y, 0.06, 0.06, TABLE.yaw) for x, y in truth]
    for place in (Pose2(0.25, 0.45, np.pi / 2), Pose2(-0.2, -0.45, -np.pi / 2)):
        scene.boxes += _chair(TABLE @ place)
    legs = _found(scene, with_depth=True)
    assert len(legs.legs) == 4
    assert _errors(legs, truth).max() < 0.006
    assert len(legs.rejected) >= 4
    assert all(cluster.reason for cluster in legs.rejected)


def test_pedestal_is_one_leg_in_the_middle() -> None:
    """A round table on a column of 10 cm."""
    scene = Scene(table=Pose2(0.2, 0.1), length=0.9, width=0.9, shape="circle", walls=ROOM)
    scene.circles = [(0.2, 0.1, 0.05)]
    legs = _found(scene)
    assert [leg.shape for leg in legs.legs] == ["circle"]
    assert legs.legs[0].dimensions["diameter"].value == pytest.approx(0.1, abs=0.003)
    assert np.hypot(legs.legs[0].x - 0.2, legs.legs[0].y - 0.1) < 0.004


def test_panels_are_rectangles_across_the_table() -> None:
    """Two sides of board, 60 by 2.5 cm."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = TABLE.apply(np.array([[0.5, 0.0], [-0.5, 0.0]]))
    scene.boxes = [(x, y, 0.025, 0.6, TABLE.yaw) for x, y in truth]
    legs = _found(scene)
    assert len(legs.legs) == 2
    assert _errors(legs, truth).max() < 0.006
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
    legs = find_legs(recording, snapshots, registration, surface, config=LegsConfig())
    assert len(legs.legs) == 4
    near = [c for c in legs.rejected if np.hypot(c.x - foot[0], c.y - foot[1]) < 0.06]
    assert near and "moved" in near[0].reason


def test_results_repeat_bit_for_bit() -> None:
    """The same recording gives the same legs."""
    scene = Scene(table=TABLE, walls=ROOM, circles=[(*p, 0.025) for p in four(Scene(table=TABLE))])
    given = drive(scene, np.random.default_rng(1), scans_between=4, scans_per_stop=4)
    first = find_legs(*given, config=LegsConfig())
    second = find_legs(*given, config=LegsConfig())
    assert [(leg.x, leg.y, leg.dimensions) for leg in first.legs] == [
        (leg.x, leg.y, leg.dimensions) for leg in second.legs
    ]


def test_bare_floor_gives_a_warning_and_no_leg() -> None:
    """Nothing under the top: an empty result that says so."""
    legs = _found(Scene(table=TABLE, walls=ROOM), scans_between=0)
    assert legs.legs == ()
    assert [warning.code for warning in legs.warnings] == ["legs.none_found"]


def test_depth_alone_places_legs_to_a_centimetre() -> None:
    """Without a laser four legs of 6 cm come from the depth below the top, with wider sigmas."""
    scene = Scene(table=TABLE)
    truth = four(scene)
    scene.boxes = [(x, y, 0.06, 0.06, TABLE.yaw) for x, y in truth]
    legs = _found(scene, with_depth=True, laser=False, scans_between=0, scans_per_stop=1)
    assert "legs.no_laser" in [warning.code for warning in legs.warnings]
    assert len(legs.legs) == 4
    assert _errors(legs, truth).max() < 0.015
    assert all(leg.position_sigma and leg.position_sigma >= 0.005 for leg in legs.legs)


def test_one_stop_is_enough_for_no_crash() -> None:
    """A single view ends in a result, whatever it holds."""
    scene = Scene(table=TABLE, walls=ROOM, circles=[(*p, 0.025) for p in four(Scene(table=TABLE))])
    legs = _found(scene, stops=1)
    assert len(legs.legs) <= 4
