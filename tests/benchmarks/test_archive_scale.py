"""What an archive of many runs costs: its list, its index, and its catalog.

The runs are links to the files of one run, so that a hundred thousand of them fit anywhere.
"""

from __future__ import annotations

import os
import resource
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from tablemap.archive.index import INDEX, list_runs
from tablemap.review.viewer.catalog import served_catalog
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run, read_runs

RUNS_A_RECORDING = 100
MIB = 2**20


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


@contextmanager
def processor_seconds(figures: dict[str, float], name: str) -> Iterator[None]:
    """Note the processor time that the block takes."""
    began = time.process_time()
    yield
    figures[name] = time.process_time() - began


@pytest.mark.parametrize("runs", [1_000, 10_000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_list_and_index(
    runs: int, tmp_path: Path, benchmark: BenchmarkFixture, tell: Callable[[str], None]
) -> None:
    """A list by the index costs a fifth of the first one, which reads every run, or less."""
    folder = links(tmp_path / "runs", runs)
    took: dict[str, float] = {}
    with processor_seconds(took, "first"):
        assert len(list_runs(folder)) == runs
    with processor_seconds(took, "again"):
        assert len(list_runs(folder)) == runs
    benchmark.pedantic(list_runs, (folder,), rounds=1)
    size = (folder / INDEX).stat().st_size
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    tell(
        f"archive of {runs:,} runs: first list {took['first']:.2f} s, by the index "
        f"{took['again']:.2f} s ({1e6 * took['again'] / runs:.0f} us a run), index "
        f"{size / MIB:.1f} MB, process {peak:.0f} MB"
    )
    assert took["again"] < took["first"] / 5
    shutil.rmtree(folder)


def test_an_index_tells_what_a_scan_tells(tmp_path: Path, benchmark: BenchmarkFixture) -> None:
    """Row by row, of a thousand runs."""
    folder = links(tmp_path, 1_000)
    rows = benchmark.pedantic(list_runs, (folder,), rounds=2)
    assert rows == read_runs(folder)


@pytest.mark.parametrize("runs", [1_000, pytest.param(10_000, marks=pytest.mark.slow)])
def test_catalog(
    runs: int, tmp_path: Path, benchmark: BenchmarkFixture, tell: Callable[[str], None]
) -> None:
    """Serving writes a layer of figures a run, so its cost grows with their number."""
    folder = links(tmp_path / "runs", runs)
    list_runs(folder)

    def serve() -> int:
        with served_catalog(folder) as catalog:
            return catalog.runs

    took: dict[str, float] = {}
    with processor_seconds(took, "served"):
        assert benchmark.pedantic(serve, rounds=1) == runs
    tell(
        f"catalog of {runs:,} runs, their figures alone: served after {took['served']:.1f} s, "
        f"{1e3 * took['served'] / runs:.1f} ms a run"
    )
