"""Furniture that touches the table at its height is told by its own legs, and taken off."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tablemap.config import SensorsConfig, SurfaceConfig
from tablemap.geometry import Floats, Pose2
from tablemap.stages.legs import Leg, Legs
from tablemap.stages.legs.adjoining import Adjoining, find_adjoining, without
from tablemap.stages.outline import Outline
from tablemap.stages.registration import Registration
from tablemap.stages.surface import Surface, fit_surface
from tests.making.edges import Bench, Table, desk, l_table, observe, polygon_table

SENSORS = SensorsConfig()

POSE = Pose2(0.31, -0.22, 0.37)
TABLE = [(0.06, 0.06), (1.04, 0.06), (1.04, 0.54), (0.06, 0.54)]
STOOL = [(0.44, 0.65), (0.72, 0.65), (0.72, 0.91), (0.44, 0.91)]
# A table of 1.1 by 0.6 m with a stool of 0.36 by 0.36 m at its long side.
STEP = [(0, 0), (1.1, 0), (1.1, 0.6), (0.76, 0.6), (0.76, 0.96), (0.4, 0.96), (0.4, 0.6), (0, 0.6)]
INNER = [(0.4, 0.4), (1.2, 0.4)]  # legs of the desk at its cut-out
TABLE_AND_STOOL = polygon_table([(float(x), float(y)) for x, y in STEP], POSE)


@cache
def seen() -> tuple[Outline, Registration, Surface]:
    """Observe the table with its stool, and fit them as one top."""
    outline, registration = observe(TABLE_AND_STOOL, Bench(), np.random.default_rng(3))
    return (
        outline,
        registration,
        fit_surface(outline, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0),
    )


def standing(places: list[tuple[float, float]], status: str = "measured") -> Legs:
    """Return legs at places in the table's own frame."""
    legs = [
        Leg("circle", float(x), float(y), 0.0, status, 0.001, {}, np.zeros((0, 2)), 4)
        for x, y in POSE.apply(np.array(places))
    ]
    return Legs(tuple(legs), (), np.zeros((0, 2)), ())


def extents(ring: Floats) -> Floats:
    """Return how long and wide a ring is in the table's own frame."""
    spans: Floats = np.ptp(POSE.inverse().apply(ring), axis=0)
    return spans


def test_a_stool_is_taken_off_and_the_table_is_right() -> None:
    """What is left is a rectangle within 4 mm and its sigmas; the stool stays in the result."""
    outline, registration, surface = seen()
    assert surface.shape == "polygon"
    found = find_adjoining(surface, standing(TABLE + STOOL))
    assert found is not None
    assert extents(found.beside) == pytest.approx([0.36, 0.36], abs=0.02)
    left = without(outline, found, registration.map_from_base)
    alone = fit_surface(left, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0)
    assert alone.shape == "rectangle"
    for name, size in (("length", 1.1), ("width", 0.6)):
        figure = alone.dimensions[name]
        assert figure.status == "measured" and figure.sigma is not None
        assert abs(figure.value - size) < min(0.004, 3 * figure.sigma)
    assert alone.beside is not None
    assert [w.code for w in left.warnings] == ["surface.adjoining"]
    assert "0.36 by 0.36 m" in left.warnings[0].message
    assert "4 legs of its own" in left.warnings[0].message


@pytest.mark.parametrize(
    "stool", [STOOL[:3], [(0.58, 0.78)]], ids=["one leg hidden", "a leg in the middle"]
)
def test_a_stool_needs_not_show_four_legs(stool: list[tuple[float, float]]) -> None:
    """Three of four, or a pedestal, tell it."""
    found = find_adjoining(seen()[2], standing(TABLE[:3] + stool))
    assert found is not None
    assert found.legs == len(stool)


def test_the_part_at_the_asked_place_is_the_table() -> None:
    """Whoever names the stool's place gets the stool."""
    x, y = POSE.apply(np.array([[0.6, 0.8]]))[0]
    found = find_adjoining(seen()[2], standing(TABLE + STOOL), near=(float(x), float(y)))
    assert found is not None
    assert extents(found.own) == pytest.approx([0.36, 0.36], abs=0.02)


def test_what_is_larger_than_a_seat_leaves_a_doubt() -> None:
    """A second table may as well be the desk's other half: the figures are doubted."""
    square = np.array([(0.0, 0.0), (0.7, 0.0), (0.7, 0.7), (0.0, 0.7)])
    assert Adjoining(square, square / 2, 4).warning.code == "surface.adjoining"
    assert Adjoining(square, square, 4).warning.code == "accuracy.adjoining"


@pytest.mark.parametrize(
    ("table", "places"),
    [
        (l_table(POSE), [(0.1, 0.1), (1.5, 0.1), (1.5, 0.6), (0.6, 0.6), (0.6, 1.3), (0.1, 1.3)]),
        (
            desk(POSE),
            [(0.1, 0.1), (1.5, 0.1), (1.5, 0.7), (1.2, 0.7), (0.4, 0.7), (0.1, 0.7), *INNER],
        ),
        (TABLE_AND_STOOL, [*TABLE, STOOL[2], STOOL[3]]),
    ],
    ids=["L", "desk with a cut-out", "an arm on two legs"],
)
def test_a_desk_of_one_piece_is_left_whole(table: Table, places: list[tuple[float, float]]) -> None:
    """Legs in every corner: no cut leaves two parts that each stand in the middle of theirs."""
    surface = replace(seen()[2], outline=table.outline)
    assert find_adjoining(surface, standing(places)) is None


def test_legs_that_were_not_seen_tell_nothing() -> None:
    """Inferred ones follow from the outline, which is what is asked about."""
    surface = seen()[2]
    assert find_adjoining(surface, standing(TABLE + STOOL, "inferred")) is None
    assert find_adjoining(surface, standing(TABLE[:1])) is None
