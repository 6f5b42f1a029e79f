"""Where the laser leaves a stop open, depth ties it to the others, or it is not used."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tablemap.config import Config
from tablemap.events import ignore
from tablemap.geometry import Pose2
from tablemap.recording import open_recording
from tablemap.stages.calibration import calibrate
from tablemap.stages.odometry import estimate_odometry
from tablemap.stages.registration import Pair, Registration, StopCheck, register
from tablemap.stages.registration.laser.joined import checked_by_depth, open_stops
from tablemap.stages.snapshots import Snapshot, take_snapshots
from tests.making.registered_laps import no_edges
from tests.making.rooms import relative_errors

BLIND = 2


class Gap:
    """A recording whose laser was silent while a snapshot was taken."""

    def __init__(self, recording: Any, snapshot: Snapshot) -> None:
        self._recording = recording
        self._silent = (snapshot.start_ns - 10**9, snapshot.end_ns + 10**9)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._recording, name)

    def scans(self, *span: int, **due: Any) -> Any:
        """Yield what lies outside of the gap."""
        first, last = self._silent
        return (s for s in self._recording.scans(*span, **due) if not first < s.stamp_ns < last)


@pytest.fixture(scope="module")
def gap(demo_recording: Path) -> tuple[Registration, np.ndarray]:
    """The demo with one stop's scans taken out, registered, and its true poses."""
    config = Config()
    recording = open_recording(demo_recording)
    taken = take_snapshots(recording, config=config.snapshots, sensors=config.sensors).snapshots
    snapshots = calibrate(taken, config=config.calibration, sensors=config.sensors).snapshots
    cut: Any = Gap(recording, snapshots[BLIND])
    odometry = estimate_odometry(
        cut, snapshots, config=config.odometry, sensors=config.sensors, record=ignore
    )
    registration = register(
        cut,
        snapshots,
        odometry,
        edges=no_edges,
        config=config.registration,
        sensors=config.sensors,
        record=ignore,
    )
    truth = json.loads(demo_recording.with_suffix(".truth.json").read_text())["snapshots"]
    at = {each["stamp_ns"]: each["map_from_base"] for each in truth}
    poses = [[at[s.stamp_ns][key] for key in ("x", "y", "yaw")] for s in snapshots]
    return registration, np.array(poses)


def test_a_stop_without_a_scan_is_placed_by_depth(gap: tuple[Registration, np.ndarray]) -> None:
    """It comes out within 1.5 cm, says so by its sigma, and leaves the others alone."""
    registration, truth = gap
    poses = np.array([pose.as_array() for pose in registration.map_from_base])
    place, _ = relative_errors(poses, truth)
    sigma = np.sqrt(np.diag(registration.covariance)).reshape(-1, 3)[:, :2].max(axis=1)
    assert all(registration.used)
    assert place[BLIND] < min(0.015, 4 * sigma[BLIND])
    assert sigma[BLIND] > 2 * np.delete(sigma, BLIND).max()
    assert np.delete(place, BLIND).max() < 0.004
    (warning,) = [w for w in registration.warnings if w.code == "registration.no_scan"]
    assert "depth connects it" in warning.message
    joined = [pair for pair in registration.pairs if pair.kind in ("depth", "loop")]
    assert joined
    assert all(BLIND in (pair.source, pair.target) for pair in joined)


def test_only_what_the_laser_leaves_loose_asks_for_depth(
    gap: tuple[Registration, np.ndarray],
) -> None:
    """A stop without a scan does, one that slides along a corridor does, one held does not."""
    stops = list(gap[0].stop_scans[:3])
    held, sliding = np.square([0.001, 0.001, 0.0005]), np.square([0.001, 0.05, 0.0005])
    covariance = np.diag(np.concatenate([held, sliding, held]))
    assert open_stops(stops, covariance) == [1]
    assert open_stops([None, *stops[1:]], covariance) == [0, 1]


def test_depth_that_agrees_with_one_view_only_proves_nothing() -> None:
    """Two partners that the graph kept are the least; the reason says what there was."""
    pair = Pair(2, 1, "depth", Pose2(), np.eye(3), 0.3, 0.01, 100, True, None)
    check = StopCheck(2, False, None, ("it has no usable laser scan",))
    alone = checked_by_depth(check, [pair, replace(pair, target=0, used=False, reason="off")])
    assert not alone.passed
    assert "agrees with 1 other" in alone.reasons[-1]
    assert checked_by_depth(check, [pair, replace(pair, target=0)]).passed
