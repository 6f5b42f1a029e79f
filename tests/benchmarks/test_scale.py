"""What many recordings cost: the workers of a day, and the list, index and catalog of their runs.

The runs are links to the files of one run, so that a hundred thousand of them fit anywhere.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from tablemap.archive.index import INDEX, list_runs
from tablemap.review.viewer.catalog import served_catalog
from tests.making.command import TABLEMAP
from tests.making.figures import Figures
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run, read_runs
from tests.making.spent import spend

A_DAY = 10_000
DAY_SECONDS = 86_400
RUNS_A_RECORDING = 100


def links(folder: Path, runs: int) -> Path:
    """Fill a folder with runs; those of a recording are links to the files of its first one."""
    one = make_run(folder, "recording0000/run000000", rectangle_model()).path
    first = one
    for number in range(1, runs):
        run = folder / f"recording{number // RUNS_A_RECORDING:04d}" / f"run{number:06d}"
        run.mkdir(parents=True)
        begins = number % RUNS_A_RECORDING == 0
        for name in ("manifest.json", "table.json"):
            if begins:  # a file system bounds the links to one file
                shutil.copy(one / name, run / name)
            else:
                os.link(first / name, run / name)
        first = run if begins else first
    return folder


def took(work: Callable[[], object]) -> float:
    """Return the processor time of a piece of work in this process."""
    began = time.process_time()
    work()
    return time.process_time() - began


def test_a_day(
    benchmark: BenchmarkFixture, demo_recording: Path, tmp_path: Path, figures: Figures
) -> None:
    """How many cores ten thousand recordings keep busy, and the disk that their runs fill."""
    copies = [tmp_path / f"copy{number}.mcap" for number in range(4)]
    for copy in copies:
        copy.symlink_to(demo_recording)
    command = (*TABLEMAP, "process", "-o", tmp_path / "runs", "--again", "--quiet")
    alone = spend(*command, copies[0]).processor
    all_ = benchmark.pedantic(spend, (*command, *copies), rounds=1).processor
    figures.seconds["recordings as the demo"] = (all_ - alone) / (len(copies) - 1)
    for what, seconds in figures.seconds.items():
        cores = A_DAY * seconds / DAY_SECONDS
        beside = f"each {seconds:.1f} s"
        figures.add(f"{A_DAY:,} a day of {what}", f"{cores:.1f} cores", beside)
    run = next((tmp_path / "runs" / "copy0").resolve().glob("*/manifest.json")).parent
    files = [file for file in run.rglob("*") if file.is_file()]
    size = sum(file.stat().st_blocks * 512 for file in files)
    figures.add(
        f"the disk that {A_DAY:,} runs of the demo take",
        f"{A_DAY * size / 1e9:.0f} GB",
        f"each {size / 1e6:.1f} MB in {len(files)} files",
    )


@pytest.mark.parametrize("runs", [1_000, 10_000, 100_000])
def test_list_and_index(
    runs: int, tmp_path: Path, benchmark: BenchmarkFixture, figures: Figures
) -> None:
    """A list by the index costs a fifth of the first one, which reads every run, or less."""
    folder = links(tmp_path / "runs", runs)
    first = took(lambda: list_runs(folder))
    again = took(lambda: list_runs(folder))
    assert len(benchmark.pedantic(list_runs, (folder,), rounds=1)) == runs
    index = (folder / INDEX).stat().st_size
    figures.add(
        f"a list of {runs:,} runs, by an index of {index / 1e6:.1f} MB",
        f"{again:.2f} s",
        f"the first list, which reads each run: {first:.1f} s",
        times=again / first,
    )
    assert again < first / 5
    shutil.rmtree(folder)


def test_an_index_tells_what_a_scan_tells(tmp_path: Path, benchmark: BenchmarkFixture) -> None:
    """Row by row, of a thousand runs."""
    folder = links(tmp_path, 1_000)
    rows = benchmark.pedantic(list_runs, (folder,), rounds=2)
    assert rows == read_runs(folder)


@pytest.mark.parametrize("runs", [1_000, 10_000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_catalog(runs: int, tmp_path: Path, benchmark: BenchmarkFixture, figures: Figures) -> None:
    """Serving writes a layer of figures a run, so its cost grows with their number."""
    folder = links(tmp_path / "runs", runs)
    list_runs(folder)

    def serve() -> None:
        with served_catalog(folder) as catalog:
            assert catalog.runs == runs

    served = took(lambda: benchmark.pedantic(serve, rounds=1))
    each = f"each run {1e3 * served / runs:.1f} ms"
    figures.add(f"the catalog of {runs:,} runs, until it is served", f"{served:.1f} s", each)
