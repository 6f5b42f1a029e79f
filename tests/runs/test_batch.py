"""Many recordings: found by name, skipped where done, and isolated from each other's failures."""

from __future__ import annotations

import gc
import threading
from pathlib import Path

import pytest

from tablemap.archive import load_run
from tablemap.config import Config, load_config
from tablemap.errors import ConfigError
from tablemap.recording import Recording
from tablemap.runs import Job, done_already, expand, process_many
from tablemap.runs.running import run
from tests.making.acting import Acted
from tests.making.models import rectangle_model
from tests.making.quick_run import act_within, make_recording
from tests.making.run_folders import make_run


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A file that stands for a recording."""
    file = tmp_path / "lap.mcap"
    file.write_bytes(b"a recording")
    return file


def test_globs_and_lists_name_recordings_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the order they are named; a glob without a match stands for itself."""
    monkeypatch.chdir(tmp_path)
    for name in ("b.mcap", "a.mcap", "sub/c.mcap", "odd[1].mcap"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "list.txt").write_text("# laps\n\n  b.mcap \nsub/*.mcap\nmissing.mcap\n")
    found = expand(["@list.txt", "[ab].mcap", "odd[1].mcap", "no*.mcap"])
    names = ["b.mcap", "sub/c.mcap", "missing.mcap", "a.mcap", "odd[1].mcap", "no*.mcap"]
    assert [str(path) for path in found] == names
    assert [path.name for path in expand([f"{tmp_path}/**/c.mcap"])] == ["c.mcap"]
    with pytest.raises(ConfigError, match=r"none\.txt"):
        expand(["@none.txt"])


def test_what_is_done_is_known_by_bytes_config_and_versions(
    recording: Path, tmp_path: Path
) -> None:
    """Anything else that is different makes another run."""
    runs = tmp_path / "runs"
    make_run(runs, "lap/a", rectangle_model(), recording=recording)
    job = Job(runs, Config())
    held = done_already(recording, job)
    assert held is not None
    assert held.path == runs / "lap" / "a"
    assert done_already(recording, Job(runs, load_config(overrides=["seed=1"]))) is None
    assert done_already(recording, Job(runs, Config(method="report"))) is None
    assert done_already(recording, Job(runs, Config(tables=(1.0, 2.0)))) is None
    held.update(versions={**held.manifest.versions, "tablemap": "0.0.1"})
    assert done_already(recording, job) is None


@pytest.mark.parametrize("status", ["failed", "interrupted", "running"])
def test_a_run_without_a_model_is_not_done(recording: Path, tmp_path: Path, status: str) -> None:
    """It is worth another try."""
    make_run(tmp_path / "runs", "lap/a", None, recording=recording, status=status)  # type: ignore[arg-type]
    assert done_already(recording, Job(tmp_path / "runs", Config())) is None


def test_other_bytes_of_the_same_size_are_another_recording(
    recording: Path, tmp_path: Path
) -> None:
    """The hash decides."""
    make_run(tmp_path / "runs", "lap/a", rectangle_model(), recording=recording)
    recording.write_bytes(b"A RECORDING")
    assert done_already(recording, Job(tmp_path / "runs", Config())) is None


NAMES = ("good", "defect", "hungry", "deadly", "once", "last")


def test_failures_and_deaths_stay_alone(tmp_path: Path) -> None:
    """A defect fails its recording; a worker that died is replaced, its recording tried again."""
    recordings = [tmp_path / f"{n}.mcap" for n in NAMES]
    for file in recordings:
        file.write_bytes(b"x")
    begun: list[str] = []
    outcomes = {
        outcome.recording.stem: outcome
        for outcome in process_many(
            recordings,
            Acted(tmp_path / "runs", Config()),
            jobs=2,
            progress=lambda path, _: begun.append(path.stem),
        )
    }
    statuses = {name: outcome.status for name, outcome in outcomes.items()}
    assert statuses == {
        "good": "ok",
        "defect": "failed",
        "hungry": "failed",
        "deadly": "failed",
        "once": "ok",
        "last": "ok",
    }
    assert "of this recording" in (outcomes["defect"].error or "")
    assert "process fewer recordings at once" in (outcomes["hungry"].error or "")
    assert "signal 9" in (outcomes["deadly"].error or "")
    assert begun.count("deadly") == begun.count("once") == 2
    for name, expected in (("deadly", ["interrupted"] * 2), ("once", ["interrupted", "ok"])):
        runs = [run for run in (tmp_path / "runs" / name).iterdir() if not run.is_symlink()]
        assert sorted(load_run(run).manifest.status for run in runs) == expected


def test_runs_leave_no_thread_no_file_and_no_recording_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many one process does, and before anybody collects garbage."""
    act_within(monkeypatch, lambda: None)
    file = make_recording(tmp_path)
    there = []
    gc.collect()  # what tests before this one left
    gc.disable()
    try:
        for _ in range(6):
            assert run(file, output=tmp_path / "runs").status == "ok"
            recordings = [held for held in gc.get_objects() if isinstance(held, Recording)]
            there.append((threading.active_count(), _open_files(tmp_path), recordings))
    finally:
        gc.enable()
    assert there[-1] == there[1] == (there[1][0], [], [])


def _open_files(folder: Path) -> list[str]:
    """Return which files below a folder this process has open (on Linux)."""
    files = [link.readlink() for link in Path("/proc/self/fd").iterdir() if link.is_symlink()]
    return [str(file) for file in files if file.is_relative_to(folder)]
