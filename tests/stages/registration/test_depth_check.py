"""Views registered by depth are held against each other: a wrong place is noticed, and mended."""

from __future__ import annotations

import numpy as np
import pytest

from tablemap.config import RegistrationConfig, SensorsConfig
from tablemap.geometry import Floats, Pose2
from tablemap.stages.outline import EdgeKind, Outline, ViewEdges
from tablemap.stages.registration.depth.check import Checked, check_views
from tablemap.stages.registration.depth.edges import lay_edges, table_edges
from tablemap.stages.registration.depth.search import search_failed
from tablemap.stages.registration.graph import Edge
from tests.making.rooms import relative_errors

CONFIG = RegistrationConfig()
SENSORS = SensorsConfig()
VIEWS = 8


class Seen:
    """A top as eight views round it see it: its edge every centimetre, votes every two."""

    def __init__(self, ring: Floats, normals: Floats, *, seed: int = 0) -> None:
        """Place the views 1.4 m from the middle, looking at it; ``ring`` (n, 2) is the edge."""
        rng = np.random.default_rng(seed)
        angle = np.arange(VIEWS) * 2 * np.pi / VIEWS
        self.poses = np.stack([1.4 * np.cos(angle), 1.4 * np.sin(angle), angle + np.pi], axis=1)
        axis = np.arange(-1.2, 1.2, 0.02)
        grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
        # Convex tops: a point lies inside where it is behind every edge.
        inside = ((grid[:, None] - ring[None, ::5]) * normals[None, ::5]).sum(-1).max(1) < 0
        views = []
        for i, pose in enumerate(self.poses):
            base = Pose2.from_array(pose).inverse()
            noise = rng.normal(0, 0.002, (len(ring), 1)) * normals
            views.append(
                ViewEdges(
                    index=i,
                    points=base.apply(ring + noise),
                    normals=base.rotate(normals),
                    sigma=np.full(len(ring), 0.002),
                    kind=np.full(len(ring), EdgeKind.TABLE, dtype=np.uint8),
                    is_near=np.zeros(len(ring), dtype=bool),
                    pixels=np.zeros((len(ring), 2)),
                    camera_xy=np.zeros(2),
                    top=base.apply(grid[inside]),
                    free=base.apply(grid[~inside]),
                )
            )
        self.outline = Outline(tuple(views), 0.7, 0.001, {}, None, None, ())
        self.edges = table_edges([_Indexed(i) for i in range(VIEWS)], self.outline)  # type: ignore[misc]

    def check(self, poses: Floats) -> Checked:
        """Check the views at other poses."""
        return check_views(self.outline, self.edges, poses)


class _Indexed:
    def __init__(self, index: int) -> None:
        self.index = index


def rectangle(length: float = 1.2, width: float = 0.8) -> Seen:
    """A rectangular top."""
    parts, normals = [], []
    for reach, along, normal in (
        (length / 2, width, (1, 0)),
        (length / 2, width, (-1, 0)),
        (width / 2, length, (0, 1)),
        (width / 2, length, (0, -1)),
    ):
        n = np.array(normal, dtype=np.float64)
        t = np.arange(-along / 2, along / 2, 0.01)[:, None]
        parts.append(n * reach + t * n[::-1])
        normals.append(np.tile(n, (len(t), 1)))
    return Seen(np.concatenate(parts), np.concatenate(normals))


def disc(diameter: float = 0.6) -> Seen:
    """A round top."""
    angle = np.arange(0, 2 * np.pi, 0.02)
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return Seen(diameter / 2 * normals, normals)


def moved(poses: Floats, which: list[int], step: Pose2) -> Floats:
    """Return the poses with some of them moved in their own base."""
    result = poses.copy()
    for i in which:
        result[i] = (Pose2.from_array(poses[i]) @ step).as_array()
    return result


def chain(poses: Floats, sigma: float = 0.03) -> list[Edge]:
    """Tie each view to the one before it where ``poses`` have them."""
    information = np.diag(1 / np.square([sigma, sigma, sigma]))
    return [
        Edge(
            i,
            i - 1,
            Pose2.from_array(poses[i - 1]).inverse() @ Pose2.from_array(poses[i]),
            information,
        )
        for i in range(1, len(poses))
    ]


def test_right_views_agree() -> None:
    """Views within their noise of the truth all pass, and all agree."""
    top = rectangle()
    wobble = np.random.default_rng(1).normal(0, 1, top.poses.shape) * [0.003, 0.003, 0.002]
    checked = top.check(top.poses + wobble)
    assert checked.passed == VIEWS
    assert all(check.statistics["agreeing"] == 1.0 for check in checked.checks)


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
    assert all(not check.statistics for check in checked.checks)


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
    laid = lay_edges(top.edges, poses, [], CONFIG.model_copy(update={"gates": (0.03,)}), SENSORS)
    checked = top.check(laid.polished.poses)
    assert not checked.checks[5].passed
    _, after, found = search_failed(top.outline, top.edges, [], laid, checked, CONFIG, SENSORS)
    assert found == ()
    assert not after.checks[5].passed


def test_a_wrong_pair_that_the_edges_contradict_is_let_go() -> None:
    """One false closure among right constraints is dropped and bends nothing."""
    top = rectangle()
    wrong = Pose2.from_array(top.poses[0]).inverse() @ Pose2.from_array(top.poses[5])
    false = Edge(5, 0, wrong @ Pose2(0.15, 0.1, 0.1), np.diag([1e4, 1e4, 4e4]), robust=16.0)
    held = [*chain(top.poses), false]
    laid = lay_edges(top.edges, top.poses, held, CONFIG, SENSORS)
    place, _ = relative_errors(laid.polished.poses, top.poses)
    assert laid.kept.tolist() == [True] * (VIEWS - 1) + [False]
    assert place.max() < 0.004
