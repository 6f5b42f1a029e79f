"""Simulated tops of the shapes that curve, or nearly, are called what they are."""

from __future__ import annotations

from pathlib import Path

import pytest

from tablemap.config import load_config
from tablemap.evaluation.metrics import score
from tablemap.evaluation.truth import Truth
from tablemap.pipeline import process
from tablemap.recording import open_recording
from tablemap.simulation import load_scenario, simulate, write


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "seed"),
    [
        ("stadium", 30),
        ("stadium", 31),
        ("stadium", 32),
        ("circle", 30),
        ("ellipse", 30),
        ("rounded_rectangle", 30),
        ("school_table", 30),
        ("conference", 30),
    ],
)
def test_a_simulated_top_is_found(scenario: str, seed: int, tmp_path: Path) -> None:
    """Its shape, its dimensions to 3 mm, all said to be measured, and the radius of its corners."""
    file = tmp_path / "lap.mcap"
    write(simulate(load_scenario(scenario), seed=seed), file)
    with open_recording(file) as recording:
        model = process(recording, config=load_config()).model
    result = score(model, Truth.load(Truth.beside(file)))
    assert result.shape == result.true_shape
    assert {error.status for error in result.dimensions} == {"measured"}
    assert max(abs(error.error) for error in result.dimensions) < 0.003
    assert (model.surface.corner_radius is None) == (result.corner_radius is None)
    if result.corner_radius is not None:
        assert abs(result.corner_radius.error) < 0.003
