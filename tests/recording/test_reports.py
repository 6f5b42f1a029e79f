"""Conditions that users of ROS tools reported, each in a recording of one and the same table."""

from __future__ import annotations

from pathlib import Path

import pytest

from tablemap.model import TableModel
from tablemap.pipeline import process
from tablemap.recording import open_recording

GOOD = (
    *("aligned_wrong_k_4", "dup_channel_depth", "no_return_is_almost_range_max", "odom_reset"),
    *("radial_depth", "robots_by_topic", "roi_small", "small_cluttered_circle"),
)
DOUBTFUL = ("two_localisers", "two_odometries")

pytestmark = pytest.mark.slow


def modelled(real_recordings: Path, name: str) -> TableModel:
    """Process one of the recordings."""
    path = real_recordings / "reports" / f"{name}.mcap"
    if not path.is_file():
        pytest.skip(f"no recording at {path}")
    with open_recording(path) as recording:
        return process(recording).model


@pytest.mark.parametrize("name", [*GOOD, *DOUBTFUL])
def test_the_table_is_right(real_recordings: Path, name: str) -> None:
    """Its size to 2 mm and within its interval, by all views; two sources of a pose are doubted."""
    model = modelled(real_recordings, name)
    top = model.surface
    truth = {"length": 1.2, "width": 0.8}, 0.755, 4
    if name == "small_cluttered_circle":
        truth = {"diameter": 0.5}, 0.62, 3
    sizes, height, legs = truth
    assert set(top.dimensions) == set(sizes)
    for size, true in sizes.items():
        found = top.dimensions[size]
        assert found.value == pytest.approx(true, abs=0.002)
        assert found.sigma is not None
        assert abs(found.value - true) < 2 * found.sigma
    assert top.height.value == pytest.approx(height, abs=0.002)
    assert len(model.legs) == legs
    assert all(view.used for view in model.snapshots)
    assert model.verdict.level == ("doubtful" if name in DOUBTFUL else "good")
