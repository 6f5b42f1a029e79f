"""What commands cost, each beside its floor: both measured here, one after the other.

Machines differ and are shared; ratios stay.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from tablemap.archive.index import list_runs
from tests.making.command import TABLEMAP
from tests.making.dask_cluster import scheduler, workers
from tests.making.figures import Figures, joined
from tests.making.long_log import simulate_lap, to_and_fro
from tests.making.models import rectangle_model
from tests.making.rewriting import simulate_plain
from tests.making.run_folders import make_run
from tests.making.spent import Moment, Spent, least, moments, spend

LIBRARIES = (
    "import numpy, scipy.ndimage, scipy.spatial, shapely, msgspec, rosbags.typesys, mcap, rerun;"
    "from kiss_icp.kiss_icp import KissICP; from tablemap import imports; imports.open3d()"
)
MINUTES = (3, 5, 30)
STOPS = 40
"""All are processed. They take three minutes, which are driven to and fro."""
AT_ONCE = 32
"""Recordings that one process, two and a cluster get."""


@pytest.mark.benchmark(group="what answers at once")
def test_help_and_lists(benchmark: BenchmarkFixture, tmp_path: Path, figures: Figures) -> None:
    """Beside importing typer and rich."""
    runs = tmp_path / "runs"
    make_run(runs, "lap/one", rectangle_model())
    list_runs(runs)
    floor = least(sys.executable, "-c", "import typer, rich", rounds=10).processor
    commands = {
        "--help": ("--help",),
        "runs list": ("runs", "list", runs),
        "config": ("config",),
        "runs show": ("runs", "show", runs / "lap/one"),
    }
    took = [least(*TABLEMAP, *each, rounds=10).processor for each in commands.values()]
    figures.add(
        joined(f"`{name}`" for name in commands),
        f"{joined(f'{seconds:.2f}' for seconds in took)} s",
        f"importing typer and rich: {floor:.2f} s",
        *(seconds / floor for seconds in took),
    )
    benchmark.pedantic(spend, (*TABLEMAP, "--help"), rounds=1)


@pytest.fixture(scope="module")
def imports() -> float:
    """What importing the libraries costs, which no processing goes below."""
    return least(sys.executable, "-c", LIBRARIES).processor


@pytest.mark.benchmark(group="the demo, cold")
def test_the_demo(
    benchmark: BenchmarkFixture,
    demo_recording: Path,
    imports: float,
    tmp_path: Path,
    figures: Figures,
) -> None:
    """With its review, beside what importing the libraries takes."""
    command = (*TABLEMAP, "process", demo_recording, "-o", tmp_path, "--again", "--quiet")
    took = least(*command).processor
    benchmark.pedantic(spend, command, rounds=1)
    beside = f"importing its libraries: {imports:.1f} s"
    figures.add("the demo, cold", f"{took:.1f} s", beside, took / imports)


@pytest.mark.benchmark(group="long logs")
def test_long_logs(
    benchmark: BenchmarkFixture, tmp_path_factory: pytest.TempPathFactory, figures: Figures
) -> None:
    """Beside the time that was driven, Rerun's own conversion, and each other."""
    folder = tmp_path_factory.mktemp("long")
    lap = simulate_lap(folder, stops=STOPS)
    took: dict[int, Spent] = {}
    for minutes in MINUTES:
        log = to_and_fro(lap, folder / f"{minutes}.mcap", minutes=minutes)
        command = (*TABLEMAP, "process", log, "-o", folder / "runs", "--again", "--quiet")
        took[minutes] = benchmark.pedantic(spend, command) if minutes == 5 else spend(*command)
        if minutes == 5:
            seconds, spent = _seconds(log), took[minutes].processor
            figures.seconds["logs of 5 minutes"] = spent
            rerun = Path(sys.executable).with_name("rerun")
            converted = least(rerun, "mcap", "convert", log, "-o", folder / "raw.rrd").processor
            figures.add(
                f"a log of {seconds:.0f} s, {log.stat().st_size / 1e6:.0f} MB",
                f"{spent:.1f} s",
                f"the drive itself; `rerun mcap convert` of it: {converted:.1f} s",
                spent / seconds,
                spent / converted,
            )
        log.unlink()
    short, middle, long = (took[minutes] for minutes in MINUTES)
    figures.add(
        "one of 30 minutes: time; memory, at most",
        f"{long.processor:.0f} s; {long.peak / 1e6:.0f} MB",
        f"of 5 minutes: {middle.processor:.1f} s; of 3: {short.peak / 1e6:.0f} MB",
        long.processor / middle.processor,
        long.peak / short.peak,
    )


def _seconds(log: Path) -> float:
    told = subprocess.run([*TABLEMAP, "info", str(log), "--json"], capture_output=True, check=True)
    span = json.loads(told.stdout)
    return (span["end_ns"] - span["start_ns"]) / 1e9


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of eight views, a megabyte."""
    return simulate_plain(tmp_path_factory.mktemp("small"))


def _copies(recording: Path, folder: Path, number: int) -> list[Path]:
    """Return links to a recording, each with a name of its own."""
    folder.mkdir()
    links = [folder / f"copy{k:04d}.mcap" for k in range(number)]
    for link in links:
        link.symlink_to(recording)
    return links


@pytest.mark.benchmark(group="many recordings")
@pytest.mark.parametrize(
    ("number", "part"), [(40, 10), pytest.param(1_000, 100, marks=pytest.mark.slow)]
)
def test_many_recordings(
    number: int,
    part: int,
    benchmark: BenchmarkFixture,
    small: Path,
    tmp_path: Path,
    figures: Figures,
) -> None:
    """One after the other in one process, where nothing grows; by two processes, and a cluster."""
    copies = _copies(small, tmp_path / "copies", number)
    options = ("--again", "--quiet", "--json")
    one = benchmark.pedantic(
        moments,
        (*TABLEMAP, "process", *copies, "-o", tmp_path / "one", *options),
        rounds=1,
    )
    _tell_growth(one, part, figures)
    few = copies[:AT_ONCE]
    two = spend(*TABLEMAP, "process", *few, "-o", tmp_path / "two", "--jobs", 2, *options).wall
    alone = one[AT_ONCE - 1].wall
    what = f"{AT_ONCE} small recordings with `--jobs 2`, until the end"
    beside = f"one after the other: {alone:.0f} s"
    figures.add(what, f"{two:.0f} s", beside, two / alone)
    with scheduler(tmp_path) as (address, _), workers(address, 2):
        command = (*TABLEMAP, "process", *few, "-o", tmp_path / "dask", "--scheduler", address)
        dask = spend(*command, *options).wall
    beside = f"with `--jobs 2`: {two:.0f} s"
    figures.add("the same on a Dask cluster of two workers", f"{dask:.0f} s", beside, dask / two)


def _tell_growth(one: list[Moment], part: int, figures: Figures) -> None:
    """Compare the first recordings, but the very first that imports, with as many last ones."""
    number = len(one)
    first, last = (
        (one[k + part - 1].processor - one[k].processor) / (part - 1) for k in (1, number - part)
    )
    early, late = one[part], one[-1]
    figures.add(
        f"the last {part} of {number:,} small recordings in one process: each, its memory, "
        "threads, open files",
        f"{last:.2f} s; {late.memory / 1e6:.0f} MB; {late.threads}; {late.files}",
        f"the first {part}: {first:.2f} s; {early.memory / 1e6:.0f} MB; {early.threads}; "
        f"{early.files}",
        last / first,
        late.memory / early.memory,
        late.threads / early.threads,
        late.files / early.files,
    )
