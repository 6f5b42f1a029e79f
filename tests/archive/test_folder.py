"""Run folders are whole, never overwritten, and say how the run ended."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tablemap.archive import RunFolder, load_run
from tablemap.archive.tum import trajectory_tum
from tablemap.config import Config
from tablemap.errors import TablemapError
from tablemap.stages.odometry import Trajectory
from tests.making.models import rectangle_model


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A file to be named as the input."""
    file = tmp_path / "lap.mcap"
    file.write_bytes(b"not read here")
    return file


def make(recording: Path, output: Path) -> RunFolder:
    """Make a run folder."""
    return RunFolder.create(output, recording, method="tablemap", tables="best", config=Config())


def test_each_run_has_a_folder_of_its_own(recording: Path, tmp_path: Path) -> None:
    """Under the recording's stem, running until it is finished."""
    first, second = (make(recording, tmp_path / "runs") for _ in range(2))
    assert first.path != second.path
    assert first.path.parent == tmp_path / "runs" / "lap"
    manifest = json.loads((first.path / "manifest.json").read_text())
    assert manifest["schema"] == "tablemap/manifest/1"
    assert manifest["status"] == "running"
    assert manifest["recording"]["size"] == 13


def test_latest_names_the_last_run_that_left_a_model(recording: Path, tmp_path: Path) -> None:
    """A failed run does not take its place."""
    good, failed = (make(recording, tmp_path / "runs") for _ in range(2))
    good.write("table.json", rectangle_model().to_json())
    good.finish("ok")
    failed.finish("failed", error="no table")
    latest = load_run(tmp_path / "runs" / "lap")
    assert latest.path == good.path.resolve()
    assert latest.model.to_json() == rectangle_model().to_json()
    assert load_run(failed.path).manifest.error == "no table"


def test_without_a_model_the_last_run_is_opened(recording: Path, tmp_path: Path) -> None:
    """The folder of a recording that only failed has runs that tell why."""
    for error in ("no table", "still none"):
        make(recording, tmp_path / "runs").finish("failed", error=error)
    newest = max(path.name for path in (tmp_path / "runs" / "lap").iterdir())
    assert load_run(tmp_path / "runs" / "lap").path.name == newest


def test_no_half_written_file_is_left(recording: Path, tmp_path: Path) -> None:
    """What bears its name is whole, and nothing else lies about."""
    run = make(recording, tmp_path / "runs")
    run.write("tables/01.json", "{}")
    names = sorted(p.relative_to(run.path).as_posix() for p in run.path.rglob("*") if p.is_file())
    assert names == [".reserve", "manifest.json", "tables/01.json"]
    run.finish("ok")
    names = sorted(p.relative_to(run.path).as_posix() for p in run.path.rglob("*") if p.is_file())
    assert names == ["manifest.json", "tables/01.json"]


def test_an_output_that_cannot_be_written_is_one_sentence(recording: Path, tmp_path: Path) -> None:
    """A file stands where the folder should go."""
    (tmp_path / "runs").write_text("in the way")
    with pytest.raises(TablemapError, match="--output"):
        make(recording, tmp_path / "runs")


def test_what_is_no_run_is_refused(tmp_path: Path) -> None:
    """With what to give instead."""
    with pytest.raises(TablemapError, match="run folder"):
        load_run(tmp_path)


def test_the_trajectory_is_tum_with_nine_decimals() -> None:
    """Seconds keep their nanoseconds; a half turn is a quaternion of z alone."""
    stamps = np.array([1_700_000_000_123_456_789], dtype=np.int64)
    text = trajectory_tum(Trajectory(stamps, np.array([[1.5, -2.0, np.pi]])))
    assert text == (
        "1700000000.123456789 1.500000000 -2.000000000 0.000000000 "
        "0.000000000 0.000000000 1.000000000 0.000000000\n"
    )
