"""A level that reaches beyond the top all round is the table's; what lies on it is a cushion."""

from __future__ import annotations

import numpy as np
import pytest

from tests.making.leg_scenes import TABLE, Scene, four, legs_of

BOARDS: dict[str, tuple[tuple[float, ...], bool]] = {
    "the rim of a bench under a cushion": ((0.0, 0.0, 1.4, 0.6, 0.42, 0.45), True),
    "the rim of a thick bench": ((0.0, 0.0, 1.44, 0.64, 0.1, 0.43), True),
    "a leaf at one end": ((0.6, 0.0, 0.3, 0.54, 0.42, 0.45), False),
    "a board that is smaller than the top": ((0.0, 0.0, 1.3, 0.5, 0.42, 0.45), False),
}


@pytest.mark.parametrize("name", BOARDS)
def test_only_a_level_all_round_is_doubted(name: str) -> None:
    """It is doubted whether the top is the table's, and the message says how much lower that is."""
    (x, y, *sides), expected = BOARDS[name]
    scene = Scene(table=TABLE, length=1.34, width=0.54, height=0.5)
    scene.boxes = [(*TABLE.apply(np.array([x, y])), *sides[:2], TABLE.yaw, *sides[2:])]
    scene.circles = [(*place, 0.025) for place in four(scene)]
    found = [
        warning
        for warning in legs_of(scene, with_depth=True).warnings
        if warning.code == "accuracy.two_levels"
    ]
    assert len(found) == expected
    if expected:
        lower = 1000 * (scene.height - sides[-1])
        said = float(found[0].message.split(" mm lower")[0].split()[-1])
        assert said == pytest.approx(lower, abs=5)
        (place,) = found[0].places
        assert place.height == pytest.approx(sides[-1], abs=0.005)
        spread = np.ptp(TABLE.inverse().apply(np.array(place.points)), axis=0)
        assert spread == pytest.approx(sides[:2], abs=0.08)
