"""Headings of views registered by depth: confirmed by something, or not claimed to be known."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from tablemap.geometry import Floats, Pose2
from tablemap.recording.messages import Image
from tablemap.stages.registration.depth.check import Checked
from tablemap.stages.registration.depth.cloud import upright_cloud
from tablemap.stages.registration.depth.heading import check_headings
from tablemap.stages.registration.depth.sight import UprightSight, make_sight
from tablemap.stages.registration.result import StopCheck
from tablemap.stages.snapshots import Camera, Snapshot
from tests.making.casting import Box, cast_level
from tests.making.seen_tops import VIEWS, Seen, disc, rectangle

RANGE = 3.5
CAMERA = Camera(240, 120, 160.0, 160.0, 119.5, 59.5)
LEVEL = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0.6], [0, 0, 0, 1]], dtype=np.float64)
WHEELS = [(i, i - 1) for i in range(1, VIEWS)]


BOXES = [(1.7, 0.5, 0.35), (-0.4, 1.7, 0.3), (-1.7, -0.9, 0.4), (0.7, -1.75, 0.25)]
BOXES += [(-1.75, 0.8, 0.25), (1.3, 1.4, 0.2), (-0.6, -1.7, 0.2)]


def square(x: float, y: float, side: float) -> Floats:
    """The four walls (4, 4) of something square that stands in the room."""
    return Box(x, y, side, side).sides()


ROOM = np.concatenate([square(0, 0, 3.8), *(square(*each) for each in BOXES)])


def sight(pose: Floats, walls: Floats) -> UprightSight:
    """What a level camera at a pose sees of upright walls (n, 4)."""
    base = Pose2.from_array(pose)
    ahead = np.stack([np.ones(CAMERA.width), -CAMERA.rays[0, :, 0]], axis=1)
    image = np.tile(cast_level(walls, base.translation, base.rotate(ahead)), (CAMERA.height, 1))
    image[~np.isfinite(image)] = np.nan
    image += np.random.default_rng(0).normal(0, 0.004, image.shape)
    snapshot = Snapshot(
        index=0,
        stamp_ns=0,
        start_ns=0,
        end_ns=0,
        images=1,
        depth=image.astype(np.float32),
        camera=CAMERA,
        base_from_camera=LEVEL,
        map_from_base=Pose2(0, 0, 0),
        odom_from_base=None,
        depth_message=cast(Image, None),
        colour_message=None,
    )
    cloud = upright_cloud(snapshot, maximum_range=RANGE)
    assert cloud is not None
    return make_sight(snapshot, cloud, maximum_range=RANGE)


@pytest.fixture(scope="module")
def room() -> dict[int, UprightSight]:
    """What the eight views see of a room with boxes along its walls."""
    return {i: sight(pose, ROOM) for i, pose in enumerate(disc().poses)}


def turned(poses: Floats, which: list[int], degrees: list[float]) -> Floats:
    """Return the poses with some of them turned about the middle of the table."""
    result = poses.copy()
    for i, turn in zip(which, degrees, strict=True):
        result[i] = (Pose2(0, 0, np.radians(turn)) @ Pose2.from_array(poses[i])).as_array()
    return result


def check(
    top: Seen, sights: dict[int, UprightSight], poses: Floats, ties: list[tuple[int, int]]
) -> tuple[list[int], list[int], list[str]]:
    """Return the views that failed, those whose heading is tied, and the warnings' codes."""
    checks, warnings = check_headings(top.check(poses), sights, top.edges, poses, ties)
    failed = [c.index for c in checks if not c.passed]
    assert all(checks[i].reasons for i in failed)
    tied = [c.index for c in checks if c.statistics.heading_tied]
    return failed, tied, [warning.code for warning in warnings]


def test_a_room_confirms_the_headings_round_a_round_table(room: dict[int, UprightSight]) -> None:
    """Right views of a round top, without wheels: what stands behind it ties all of them."""
    top = disc()
    wobble = np.random.default_rng(1).normal(0, 1, top.poses.shape) * [0.004, 0.004, 0.003]
    assert check(top, room, top.poses + wobble, []) == ([], list(range(VIEWS)), [])


@pytest.mark.parametrize("degrees", [-20.0, -10.0, 10.0])
def test_a_view_turned_about_a_round_table_fails_alone(
    room: dict[int, UprightSight], degrees: float
) -> None:
    """Its edges fit as before; what it sees behind the table does not."""
    top = disc()
    poses = turned(top.poses, [3], [degrees])
    assert top.check(poses).passed == VIEWS
    failed, tied, codes = check(top, room, poses, [])
    assert failed == [3]
    assert tied == [0, 1, 2, 4, 5, 6, 7]
    assert codes == []


def test_views_turned_at_random_about_a_round_table_are_not_believed(
    room: dict[int, UprightSight],
) -> None:
    """Nothing is left that could pass for known: each view fails, or is named as unconfirmed."""
    top = disc()
    poses = turned(top.poses, list(range(VIEWS)), [10, -8, 12, 0, -12, 9, -10, 14])
    assert top.check(poses).passed == VIEWS
    failed, tied, codes = check(top, room, poses, [])
    assert len(failed) >= VIEWS // 2
    assert tied == []
    assert codes == ["accuracy.registration_unchecked"] or len(failed) == VIEWS


def test_a_round_table_in_an_empty_hall_needs_wheels() -> None:
    """Without anything upright in sight the headings are unconfirmed; wheels confirm them."""
    top = disc()
    unconfirmed = check(top, {}, top.poses, [])
    assert unconfirmed == ([], [], ["accuracy.registration_unchecked"])
    assert check(top, {}, top.poses, WHEELS) == ([], list(range(VIEWS)), [])


def test_corners_confirm_the_headings_by_themselves() -> None:
    """A rectangular top in an empty hall needs neither wheels nor uprights."""
    top = rectangle()
    assert check(top, {}, top.poses, []) == ([], list(range(VIEWS)), [])


def test_who_walks_through_the_room_fails_no_view(room: dict[int, UprightSight]) -> None:
    """Somebody stood before the boxes in two of the views; the top's corners outvote that."""
    top = rectangle()
    people = {
        i: sight(top.poses[i], np.concatenate([ROOM, square(x, y, 0.4)]))
        for i, x, y in ((2, 0.3, -1.2), (5, 0.9, 0.9))
    }
    failed, tied, codes = check(top, {**room, **people}, top.poses, [])
    assert (failed, tied, codes) == ([], list(range(VIEWS)), [])


def test_a_single_view_is_left_alone() -> None:
    """One view has no heading relative to others, and no warning speaks of it."""
    checked = Checked((StopCheck(0, True, None, ()),), frozenset())
    assert check_headings(checked, {}, (None,), np.zeros((1, 3)), []) == (checked.checks, ())
