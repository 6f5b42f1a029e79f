"""The height follows what edges and depth say of the top, and doubts where they differ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tablemap.config import SensorsConfig, SurfaceConfig
from tablemap.geometry import Pose2
from tablemap.stages.calibration import CAMERA_HEIGHT, TOP_DEPTH, Rival, TopBelief
from tablemap.stages.surface import Surface, fit_surface
from tests.making.edges import Bench, box_table, observe

DROP = 0.4  # metres from the camera down to the top, in the made views
BELIEVED = np.diag([0.0015, 0.003]) ** 2
CAMERA = BELIEVED + np.outer([0.016, 0.014], [0.016, 0.014])  # a camera that sits high or low
TOP = BELIEVED + np.outer([-0.006, 0.015], [-0.006, 0.015])  # a top that reads near or far


def fitted(farther: float, camera_weight: float = 0.03) -> Surface:
    """Fit edges that put the top farther from the camera than depth did, by a share."""
    outline, registration = observe(
        box_table(1.2, 0.8, Pose2()), replace(Bench(), scale_sigma=0.0), np.random.default_rng(3)
    )
    views = tuple(
        replace(v, points=v.camera_xy + (v.points - v.camera_xy) / (1 + farther))
        for v in outline.views
    )
    covariance = np.zeros((4, 4))
    covariance[:2, :2], covariance[2:, 2:] = BELIEVED, np.eye(2) * 0.0005**2
    camera = TopBelief(
        covariance,
        view_tilt=0.0005,
        view_lift=0.0005,
        lean=(0.0, 0.0),
        view_shift=0.0,
        is_held=False,
        rivals=(
            Rival("", np.zeros(2), BELIEVED, float(np.log(0.94))),
            Rival(TOP_DEPTH, np.zeros(2), TOP, float(np.log(0.03))),
            Rival(CAMERA_HEIGHT, np.zeros(2), CAMERA, float(np.log(camera_weight))),
        ),
    )
    seen = replace(outline, views=views, camera=camera, height=0.74, height_sigma=0.0016)
    return fit_surface(seen, registration, config=SurfaceConfig(), sensors=SensorsConfig(), seed=0)


def codes(surface: Surface) -> set[str]:
    """Codes of a surface's warnings."""
    return {warning.code for warning in surface.warnings}


def test_edges_that_agree_leave_the_height_and_its_sigma() -> None:
    """Within what is believed of the camera, the rare errors hardly count."""
    for share in (-0.002, 0.0, 0.002):
        surface = fitted(share)
        assert surface.height.value == pytest.approx(0.74, abs=0.0005)
        assert surface.height.sigma == pytest.approx(0.0016, abs=0.0004)
        assert "accuracy.top_distance" not in codes(surface)


@pytest.mark.parametrize("share", [-0.02, 0.02])
def test_a_likelier_camera_height_moves_the_top_with_the_camera(share: float) -> None:
    """If floor and TF speak for it, the height follows the whole way, and the run is doubted."""
    surface = fitted(share, camera_weight=0.6)
    expected = 0.74 + share * 0.016 / 0.014
    assert surface.height.value == pytest.approx(expected, abs=0.006)
    assert surface.height.sigma is not None
    assert abs(surface.height.value - expected) < 2 * surface.height.sigma
    (warning,) = [w for w in surface.warnings if w.code == "accuracy.top_distance"]
    assert ("farther from" if share > 0 else "nearer to") in warning.message
    assert warning.message.index("as high as TF says") < warning.message.index("dark or glossy")


@pytest.mark.parametrize("share", [-0.02, 0.02])
def test_causes_that_nothing_tells_apart_widen_the_height(share: float) -> None:
    """One would lift the top, the other lower it: the sigma holds both."""
    surface = fitted(share)
    assert surface.height.sigma is not None
    for truth in (0.74 + share * 0.016 / 0.014, 0.74 - share * 0.006 / 0.015):
        assert abs(surface.height.value - truth) < 2 * surface.height.sigma
    assert "accuracy.top_distance" in codes(surface)
    assert surface.height.budget is not None
    assert sum(surface.height.budget.values()) == pytest.approx(surface.height.sigma**2)
