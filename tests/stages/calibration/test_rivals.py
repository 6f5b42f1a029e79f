"""Rare errors of the camera, each an explanation of its own, as floor and top leave them."""

from __future__ import annotations

import numpy as np
import pytest

from tablemap.config import CalibrationConfig, SensorsConfig
from tablemap.stages.calibration import (
    CAMERA_HEIGHT,
    TOP_DEPTH,
    Calibration,
    Rival,
    calibrate,
)
from tests.making.round_trips import mounting, round_trip

HEIGHT = 0.74


def seen_from(raised: float, sensors: SensorsConfig) -> Calibration:
    """Calibrate on a floor that was seen from higher than TF says, metres."""
    recorded = mounting()
    true = recorded.copy()
    true[2, 3] += raised
    views = round_trip([], (0.0, 0.0), mount=true, recorded_mount=recorded)
    return calibrate(views, config=CalibrationConfig(), sensors=sensors)


def of_cause(result: Calibration, cause: str) -> Rival:
    """Return one of the explanations."""
    (rival,) = [r for r in result.top_belief(HEIGHT).rivals if r.cause == cause]
    return rival


@pytest.mark.parametrize("raised", [-0.02, 0.0, 0.02])
def test_a_camera_that_sits_elsewhere_is_explained_as_by_a_looser_belief(raised: float) -> None:
    """Height and distance under it are those of a calibration that believes TF to 20 mm."""
    tight = seen_from(raised, SensorsConfig())
    loose = seen_from(raised, SensorsConfig(camera_height_sigma=0.02))
    rival = of_cause(tight, CAMERA_HEIGHT)
    usual = loose.top_belief(HEIGHT).covariance[:2, :2]
    np.testing.assert_allclose(rival.covariance, usual, rtol=0.05)  # the drop is another

    def top(result: Calibration) -> float:
        camera = float(result.snapshots[0].base_from_camera[2, 3])
        return camera + (HEIGHT - mounting()[2, 3] - raised) * result.depth_scale

    assert top(tight) + rival.shift[0] == pytest.approx(top(loose), abs=0.0005)


def test_a_floor_that_reads_too_far_speaks_for_a_higher_camera() -> None:
    """The more the depth scale must give way to TF, the likelier TF is wrong."""
    weights = [
        of_cause(seen_from(raised, SensorsConfig()), CAMERA_HEIGHT).log_weight
        for raised in (0.0, 0.01, 0.02)
    ]
    assert weights == sorted(weights)
    assert weights[2] > weights[0] + 1


def test_a_top_that_reads_elsewhere_errs_in_height_and_distance_alike() -> None:
    """A centimetre of depth lowers the top by what it lies farther away."""
    result = seen_from(0.0, SensorsConfig())
    camera = result.snapshots[0].base_from_camera
    more = of_cause(result, TOP_DEPTH).covariance - of_cause(result, "").covariance
    lower, drop = 0.01 * camera[2, 2], camera[2, 3] - HEIGHT
    np.testing.assert_allclose(
        more, lower**2 * np.array([[1, -1 / drop], [-1 / drop, drop**-2]]), rtol=0.01
    )


def test_a_camera_whose_height_is_open_anyway_has_no_rival_of_it() -> None:
    """Where TF is believed to centimetres, as of a camera in a hand, nothing rare is left."""
    causes = {
        r.cause
        for r in seen_from(0.0, SensorsConfig(camera_height_sigma=0.03)).top_belief(HEIGHT).rivals
    }
    assert causes == {"", TOP_DEPTH}
