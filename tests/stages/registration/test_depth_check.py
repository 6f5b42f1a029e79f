"""Views registered by depth are held against each other: a wrong place is noticed, and mended."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from tablemap.config import RegistrationConfig, SensorsConfig
from tablemap.geometry import Pose2
from tablemap.stages.registration.depth.check import check_views
from tablemap.stages.registration.depth.edges import lay_edges
from tablemap.stages.registration.depth.search import search_failed
from tablemap.stages.registration.graph import GraphEdge
from tests.making.rooms import relative_errors
from tests.making.seen_tops import VIEWS, chain, disc, moved, rectangle

CONFIG = RegistrationConfig()
SENSORS = SensorsConfig()


def test_right_views_agree() -> None:
    """Views within their noise of the truth all pass, and all agree."""
    top = rectangle()
    wobble = np.random.default_rng(1).normal(0, 1, top.poses.shape) * [0.003, 0.003, 0.002]
    checked = top.check(top.poses + wobble)
    assert checked.passed == VIEWS
    assert all(check.statistics.agreeing == 1.0 for check in checked.checks)


@pytest.mark.parametrize(
    "step", [Pose2(0.08, 0, 0), Pose2(0, 0.08, 0), Pose2(0, 0, 0.08), Pose2(0.3, 0.1, 0.2)]
)
def test_a_view_in_a_wrong_place_fails_alone(step: Pose2) -> None:
    """Eight centimetres or five degrees are noticed, with a reason, and held against that view."""
    top = rectangle()
    checked = top.check(moved(top.poses, [3], step))
    assert [check.index for check in checked.checks if not check.passed] == [3]
    assert checked.checks[3].reasons


def test_two_halves_that_contradict_each_other_leave_nothing_to_trust() -> None:
    """Where no greater half agrees, no view is believed, however well each half fits itself."""
    top = rectangle()
    half = Pose2(0.25, -0.2, 0.26)
    poses = top.poses.copy()
    for i in range(VIEWS // 2):
        poses[i] = (half @ Pose2.from_array(poses[i])).as_array()
    assert top.check(poses).passed == 0


def test_views_without_edges_say_nothing() -> None:
    """Without an outline there is nothing to check, and no statistic is invented."""
    checked = check_views(None, (None,) * 3, np.zeros((3, 3)))
    assert checked.passed == 3
    assert all(check.statistics is None for check in checked.checks)


def test_a_jump_halfway_is_mended_by_searching() -> None:
    """Half of the views 30 cm and 15 degrees off: found again, to millimetres."""
    top = rectangle()
    jump = Pose2(0.3, -0.2, np.radians(15))
    poses = top.poses.copy()
    for i in range(VIEWS // 2, VIEWS):
        poses[i] = (jump @ Pose2.from_array(poses[i])).as_array()
    held = chain(poses)
    laid = lay_edges(top.edges, poses, held, CONFIG, SENSORS)
    laid, checked, found = search_failed(
        top.outline, top.edges, held, laid, top.check(laid.polished.poses), CONFIG, SENSORS
    )
    place, yaw = relative_errors(laid.polished.poses, top.poses)
    assert checked.passed == VIEWS
    assert found
    assert place.max() < 0.005
    assert np.degrees(yaw).max() < 0.3


def test_a_round_top_gives_no_heading_to_a_lost_view() -> None:
    """A lost view of a round top fits anywhere about it: it stays unused."""
    top = disc()
    poses = moved(top.poses, [5], Pose2(0.3, 0.2, 0.3))
    laid = lay_edges(top.edges, poses, [], replace(CONFIG, gates=(0.03,)), SENSORS)
    checked = top.check(laid.polished.poses)
    assert not checked.checks[5].passed
    _, after, found = search_failed(top.outline, top.edges, [], laid, checked, CONFIG, SENSORS)
    assert found == ()
    assert not after.checks[5].passed


def test_a_wrong_pair_that_the_edges_contradict_is_let_go() -> None:
    """One false closure among right constraints is dropped and bends nothing."""
    top = rectangle()
    wrong = Pose2.from_array(top.poses[0]).inverse() @ Pose2.from_array(top.poses[5])
    false = GraphEdge(5, 0, wrong @ Pose2(0.15, 0.1, 0.1), np.diag([1e4, 1e4, 4e4]), robust=16.0)
    held = [*chain(top.poses), false]
    laid = lay_edges(top.edges, top.poses, held, CONFIG, SENSORS)
    place, _ = relative_errors(laid.polished.poses, top.poses)
    assert laid.kept.tolist() == [True] * (VIEWS - 1) + [False]
    assert place.max() < 0.004
