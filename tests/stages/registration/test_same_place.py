"""Views that a turning head took from one place are one witness of where that place is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tablemap.geometry import Floats, Pose2
from tablemap.stages.registration.laser.check import check_stops
from tablemap.stages.registration.placement import place_in_map
from tests.making.registered_laps import carried, run, small


def test_views_from_one_place_are_placed_once() -> None:
    """Four places seen thrice each leave as much open in the map as seen once."""
    random = np.random.default_rng(2)
    once = np.array([[1.0, 0, 0], [0, 1, 1.6], [-1, 0, 3.1], [0, -1, -1.6]])
    localised = once + random.normal(0, [0.05, 0.05, 0.03], once.shape)
    fit, covariance = place_in_map(once, localised)
    wander = np.repeat(localised, 3, axis=0)
    wander[np.arange(12) % 3 > 0] += random.normal(0, 0.004, (8, 3))
    again, thrice = place_in_map(np.repeat(once, 3, axis=0), wander)
    assert again.as_array() == pytest.approx(fit.as_array(), abs=1e-9)
    assert thrice == pytest.approx(covariance)


def test_one_place_is_known_as_well_as_one_localised_pose() -> None:
    """However often the head turned there: 5 cm."""
    poses = np.tile([0.4, -0.2, 0.7], (5, 1))
    fit, covariance = place_in_map(np.zeros((5, 3)), poses)
    assert fit.as_array() == pytest.approx(poses[0])
    assert np.sqrt(covariance[0, 0]) == pytest.approx(0.05)


def test_views_from_one_place_do_not_vouch_for_each_other() -> None:
    """A stop misplaced by half a metre fails its check although its other view agrees with it."""
    drive = small(0)
    registration, _ = run(drive, carried(drive))
    scans = list(registration.stop_scans)
    poses: Floats = np.array([pose.as_array() for pose in registration.map_from_base])
    twin = replace(scans[0], index=len(scans))
    pairs = [(i, k) for i in range(len(scans) + 1) for k in range(i)]
    right = check_stops([*scans, twin], np.vstack([poses, poses[0]]), pairs)
    assert all(check.passed for check in right)
    wrong = (Pose2(0.5, -0.3, 0.7) @ Pose2.from_array(poses[0])).as_array()
    moved = np.vstack([wrong, poses[1:], wrong])
    checks = check_stops([*scans, twin], moved, pairs)
    assert not checks[0].passed
    assert not checks[-1].passed
