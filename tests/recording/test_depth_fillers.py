"""A number that fills in what a camera did not measure is learnt from the images, and said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tablemap.geometry import Floats
from tablemap.recording import inspect, open_recording
from tablemap.recording.unmeasured import filler_of, removed
from tests.making.rewriting import Entry, depth_of, rewrite, with_depth

FARTHEST_MM = 3500


def depths(path: Path) -> tuple[list[Floats], list[str]]:
    """Return the depth images of a recording, and what was said of it."""
    with open_recording(path) as recording:
        images = [frame.depth.astype(np.float64) for frame in recording.depth_frames()]
        return images, [f"{warning.code}: {warning.message}" for warning in recording.warnings]


@pytest.mark.parametrize("filler_mm", [4095, 10_000, 180])
@pytest.mark.parametrize("encoding", ["16UC1", "32FC1"])
def test_what_a_driver_fills_in_is_not_measured(
    tmp_path: Path, plain_recording: Path, filler_mm: int, encoding: str
) -> None:
    """The end of a range, or its begin, instead of zero: the images come out as with zeros."""

    def filled(entry: Entry) -> list[Entry]:
        if not entry.is_depth:
            return [entry]
        values = depth_of(entry)
        values[(values == 0) | (values > FARTHEST_MM)] = filler_mm
        if encoding == "16UC1":
            return [with_depth(entry, values)]
        return [with_depth(entry, (values * 0.001).astype(np.float32), encoding=encoding)]

    path = rewrite(plain_recording, tmp_path / "r.mcap", filled)
    ours, said = depths(path)
    for after, before in zip(ours, depths(plain_recording)[0], strict=True):
        expected = np.where(before > FARTHEST_MM * 0.001 + 5e-4, np.nan, before)
        np.testing.assert_allclose(after, expected, atol=1e-6)
    (line,) = said
    assert line.startswith("recording.depth_meaning: In all images")
    assert f"are {filler_mm / 1000:.3f} m" in line
    assert "recording.depth_meaning" in [each.code for each in inspect(path).warnings]


def test_a_wall_is_measured(plain_recording: Path) -> None:
    """Rooms have a farthest wall, and robots a nearest part of themselves: these stay."""
    images, said = depths(plain_recording)
    assert filler_of([image.astype(np.float32) for image in images]) is None
    assert said == []


@pytest.mark.parametrize("step", [0.001, 0.04])
def test_a_wall_in_coarse_steps_is_measured(step: float) -> None:
    """It fills whole areas with one number, but has others beside it, or another in each image."""
    rng = np.random.default_rng(1)
    images = []
    for away in (2.9, 3.05, 3.2, 3.1):
        slanted = away + np.linspace(0.0, 0.15, 80)[None] + rng.normal(0, 0.005, (60, 80))
        slanted[30:] = np.linspace(away - 2, away, 30)[:, None]
        images.append((np.round(slanted / step) * step).astype(np.float32))
    assert filler_of(images) is None


def test_too_few_images_or_empty_ones_tell_nothing() -> None:
    """One image may well show one wall; an image of nothing has no number at all."""
    full = np.full((20, 20), 4.095, dtype=np.float32)
    assert filler_of([full, full]) is None
    assert filler_of([full, full, full * np.float32(np.nan)]) is None
    assert filler_of([full, full, full]) == (pytest.approx(4.095), 1.0)
    assert np.isnan(removed(full, 4.095)).all()
    assert removed(full, None) is full
