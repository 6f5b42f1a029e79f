"""Pixels of a depth image that were mended are marked: the image is shown as recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from tablemap.review import text
from tablemap.stages.segmentation import Segmentation
from tests.making import made_up_run as made_up
from tests.making.marked_run import mended
from tests.making.reviews import columns, write

MENDED = 3
"""The view with mended pixels."""


@pytest.fixture(scope="module")
def run() -> list[object]:
    """All results of a made-up run with mended pixels."""
    return mended(made_up.results(stops=6), view=MENDED)


@pytest.fixture(scope="module")
def review(run: list[object], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its review."""
    return write(tmp_path_factory.mktemp("mended") / "run.rrd", run)


def masks(path: Path) -> dict[int, np.ndarray]:
    """The marks by snapshot, as the file has them."""
    found: dict[int, np.ndarray] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        name = "SegmentationImage:buffer"
        if chunk.entity_path == "/camera/mended" and {name, "snapshot"} <= {*batch.schema.names}:
            for index, (pixels,) in zip(
                batch.column("snapshot").to_pylist(), batch.column(name).to_pylist(), strict=True
            ):
                found[index] = np.frombuffer(bytes(pixels), dtype=np.uint8)
    return found


def test_each_view_marks_its_own(review: Path) -> None:
    """A later view without any takes the marks of the one before away."""
    found = masks(review)
    assert sorted(found) == [MENDED, MENDED + 1, MENDED + 2]
    shape = made_up.CAMERA.height, made_up.CAMERA.width
    assert found[MENDED].reshape(shape)[::10].all()
    assert found[MENDED].mean() == pytest.approx(0.1, abs=0.01)
    assert not found[MENDED + 1].any()


def test_the_views_tell_how_many(run: list[object], review: Path) -> None:
    """Beside the pixels of the top; a run without mended pixels has no such column."""
    said = columns(review, "/segmentation/summary", "TextDocument:text")[-1][0]
    assert "| mended |" in said
    assert "10.0 %" in said
    assert text.MENDED in said
    segmentation = next(one for one in run if isinstance(one, Segmentation))
    assert "mended" not in text.segmentation(segmentation)


def test_a_run_without_any_has_no_marks(tmp_path: Path) -> None:
    """Nothing is logged for images that are as they were recorded."""
    path = write(tmp_path / "plain" / "run.rrd", made_up.results(stops=4))
    assert not masks(path)
