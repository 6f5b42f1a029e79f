"""Many runs list about as fast as few: the index against reading every run."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from tablemap.archive.index import list_runs
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run, read_runs

RUNS = 10_000


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten thousand runs of a hundred recordings, links to the files of one."""
    folder = tmp_path_factory.mktemp("runs")
    model = make_run(folder, "recording000/run00000", rectangle_model()).path
    for number in range(1, RUNS):
        run = folder / f"recording{number % 100:03d}" / f"run{number:05d}"
        run.mkdir(parents=True)
        for name in ("manifest.json", "table.json"):
            (run / name).hardlink_to(model / name)
    return folder


def test_listing_by_the_index(many: Path, benchmark: BenchmarkFixture) -> None:
    """At least five times as fast as a full scan of the same folder in the same minute."""
    began = time.perf_counter()
    scanned = read_runs(many)
    scan_seconds = time.perf_counter() - began
    assert list_runs(many) == scanned
    rows = benchmark(list_runs, many)
    assert len(rows) == RUNS
    benchmark.extra_info["full scan, seconds"] = round(scan_seconds, 3)
    assert benchmark.stats["mean"] < scan_seconds / 5
