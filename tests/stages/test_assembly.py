"""Doubts of an earlier stage that a later one answers."""

from __future__ import annotations

import numpy as np
import pytest

from tablemap.errors import ProcessWarning
from tablemap.stages.assembly import with_legs
from tablemap.stages.legs import Leg

DOUBT = ProcessWarning("accuracy.hardly_table", "segmentation", "It is probably no table.")
OTHER = ProcessWarning("segmentation.table_tie", "segmentation", "There are two.")


def _leg(status: str) -> Leg:
    return Leg(
        shape="circle",
        x=0.0,
        y=0.0,
        yaw=0.0,
        status=status,
        position_sigma=0.001,
        dimensions={},
        points=np.zeros((0, 2)),
        views=3,
        seen_by="laser",
    )


def test_four_measured_legs_make_a_table_of_a_closed_front() -> None:
    """A cloth that hangs down to the seats is noted and not doubted; other warnings stay."""
    cloth, other = with_legs([DOUBT, OTHER], [_leg("measured")] * 4)
    assert cloth.code == "segmentation.cloth"
    assert "4 legs" in cloth.message
    assert other is OTHER


@pytest.mark.parametrize(
    "legs", [[], [_leg("measured")] * 3, [_leg("measured")] * 3 + [_leg("inferred")]]
)
def test_a_box_stays_doubted(legs: list[Leg]) -> None:
    """Fewer legs may be feet of a box, or things before it."""
    assert list(with_legs([DOUBT], legs)) == [DOUBT]
