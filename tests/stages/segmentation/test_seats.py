"""A seat that is seen better than its table is not taken without a word."""

from __future__ import annotations

import numpy as np
import pytest

from tablemap.stages.segmentation import TableCandidate
from tablemap.stages.segmentation.candidates import seats_beside


def _surface(x: float, side: float, height: float, *, is_closed: bool = False) -> TableCandidate:
    """Return a level square."""
    hull = np.array([[x, 0.0], [x + side, 0.0], [x + side, side], [x, side]])
    return TableCandidate(
        x + side / 2, side / 2, height, side**2, (0,), 0.0, 1.0, hull, True, None, is_closed
    )


@pytest.mark.parametrize(
    ("seat", "table", "expected"),
    [
        (_surface(0.0, 0.43, 0.45), _surface(0.6, 0.3, 0.71), True),
        (_surface(0.0, 0.43, 0.45), _surface(1.2, 0.3, 0.71), False),
        (_surface(0.0, 0.43, 0.45), _surface(0.6, 0.3, 0.95), False),
        (_surface(0.0, 0.43, 0.45), _surface(0.6, 0.3, 0.71, is_closed=True), False),
        (_surface(0.0, 0.70, 0.45), _surface(0.8, 0.3, 0.71), False),
    ],
    ids=["seat", "far away", "too high", "a cupboard", "as large as a table"],
)
def test_a_small_low_surface_beside_a_higher_one_may_be_a_seat(
    seat: TableCandidate, table: TableCandidate, expected: bool
) -> None:
    """However small a part of the higher one was seen."""
    assert seats_beside(seat, table) == expected
