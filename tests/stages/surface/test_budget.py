"""A figure's variance is a sum of named parts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tablemap.config import SensorsConfig, SurfaceConfig
from tablemap.geometry import Pose2
from tablemap.stages.calibration import FloorStep, TopBelief
from tablemap.stages.surface import FittedFigure, Surface, fit_surface
from tablemap.stages.surface.budget import PARTS
from tests.making.edges import Bench, box_table, observe

TABLE = box_table(1.2, 0.8, Pose2(0.3, -0.2, 0.4))


def fitted(sensors: SensorsConfig, bench: Bench | None = None) -> Surface:
    """The top of a rectangle, seen from all sides."""
    outline, registration = observe(TABLE, bench or Bench(), np.random.default_rng(2))
    return fit_surface(outline, registration, config=SurfaceConfig(), sensors=sensors, seed=0)


def test_the_parts_add_up_to_the_variance() -> None:
    """Nothing is counted twice and nothing is left out."""
    for figure in fitted(SensorsConfig()).dimensions.values():
        assert figure.sigma is not None
        assert figure.budget is not None
        assert set(figure.budget) == set(PARTS)
        assert min(figure.budget.values()) >= 0.0
        assert sum(figure.budget.values()) == pytest.approx(figure.sigma**2, rel=1e-6)


@pytest.mark.parametrize(
    ("part", "known"),
    [
        ("focal", {"camera_focal_sigma": 1e-6}),
        ("depth", {"calibrated_depth_scale_sigma_surface": 1e-6}),
        ("drive_scale", {"laser_range_scale_sigma": 0.0}),
        ("mount", {"laser_mounting_sigma": 1e-6, "laser_mounting_yaw_sigma": 1e-6}),
    ],
)
def test_what_is_known_has_no_part(part: str, known: dict[str, float]) -> None:
    """A sensor's error that is ruled out beforehand takes its own part away."""
    usual, sure = fitted(SensorsConfig()), fitted(SensorsConfig(**known))
    for name, figure in usual.dimensions.items():
        before, after = figure.budget, sure.dimensions[name].budget
        assert before is not None
        assert after is not None
        assert before[part] > 1e-8
        assert after[part] < 0.01 * before[part]


def test_a_side_seen_in_part_costs_its_share() -> None:
    """Where half of the top's rim is hidden, the figures say that it may go on otherwise."""
    whole = fitted(SensorsConfig())
    hidden = fitted(SensorsConfig(), replace(Bench(), hidden=((0.3, 1.3), (2.2, 3.4))))
    for name in whole.dimensions:
        before, after = whole.dimensions[name].budget, hidden.dimensions[name].budget
        assert before is not None
        if after is not None:
            assert after["share"] > before["share"]


def test_a_rug_costs_the_height_half_its_thickness() -> None:
    """The floor's one level lies somewhere between the rug and what is around it."""
    outline, registration = observe(TABLE, Bench(), np.random.default_rng(2))
    camera = TopBelief(np.diag([1e-6] * 4), 0.0, 0.0, (0.0, 0.0), 0.0, is_held=False)

    def height(step: FloorStep | None) -> FittedFigure:
        found = replace(outline, camera=camera, height_sigma=0.0015).on(step)
        config, sensors = SurfaceConfig(), SensorsConfig()
        return fit_surface(found, registration, config=config, sensors=sensors, seed=0).height

    bare, rug = height(None), height(FloorStep(rise=0.012, area=3.0))
    assert bare.sigma is not None
    assert rug.sigma is not None
    assert rug.budget is not None
    assert rug.budget["floor"] == pytest.approx(0.006**2)
    assert rug.sigma**2 == pytest.approx(bare.sigma**2 + 0.006**2)
