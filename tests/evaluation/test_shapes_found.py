"""Simulated tops of rare shapes and materials are called what they are."""

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


@pytest.mark.slow
@pytest.mark.parametrize("seed", [30, 31, 32])
def test_a_black_top_that_reads_too_far_is_doubted_and_bounded(seed: int, tmp_path: Path) -> None:
    """Two centimetres of depth put the height off by a third of that at most, within its sigma."""
    file = tmp_path / "lap.mcap"
    write(simulate(load_scenario("late_top"), seed=seed), file)
    with open_recording(file) as recording:
        model = process(recording, config=load_config()).model
    error = model.surface.height.value - Truth.load(Truth.beside(file)).surface.height
    assert abs(error) < 0.007
    assert model.surface.height.sigma is not None
    assert abs(error) < 2 * model.surface.height.sigma
    assert "accuracy.top_distance" in {warning.code for warning in model.warnings}
    assert model.verdict.level == "doubtful"


@pytest.mark.slow
@pytest.mark.parametrize("seed", [30, 31])
def test_a_slow_laser_that_never_stops_puts_the_legs_right(seed: int, tmp_path: Path) -> None:
    """Scans of a fifth of a second that say no time_increment: found, said, and no doubt."""
    file = tmp_path / "drive.mcap"
    write(simulate(load_scenario("slow_laser"), seed=seed), file)
    with open_recording(file) as recording:
        model = process(recording, config=load_config()).model
    result = score(model, Truth.load(Truth.beside(file)))
    assert "registration.sweep" in {warning.code for warning in model.warnings}
    assert model.verdict.level == "good"
    assert result.shape == "rectangle"
    assert result.legs is not None
    assert (result.legs.found, result.legs.missed) == (4, 0)
    assert max(abs(error.error) for error in result.dimensions) < 0.003
    assert max(abs(place.error) for place in result.legs.places) < 0.0035
