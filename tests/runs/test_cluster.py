"""Many recordings on a real Dask cluster of two workers on this machine."""

from __future__ import annotations

import _thread
import json
import signal
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tablemap.archive import load_run
from tablemap.cli.app import app
from tablemap.config import Config
from tablemap.errors import ExternalToolError
from tablemap.runs.cluster import process_on_cluster
from tablemap.runs.running import Outcome
from tests.making.acting import Acted
from tests.making.command import tablemap
from tests.making.dask_cluster import (
    START_SECONDS,
    WORKER,
    scheduler,
    wait_for_workers,
    worker,
    workers,
)


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A scheduler without workers, for the tests of this module."""
    with scheduler(tmp_path_factory.mktemp("scheduler")) as (found, _):
        yield found


def recordings(folder: Path, *names: str) -> list[Path]:
    """Make files that stand for recordings."""
    files = [folder / f"{name}.mcap" for name in names]
    for file in files:
        file.write_bytes(b"x")
    return files


def statuses(output: Path, name: str) -> list[str]:
    """Return how the runs of a recording ended."""
    runs = [run for run in (output / name).iterdir() if not run.is_symlink()]
    return sorted(load_run(run).manifest.status for run in runs)


def test_a_killed_worker_s_recording_goes_to_the_other(address: str, tmp_path: Path) -> None:
    """A worker is killed by the first recording that it is given; nothing else is lost."""
    files = recordings(tmp_path, "once", "a", "defect", "b", "hungry")
    stages: list[str] = []
    with workers(address, 2) as processes:
        outcomes = {
            outcome.recording.path: outcome
            for outcome in process_on_cluster(
                files,
                Acted(tmp_path / "runs", Config()),
                address=address,
                progress=lambda path, stage: stages.append(f"{path.stem} {stage.name}"),
                warn=pytest.fail,
            )
        }
        killed = [process for process in processes if process.poll() == -signal.SIGKILL]
        assert len(killed) == 1
    assert [outcomes[file].status for file in files] == ["ok", "ok", "failed", "ok", "failed"]
    assert "process fewer recordings at once" in (outcomes[files[4]].error or "")
    assert "of this recording" in (outcomes[files[2]].error or "")
    assert statuses(tmp_path / "runs", "once") == ["interrupted", "ok"]
    (lost,) = (
        run
        for run in (tmp_path / "runs" / "once").iterdir()
        if load_run(run).manifest.status == "interrupted"
    )
    assert "worker died" in (load_run(lost).manifest.error or "")
    assert "a snapshots" in stages


@pytest.mark.slow
def test_a_recording_that_kills_its_workers_is_given_up(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once two have died; with none left the others fail too, and it is said why."""
    monkeypatch.setattr("tablemap.runs.cluster.WORKERLESS_SECONDS", 3.0)
    job = Acted(tmp_path / "runs", Config())

    def run(*names: str, count: int) -> dict[str, Outcome]:
        with workers(address, count):
            files = recordings(tmp_path, *names)
            return {
                outcome.recording.stem: outcome
                for outcome in process_on_cluster(
                    files, job, address=address, progress=lambda *_: None, warn=pytest.fail
                )
            }

    deadly = run("deadly", count=3)["deadly"]
    assert (deadly.status, statuses(job.output, "deadly")) == ("failed", ["interrupted"] * 2)
    assert "worker died 2 times" in (deadly.error or "")
    left = run("deadly2", count=1)["deadly2"]
    assert left.status == "failed"
    assert "no worker is left" in (left.error or "")
    assert statuses(job.output, "deadly2") == ["interrupted"]


def test_an_interruption_reaches_the_workers(address: str, tmp_path: Path) -> None:
    """What is at work is marked interrupted, what waits is not begun, the worker lives on."""
    files = recordings(tmp_path, "endless", "later")
    output = tmp_path / "runs"

    def interrupt_once_begun() -> None:
        deadline = time.monotonic() + START_SECONDS
        while not (output / "endless").is_dir() and time.monotonic() < deadline:
            time.sleep(0.05)
        _thread.interrupt_main()

    with workers(address, 1) as (process,):
        running = process_on_cluster(
            files,
            Acted(output, Config()),
            address=address,
            progress=lambda *_: None,
            warn=pytest.fail,
        )
        threading.Thread(target=interrupt_once_begun).start()
        with pytest.raises(KeyboardInterrupt):
            list(running)
        assert statuses(output, "endless") == ["interrupted"]
        assert not (output / "later").exists()
        assert process.poll() is None


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("import sys; sys.modules['tablemap'] = None; " + WORKER, "no tablemap"),
        (
            "import tablemap.archive.manifest as f; f.__version__ = '0.0.0'; " + WORKER,
            "another tablemap",
        ),
    ],
    ids=["none", "another"],
)
def test_workers_with_another_tablemap_are_refused(
    address: str, tmp_path: Path, code: str, words: str
) -> None:
    """Before anything is begun, and by name."""
    with worker(address, code=code):
        wait_for_workers(address, 1)
        running = process_on_cluster(
            recordings(tmp_path, "a"),
            Acted(tmp_path / "runs", Config()),
            address=address,
            progress=lambda *_: None,
            warn=pytest.fail,
        )
        with pytest.raises(ExternalToolError, match=words) as raised:
            next(running)
    assert "tcp://127.0.0.1" in str(raised.value)
    assert not (tmp_path / "runs").exists()


@pytest.mark.slow
def test_many_threads_and_a_lost_scheduler_are_said(tmp_path: Path) -> None:
    """The first before, the second where nothing more can come."""
    said: list[str] = []
    with scheduler(tmp_path) as (address, process), worker(address, "--nthreads", 3):
        wait_for_workers(address, 1)
        running = process_on_cluster(
            recordings(tmp_path, "a", "endless"),
            Acted(tmp_path / "runs", Config()),
            address=address,
            progress=lambda *_: None,
            warn=said.append,
        )
        assert next(running).status == "ok"
        assert "3 threads" in said[0]
        process.kill()
        (lost,) = running
    assert lost.status == "failed"
    assert "scheduler" in (lost.error or "")


def test_the_command_says_what_is_wrong_with_a_cluster(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One sentence: nothing there, no address, no workers, no Dask."""
    monkeypatch.setattr("tablemap.runs.cluster.CONNECT_SECONDS", 1)
    (file,) = recordings(tmp_path, "a")
    command = ["process", str(file), "-o", str(tmp_path / "runs"), "--scheduler"]
    for named in ("127.0.0.1:9", "nonsense://here", "nonsense"):
        with pytest.raises(ExternalToolError, match="no Dask scheduler answers"):
            CliRunner().invoke(app, [*command, named], catch_exceptions=False)
    done = tablemap(*command, address)
    assert done.returncode == 1
    assert "no workers" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ExternalToolError, match="pip install distributed"):
        CliRunner().invoke(app, [*command, address], catch_exceptions=False)
    assert CliRunner().invoke(app, [*command, address, "--jobs", "2"]).exit_code == 2
    assert not (tmp_path / "runs").exists()


@pytest.mark.slow
def test_the_command_processes_on_a_cluster(
    address: str, demo_recording: Path, tmp_path: Path
) -> None:
    """As on this machine; the killed worker's demo is done by the other, then all is done."""
    files = [tmp_path / "first.mcap", tmp_path / "second.mcap", tmp_path / "notes.mcap"]
    for file in files[:2]:
        file.symlink_to(demo_recording)
    files[2].write_text("no recording")
    output = tmp_path / "runs"
    arguments = ["process", *files, "-o", output, "--scheduler", address, "--json"]
    with workers(address, 2) as processes, ThreadPoolExecutor(1) as pool:
        running = pool.submit(tablemap, *arguments)
        deadline = time.monotonic() + 120
        while len(list(output.glob("*/*/run.rrd"))) < 2 and time.monotonic() < deadline:
            time.sleep(0.1)
        processes[0].send_signal(signal.SIGKILL)
        done = running.result()
        lines = {
            Path(line["recording"]).stem: line for line in map(json.loads, done.stdout.splitlines())
        }
        assert done.returncode == 1, done.stderr
        assert {name: line["status"] for name, line in lines.items()} == {
            "first": "ok",
            "second": "ok",
            "notes": "failed",
        }
        models = [Path(lines[name]["model"]).read_bytes() for name in ("first", "second")]
        assert models[0] == models[1]
        assert "rectangle" in done.stderr
        again = tablemap(*arguments[:3], *arguments[4:])
        assert again.returncode == 0
        assert again.stderr.count("--again") == 2
