"""What many recordings cost: the workers of a day, and the list, index and catalog of their runs.

The runs are links to the files of one run, so that a hundred thousand of them fit anywhere.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from tablemap.archive.index import INDEX, list_runs
from tablemap.review.viewer.catalog import served_catalog
from tests.making.command import TABLEMAP
from tests.making.figures import Figures, joined
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run, read_runs
from tests.making.spent import spend

A_DAY = 10_000
DAY_SECONDS = 86_400
RUNS_A_RECORDING = 100
ARCHIVES = (1_000, 10_000, 100_000)


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
    each = figures.seconds.values()
    cores = [A_DAY * seconds / DAY_SECONDS for seconds in each]
    figures.add(
        f"{A_DAY:,} a day of {joined(figures.seconds)}",
        f"{joined(f'{busy:.1f}' for busy in cores)} cores",
        f"each: {joined(f'{seconds:.1f}' for seconds in each)} s",
    )
    run = next((tmp_path / "runs" / "copy0").resolve().glob("*/manifest.json")).parent
    files = [file for file in run.rglob("*") if file.is_file()]
    size = sum(file.stat().st_blocks * 512 for file in files)
    figures.add(
        f"the disk that {A_DAY:,} runs of the demo take",
        f"{A_DAY * size / 1e9:.0f} GB",
        f"each {size / 1e6:.1f} MB in {len(files)} files",
    )


def test_list_and_index(tmp_path: Path, benchmark: BenchmarkFixture, figures: Figures) -> None:
    """A list by the index costs a fifth of the first one, which reads every run, or less."""
    first, again, index = [], [], []
    for runs in ARCHIVES:
        folder = links(tmp_path / "runs", runs)
        first.append(took(partial(list_runs, folder)))
        # The best of three: a collection of garbage takes longer than such a list.
        again.append(min(took(partial(list_runs, folder)) for _ in range(3)))
        assert again[-1] < first[-1] / 5
        index.append((folder / INDEX).stat().st_size / 1e6)
        if runs == ARCHIVES[0]:
            assert len(benchmark.pedantic(list_runs, (folder,), rounds=1)) == runs
        shutil.rmtree(folder)
    figures.add(
        f"a list of {joined(f'{runs:,}' for runs in ARCHIVES)} runs, by an index of "
        f"{joined(f'{size:.1f}' for size in index)} MB",
        f"{joined(f'{seconds:.2f}' for seconds in again)} s",
        f"the first list, which reads each run: {joined(f'{seconds:.1f}' for seconds in first)} s",
        *(late / early for early, late in zip(first, again, strict=True)),
    )


def test_an_index_tells_what_a_scan_tells(tmp_path: Path, benchmark: BenchmarkFixture) -> None:
    """Row by row, of a thousand runs."""
    folder = links(tmp_path, 1_000)
    rows = benchmark.pedantic(list_runs, (folder,), rounds=2)
    assert rows == read_runs(folder)


@pytest.mark.parametrize(
    "archives", [ARCHIVES[:2], pytest.param(ARCHIVES[2:], marks=pytest.mark.slow)], ids=str
)
def test_catalog(
    archives: tuple[int, ...], tmp_path: Path, benchmark: BenchmarkFixture, figures: Figures
) -> None:
    """Serving writes a layer of figures a run, so its cost grows with their number."""
    served = []
    for runs in archives:
        folder = links(tmp_path / "runs", runs)
        list_runs(folder)
        serve = partial(_serve, folder, runs)
        last = runs == archives[-1]
        served.append(took(partial(benchmark.pedantic, serve, rounds=1) if last else serve))
        shutil.rmtree(folder)
    each = joined(
        f"{1e3 * seconds / runs:.1f}" for seconds, runs in zip(served, archives, strict=True)
    )
    figures.add(
        f"the catalog of {joined(f'{runs:,}' for runs in archives)} runs, until it is served",
        f"{joined(f'{seconds:.1f}' for seconds in served)} s",
        f"each run: {each} ms",
    )


def _serve(folder: Path, runs: int) -> None:
    with served_catalog(folder) as catalog:
        assert catalog.runs == runs
