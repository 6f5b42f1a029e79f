"""What odometry says is reported as used only as far as the poses that come out agree with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tablemap.geometry import Pose2
from tablemap.stages.registration.depth.held import odometry_report
from tablemap.stages.registration.graph import solve_graph
from tests.making.seen_tops import chain, moved, rectangle


def test_odometry_that_the_last_poses_contradict_is_not_called_used() -> None:
    """A view that was found half a metre off after the graph takes both its steps with it."""
    poses = rectangle().poses
    edges = [replace(edge, robust=16.0) for edge in chain(poses)]
    graph = solve_graph(poses, edges, [])
    assert all(pair.used for pair in odometry_report(edges, graph, poses))
    found = moved(poses, [4], Pose2(0.4, 0.3, 0.0))
    report = odometry_report(edges, graph, found)
    dropped = [(pair.source, pair.target) for pair in report if not pair.used]
    assert dropped == [(4, 3), (5, 4)]
    assert all(pair.reason for pair in report if not pair.used)


def test_no_odometry_is_no_report() -> None:
    """A single view has no steps."""
    graph = solve_graph(np.zeros((1, 3)), [], [])
    assert odometry_report([], graph, np.zeros((1, 3))) == []
