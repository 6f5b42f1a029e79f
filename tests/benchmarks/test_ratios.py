"""What processing costs, each beside its floor: both in processor time and in one session.

Machines differ and are shared; ratios stay.
"""

from __future__ import annotations

import json
import os
import platform
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from tablemap.simulation import load_scenario, simulate, write
from tests.making.command import TABLEMAP

ROUNDS = 3
LIBRARIES = (
    "import numpy, scipy.ndimage, scipy.spatial, shapely, pydantic, rosbags.typesys, mcap, rerun;"
    "from kiss_icp.kiss_icp import KissICP; from tablemap import imports; imports.open3d()"
)
LONG = """
description = "Stops of seconds in a drive of minutes, the depth camera running"

[table]
shape = "rectangle"
length = 1.187
width = 0.806
height = 0.743

[clutter]
count = 6

[robot]
stops = {stops}
stop_seconds = 3.6
continuous_rate = 5.0
moving_scan_rate = 20.0
standing_scan_rate = 20.0
"""


def processor_seconds(*command: object) -> float:
    """Return the processor time of a program and its children, and of their system calls."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([*map(str, command)], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def least(*command: object) -> float:
    """Return the least processor time of a few runs of a program."""
    return min(processor_seconds(*command) for _ in range(ROUNDS))


@pytest.fixture(scope="module", autouse=True)
def machine(tell: Callable[[str], None]) -> None:
    """Say which machine this is."""
    names = [
        line.partition(":")[2].strip()
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        if line.startswith("model name")
    ]
    tell(f"machine: {names[0] if names else platform.processor()}, {os.cpu_count()} cores")


@pytest.fixture(scope="module")
def imports() -> float:
    """What importing the libraries costs, which no processing goes below."""
    return least(sys.executable, "-c", LIBRARIES)


@pytest.fixture(scope="module", params=[15, pytest.param(75, marks=pytest.mark.slow)])
def log(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated log: depth at 5 Hz, laser and TF at 20 Hz, a stop each four seconds."""
    folder = tmp_path_factory.mktemp("log")
    scenario = folder / "long.toml"
    scenario.write_text(LONG.format(stops=request.param), encoding="utf-8")
    path = folder / "long.mcap"
    write(simulate(load_scenario(str(scenario)), seed=0), path)
    return path


@pytest.mark.benchmark(group="the demo, cold")
def test_the_demo(
    benchmark: BenchmarkFixture,
    demo_recording: Path,
    imports: float,
    tmp_path: Path,
    tell: Callable[[str], None],
) -> None:
    """With its review, beside what importing the libraries takes."""
    command = (*TABLEMAP, "process", demo_recording, "-o", tmp_path, "--again", "--quiet")
    took = least(*command)
    benchmark.pedantic(processor_seconds, command, rounds=1)
    tell(
        f"the demo, cold, review included: {took:.2f} s, {took / imports:.1f} times its imports "
        f"({imports:.2f} s)"
    )


@pytest.mark.benchmark(group="a long log")
def test_a_long_log(
    benchmark: BenchmarkFixture,
    log: Path,
    imports: float,
    tmp_path: Path,
    tell: Callable[[str], None],
) -> None:
    """With its review, beside the length of the log and Rerun's own conversion of it."""
    told = subprocess.run([*TABLEMAP, "info", str(log), "--json"], capture_output=True, check=True)
    span = json.loads(told.stdout)
    seconds = (span["end_ns"] - span["start_ns"]) / 1e9
    rerun = Path(sys.executable).with_name("rerun")
    converted = least(rerun, "mcap", "convert", log, "-o", tmp_path / "raw.rrd")
    command = (*TABLEMAP, "process", log, "-o", tmp_path, "--again", "--quiet")
    took = benchmark.pedantic(processor_seconds, command, rounds=1)
    tell(
        f"a log of {seconds:.0f} s, {log.stat().st_size / 1e6:.0f} MB: {took:.1f} s, "
        f"{seconds / took:.0f} times as fast as it was driven; {took / converted:.0f} times "
        f"`rerun mcap convert` of it ({converted:.2f} s), {took / imports:.0f} times the imports"
    )


@pytest.mark.benchmark(group="many recordings")
def test_many_recordings(
    benchmark: BenchmarkFixture, demo_recording: Path, tmp_path: Path, tell: Callable[[str], None]
) -> None:
    """Workers start once: a recording more costs less than a process of its own."""
    copies = [tmp_path / f"copy{number}.mcap" for number in range(6)]
    for copy in copies:
        copy.symlink_to(demo_recording)
    alone = least(*TABLEMAP, "process", copies[0], "-o", tmp_path / "one", "--again", "--quiet")
    command = (*TABLEMAP, "process", *copies, "-o", tmp_path / "all", "--jobs", 2, "--quiet")
    took = benchmark.pedantic(processor_seconds, command, rounds=1)
    tell(
        f"{len(copies)} recordings with --jobs 2: {took / len(copies):.2f} s each, one by itself "
        f"{alone:.2f} s"
    )
    assert took < len(copies) * alone


@pytest.mark.benchmark(group="what answers at once")
def test_help_and_lists(
    benchmark: BenchmarkFixture, tmp_path: Path, tell: Callable[[str], None]
) -> None:
    """Beside importing typer and rich."""
    (tmp_path / "runs").mkdir()
    floor = least(sys.executable, "-c", "import typer, rich")
    commands = {
        "--help": ("--help",),
        "runs list": ("runs", "list", tmp_path / "runs"),
        "config": ("config",),
    }
    took = {name: least(*TABLEMAP, *arguments) for name, arguments in commands.items()}
    benchmark.pedantic(processor_seconds, (*TABLEMAP, "--help"), rounds=1)
    each = ", ".join(f"{name} {seconds / floor:.1f}" for name, seconds in took.items())
    tell(f"times importing typer and rich ({floor:.3f} s): {each}")
