"""A rug under the table is found as a step of the floor; waves, tilts and noise are none."""

from __future__ import annotations

import numpy as np
import pytest

from tablemap.config import CalibrationConfig, SensorsConfig
from tablemap.geometry import Floats
from tablemap.stages.calibration import FloorStep, SeenTop, calibrate, find_step, flatten
from tests.making.casting import Box
from tests.making.round_trips import mounting, round_trip, table, tilted

CENTRE = (1.0, 0.5)


def _found(boxes: list[Box], height: float, **errors: float) -> FloorStep | None:
    """Calibrate by floor and top, and look for a step about the table."""
    true = tilted(mounting(), roll=0.003, pitch=-0.004)
    snapshots = round_trip(boxes, CENTRE, mount=true, recorded_mount=mounting(), views=8, **errors)
    config, sensors = CalibrationConfig(), SensorsConfig()
    rough = calibrate(snapshots, config=config, sensors=sensors)
    z = [snapshot.points_in_base()[..., 2] for snapshot in rough.snapshots]
    masks = {index: np.abs(each - height) < 0.02 for index, each in enumerate(z)}
    result = flatten(rough, SeenTop(height, masks), config=config)
    poses = {snapshot.index: snapshot.map_from_base for snapshot in result.snapshots}
    return find_step(result.snapshots, poses, _top())


def _top() -> Floats:
    grid = np.arange(-0.3, 0.31, 0.05)
    return np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2) + CENTRE


@pytest.mark.parametrize("thickness", [0.010, 0.015])
def test_a_rug_under_the_table_is_a_step(thickness: float) -> None:
    """The rise is that of the rug to 3 mm, and the message says that the table stands higher."""
    legs = [Box(1.0, 0.5, 0.08, 0.08, thickness, 0.71)]
    top = [Box(1.0, 0.5, 0.8, 0.8, 0.71, 0.74)]
    step = _found([Box(1.0, 0.5, 2.0, 1.6, 0.0, thickness, 0.3), *legs, *top], 0.74)
    assert step is not None
    assert step.rise == pytest.approx(thickness, abs=0.003)
    assert step.sigma == pytest.approx(step.rise / 2)
    assert "higher" in step.warning().message


@pytest.mark.parametrize("errors", [{}, {"depth_scale": 1.006}, {"noise": 0.003}])
def test_a_flat_floor_has_no_step(errors: dict[str, float]) -> None:
    """Neither a wrong depth scale, nor noise, nor boxes and feet on the floor look like one."""
    things = [Box(2.2, 0.9, 0.3, 0.2, 0.0, 0.02), Box(1.0, 0.5, 0.6, 0.08, 0.0, 0.05)]
    assert _found([*table(1.0, 0.5, 1.2, 0.8, 0.74, 0.3), *things], 0.74, **errors) is None
