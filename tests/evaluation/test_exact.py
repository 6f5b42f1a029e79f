"""With exact poses and no noise, what is left is the methods' own error."""

from __future__ import annotations

from pathlib import Path

import pytest

from tablemap.baseline import method as report_method
from tablemap.config import load_config
from tablemap.evaluation.metrics import score
from tablemap.evaluation.truth import Truth
from tablemap.pipeline import process
from tablemap.recording import open_recording


def test_our_model_of_it_is_right_to_a_millimetre_and_a_half(exact_recording: Path) -> None:
    """Shape, dimensions, height and outline."""
    with open_recording(exact_recording) as recording:
        model = process(recording, config=load_config()).model
    result = score(model, Truth.load(Truth.beside(exact_recording)))
    assert result.shape == result.true_shape
    assert max(abs(error.error) for error in result.dimensions) < 0.0015
    assert result.height is not None
    assert abs(result.height.error) < 0.001


@pytest.mark.parametrize("distance", [1.0, 0.0])
def test_the_report_s_method_is_right_to_a_centimetre(
    exact_recording: Path, distance: float
) -> None:
    """With its ICP and without."""
    config = load_config(overrides=[f"report.icp_distance={distance}"])
    with open_recording(exact_recording) as recording:
        model = report_method.process(recording, config=config).model
    result = score(model, Truth.load(Truth.beside(exact_recording)))
    assert max(abs(error.error) for error in result.dimensions) < 0.010
    assert result.height is not None
    assert abs(result.height.error) < 0.010
