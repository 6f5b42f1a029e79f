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
from tests.making.figures import Figures
from tests.making.long_log import simulate_lap, to_and_fro
from tests.making.models import rectangle_model
from tests.making.rewriting import simulate_plain
from tests.making.run_folders import make_run
from tests.making.spent import Moment, Spent, least, moments, spend

LIBRARIES = (
    "import numpy, scipy.ndimage, scipy.spatial, shapely, pydantic, rosbags.typesys, mcap, rerun;"
    "from kiss_icp.kiss_icp import KissICP; from tablemap import imports; imports.open3d()"
)
MINUTES = (3, 5, 30)
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
    for name, arguments in commands.items():
        took = least(*TABLEMAP, *arguments, rounds=10).processor
        beside = f"importing typer and rich: {floor:.3f} s"
        figures.add(f"`{name}`", f"{took:.3f} s", beside, times=took / floor)
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
    figures.add("the demo, cold", f"{took:.1f} s", beside, times=took / imports)


@pytest.mark.benchmark(group="long logs")
def test_long_logs(
    benchmark: BenchmarkFixture, tmp_path_factory: pytest.TempPathFactory, figures: Figures
) -> None:
    """Beside the time that was driven, Rerun's own conversion, and each other."""
    folder = tmp_path_factory.mktemp("long")
    lap = simulate_lap(folder, stops=10)
    rerun = Path(sys.executable).with_name("rerun")
    took: dict[int, Spent] = {}
    for minutes in MINUTES:
        log = to_and_fro(lap, folder / f"{minutes}.mcap", laps=minutes)
        command = (*TABLEMAP, "process", log, "-o", folder / "runs", "--again", "--quiet")
        took[minutes] = benchmark.pedantic(spend, command) if minutes == 5 else spend(*command)
        if minutes == 5:
            seconds = _seconds(log)
            what = f"a log of {seconds:.0f} s, {log.stat().st_size / 1e6:.0f} MB"
            spent = took[minutes].processor
            figures.seconds["logs of 5 minutes"] = spent
            figures.add(what, f"{spent:.1f} s", "the drive itself", times=spent / seconds)
            raw = folder / "raw.rrd"
            converted = least(rerun, "mcap", "convert", log, "-o", raw).processor
            beside = f"`rerun mcap convert` of it: {converted:.1f} s"
            figures.add("the same", f"{spent:.1f} s", beside, times=spent / converted)
        log.unlink()
    short, middle, long = (took[minutes] for minutes in MINUTES)
    figures.add(
        "a log of 30 minutes",
        f"{long.processor:.0f} s",
        f"one of 5: {middle.processor:.1f} s",
        times=long.processor / middle.processor,
    )
    figures.add(
        "its memory, at most",
        f"{long.peak / 1e6:.0f} MB",
        f"that of 3 minutes: {short.peak / 1e6:.0f} MB",
        times=long.peak / short.peak,
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
    ("number", "part"), [(64, 16), pytest.param(1_000, 100, marks=pytest.mark.slow)]
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
    figures.add(what, f"{two:.0f} s", beside, times=two / alone)
    with scheduler(tmp_path) as (address, _), workers(address, 2):
        command = (*TABLEMAP, "process", *few, "-o", tmp_path / "dask", "--scheduler", address)
        dask = spend(*command, *options).wall
    beside = f"with `--jobs 2`: {two:.0f} s"
    figures.add(
        "the same on a Dask cluster of two workers", f"{dask:.0f} s", beside, times=dask / two
    )


def _tell_growth(one: list[Moment], part: int, figures: Figures) -> None:
    """Compare the first recordings, but the very first that imports, with as many last ones."""
    number = len(one)
    first, last = (
        (one[k + part - 1].processor - one[k].processor) / (part - 1) for k in (1, number - part)
    )
    what = f"the last {part} of {number:,} small recordings, each"
    beside = f"of the first {part}: {first:.2f} s"
    figures.add(what, f"{last:.2f} s", beside, times=last / first)
    for name, unit, values in (
        ("memory then", " MB", [moment.memory / 1e6 for moment in one]),
        ("threads then", "", [float(moment.threads) for moment in one]),
        ("open files then", "", [float(moment.files) for moment in one]),
    ):
        early, late = values[part], values[-1]
        beside = f"after the first {part}: {early:.0f}{unit}"
        figures.add(name, f"{late:.0f}{unit}", beside, times=late / early)
