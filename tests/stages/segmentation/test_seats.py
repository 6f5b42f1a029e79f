"""A seat that is seen better than its table is not taken without a word."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from tablemap.config import CalibrationConfig, Config, SegmentationConfig, SensorsConfig
from tablemap.recording import open_recording
from tablemap.stages.calibration import calibrate
from tablemap.stages.segmentation import TableCandidate, find_tables
from tablemap.stages.segmentation.candidates import likeliest_first, seats_beside
from tablemap.stages.segmentation.surfaces import upright_cells
from tablemap.stages.snapshots import take_snapshots


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


@pytest.mark.parametrize(("weight", "first"), [(0.9, 2.0), (0.5, 0.0)], ids=["nearly", "far less"])
def test_of_nearly_equal_surfaces_one_without_a_front_is_taken(weight: float, first: float) -> None:
    """A counter with a front is no table, if a surface beside it is nearly as likely."""
    counter = _surface(0.0, 0.5, 0.94, is_closed=True)
    cupboard = replace(_surface(1.0, 0.5, 0.94, is_closed=True), weight=0.95)
    corner = replace(_surface(2.0, 0.4, 0.71), weight=weight)
    ranked = likeliest_first([corner, cupboard, counter])
    assert ranked[0].hull[0, 0] == first
    assert len(ranked) == 3


def test_a_seat_before_a_table_is_no_front() -> None:
    """In each cell of the rim a seat lies at one height, and a front fills a range of heights."""
    rng = np.random.default_rng(5)
    rim = np.ones((20, 20), dtype=bool)
    rim[0] = False
    seat, front, elsewhere = ([x, 5] for x in (3, 4, 0))
    cells = np.repeat([seat, front, elsewhere], 40, axis=0)
    heights = np.concatenate(
        [rng.normal(0.45, 0.005, 40), rng.uniform(0.1, 0.6, 40), rng.uniform(0.1, 0.6, 40)]
    )
    found = upright_cells(rim, cells, heights.astype(np.float32))
    assert found.tolist() == [front]
    assert not len(upright_cells(rim, cells[:0], heights[:0].astype(np.float32)))


def test_a_table_is_found_where_a_chair_stands_before_it(real_recordings: Path) -> None:
    """Part of a real clip, whose camera sees the table's end and a chair: not a shelf beside it."""
    part = structs.replace(Config().topics, start="20", end="26.6")
    recording = open_recording(real_recordings / "kitchen.mcap", topics=part)
    taken = take_snapshots(recording, config=Config().snapshots, sensors=SensorsConfig())
    shots = calibrate(
        taken.snapshots, config=CalibrationConfig(), sensors=SensorsConfig()
    ).snapshots
    chosen = find_tables(shots, config=SegmentationConfig())[0]
    assert chosen.height == pytest.approx(0.725, abs=0.02)
    assert not chosen.is_closed
