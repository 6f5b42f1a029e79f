"""However a run ends, its folder says so: nothing half written is called whole."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec import structs

from tablemap.archive import RunFolder, load_run
from tablemap.archive.folder import RESERVE
from tablemap.archive.index import list_runs
from tablemap.archive.liveness import HEARTBEAT, Writer, is_alive
from tablemap.errors import TablemapError
from tablemap.export import export_run
from tablemap.review.page.page import Page
from tablemap.runs.running import Outcome, run
from tests.making.command import TABLEMAP, tablemap
from tests.making.models import rectangle_model
from tests.making.quick_run import act_within, make_recording
from tests.making.run_folders import make_run

FILES = {"run.rrd", "report.html", "results.npz", "table.json", "config.toml", "trajectory.tum"}


def only_run(output: Path) -> Path:
    """Return the one run folder of an output with one recording."""
    (found,) = (each for each in output.glob("*/*") if each.is_dir() and not each.is_symlink())
    return found


def ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, act: Callable[[Path], None]) -> Outcome:
    """Return how a run ends in the middle of which something is done to its folder."""
    output = tmp_path / "runs"
    act_within(monkeypatch, lambda: act(only_run(output)))
    return run(make_recording(tmp_path), output=output)


def test_an_undisturbed_run_is_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All its files are there by their hashes, and nothing of its making is left."""
    outcome = ended(tmp_path, monkeypatch, lambda folder: None)
    assert (outcome.status, outcome.error) == ("ok", None)
    assert outcome.run is not None
    names = {file.name for file in outcome.run.path.iterdir()}
    assert names == {*FILES, "manifest.json"}
    assert set(outcome.run.manifest.files) == FILES
    assert load_run(tmp_path / "runs" / "lap").path == outcome.run.path.resolve()


def moved_away(folder: Path) -> None:
    """Rename the folder."""
    folder.rename(folder.with_name("elsewhere"))


def replaced(folder: Path) -> None:
    """Put another folder of that name in its place."""
    moved_away(folder)
    folder.mkdir()


@pytest.mark.parametrize("act", [shutil.rmtree, moved_away, replaced])
def test_a_folder_that_vanishes_fails_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, act: Callable[[Path], None]
) -> None:
    """It is not made again, and no link names it."""
    outcome = ended(tmp_path, monkeypatch, act)
    assert outcome.status == "failed"
    assert "removed, renamed or replaced" in (outcome.error or "")
    assert outcome.model is None
    assert outcome.run is not None
    assert not (tmp_path / "runs" / "lap" / "latest").is_symlink()
    assert not outcome.run.path.exists() or not any(outcome.run.path.iterdir())


@pytest.mark.parametrize("name", ["config.toml", "results.npz", "run.rrd"])
def test_a_file_that_vanishes_fails_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """The manifest says so, and there is no model."""
    outcome = ended(tmp_path, monkeypatch, lambda folder: (folder / name).unlink())
    assert outcome.status == "failed"
    assert outcome.run is not None
    manifest = load_run(outcome.run.path).manifest
    assert manifest.status == "failed"
    assert name in (manifest.error or "")
    assert not (outcome.run.path / "table.json").exists()


def test_a_file_that_changes_fails_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By its hash: the settings are no longer those of the run."""
    outcome = ended(tmp_path, monkeypatch, lambda folder: _append(folder / "config.toml"))
    assert outcome.status == "failed"
    assert "config.toml" in (outcome.error or "")


def _append(file: Path) -> None:
    with file.open("a") as stream:
        stream.write("# more\n")


def test_a_review_without_its_end_fails_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rerun writes the end of its file without a word on whether that could be."""
    monkeypatch.setattr("tablemap.review.viewer.viewer.is_whole", lambda _: False)
    outcome = ended(tmp_path, monkeypatch, lambda folder: None)
    assert outcome.status == "failed"
    assert "to its end" in (outcome.error or "")


@pytest.mark.parametrize("is_folder", [True, False])
def test_what_stands_in_the_way_of_latest_is_found_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_folder: bool
) -> None:
    """No run is begun."""
    latest = tmp_path / "runs" / "lap" / "latest"
    latest.parent.mkdir(parents=True)
    latest.mkdir() if is_folder else latest.touch()
    act_within(monkeypatch, lambda: pytest.fail("it was begun"))
    outcome = run(make_recording(tmp_path), output=tmp_path / "runs")
    assert (outcome.status, outcome.run) == ("failed", None)
    assert str(latest) in (outcome.error or "")
    assert [each.name for each in latest.parent.iterdir()] == ["latest"]


def test_a_full_disk_is_said_in_the_manifest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the bytes that are kept for it, and at the last by those of the manifest itself."""
    full = OSError(28, "No space left on device")

    def fill(folder: Path) -> None:
        assert (folder / RESERVE).stat().st_size >= 64 * 1024

        def write(target: Path, content: str | bytes) -> None:
            raise full

        monkeypatch.setattr("tablemap.archive.folder.write_whole", write)

    outcome = ended(tmp_path, monkeypatch, fill)
    assert outcome.status == "failed"
    assert outcome.run is not None
    manifest = load_run(outcome.run.path).manifest
    assert manifest.status == "failed"
    assert "No space left" in (manifest.error or "")
    assert not (outcome.run.path / RESERVE).exists()


def test_memory_that_does_not_suffice_fails_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is no defect: the manifest has the reason and what to do."""

    def exhaust(folder: Path) -> None:
        raise MemoryError

    outcome = ended(tmp_path, monkeypatch, exhaust)
    assert outcome.status == "failed"
    assert outcome.run is not None
    manifest = load_run(outcome.run.path).manifest
    assert manifest.status == "failed"
    assert "memory does not suffice; free some" in (manifest.error or "")
    assert "defect" not in (manifest.error or "")


def test_a_disk_without_room_for_a_run_is_left_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No folder stays that says it runs."""

    def write(self: Path, content: bytes) -> int:
        raise OSError(28, "No space left on device")

    recording = make_recording(tmp_path)
    monkeypatch.setattr(Path, "write_bytes", write)
    outcome = run(recording, output=tmp_path / "runs")
    assert (outcome.status, outcome.run) == ("failed", None)
    assert "No space left" in (outcome.error or "")
    assert list((tmp_path / "runs").glob("*/*")) == []


def interrupt() -> None:
    """Do what Ctrl-C does."""
    os.kill(os.getpid(), signal.SIGINT)


@pytest.fixture
def python_signals() -> None:
    """Let SIGINT raise KeyboardInterrupt, as in a program."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.usefixtures("python_signals")
def test_an_interrupted_run_says_so_also_when_interrupted_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second signal comes while the folder is being marked."""
    whole = Page.html

    def html(*arguments: object, **options: object) -> str:
        interrupt()
        return whole(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(Page, "html", html)
    with pytest.raises(KeyboardInterrupt):
        ended(tmp_path, monkeypatch, lambda folder: interrupt())
    left = load_run(only_run(tmp_path / "runs"))
    assert (left.manifest.status, left.manifest.error) == (
        "interrupted",
        "interrupted during snapshots",
    )
    assert (left.path / "report.html").is_file()
    assert not any((left.path / name).exists() for name in (HEARTBEAT, RESERVE))


@pytest.mark.usefixtures("python_signals")
def test_a_run_interrupted_at_its_very_end_leaves_no_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its table.json was written already."""
    monkeypatch.setattr(RunFolder, "become_latest", lambda _: interrupt())
    with pytest.raises(KeyboardInterrupt):
        ended(tmp_path, monkeypatch, lambda folder: None)
    left = load_run(only_run(tmp_path / "runs"))
    assert left.manifest.status == "interrupted"
    assert not (left.path / "table.json").exists()
    assert "table.json" not in left.manifest.files


@pytest.mark.usefixtures("python_signals")
def test_a_run_interrupted_while_its_folder_is_made_leaves_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the folder and its first file."""
    monkeypatch.setattr(RunFolder, "update", lambda self, **_: interrupt())
    with pytest.raises(KeyboardInterrupt):
        run(make_recording(tmp_path), output=tmp_path / "runs")
    assert list((tmp_path / "runs" / "lap").iterdir()) == []


def test_a_killed_run_is_dead_and_not_exported(tmp_path: Path) -> None:
    """Its manifest says that it runs; the list knows better. A live one is left alone."""
    runs = tmp_path / "runs"
    gone = structs.replace(Writer.this(), began=1)
    make_run(runs, "lap/a", rectangle_model(), status="running", writer=gone)
    make_run(runs, "lap/b", rectangle_model(), status="running", writer=Writer.this())
    rows = {row.path: row for row in list_runs(runs)}
    assert {path: row.status for path, row in rows.items()} == {"lap/a": "dead", "lap/b": "running"}
    assert {row.shape for row in rows.values()} == {None}
    for name, word in (("a", "was killed"), ("b", "goes on")):
        for what in (runs / "lap" / name, runs / "lap" / name / "table.json"):
            with pytest.raises(TablemapError, match=word):
                export_run(what, ["svg"])
        with pytest.raises(TablemapError, match=word):
            _ = load_run(runs / "lap" / name).model
    shown = tablemap("runs", "show", runs / "lap" / "a")
    assert "dead" in shown.stdout
    listed = tablemap("runs", "list", runs, "--status", "dead")
    assert "lap/a" in listed.stdout
    assert "lap/b" not in listed.stdout
    removed = tablemap("runs", "prune", runs, "--older-than", "0", "--yes")
    assert removed.stdout.split() == [str(runs / "lap" / "a")]
    assert (runs / "lap" / "b").is_dir()


def test_a_process_is_told_by_its_beginning(tmp_path: Path) -> None:
    """Numbers of processes are used again; of another machine's the heartbeat tells."""
    here = Writer.this()
    assert is_alive(tmp_path, here)
    assert not is_alive(tmp_path, structs.replace(here, began=(here.began or 0) + 1))
    assert not is_alive(tmp_path, structs.replace(here, boot="before"))
    assert not is_alive(tmp_path, structs.replace(here, began=None, pid=2**22 + 1))
    there = structs.replace(here, host="another")
    assert not is_alive(tmp_path, there)
    (tmp_path / HEARTBEAT).touch()
    assert is_alive(tmp_path, there)
    hour_ago = time.time() - 3600
    os.utime(tmp_path / HEARTBEAT, (hour_ago, hour_ago))
    assert not is_alive(tmp_path, there)


# The whole program, from outside.

MOMENTS = (0.3, 1.0, 2.0, 3.0, 4.5, 6.0, 8.0, 10.0)
NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)


def hear_all() -> None:
    """Let a program that is begun hear every signal, also where the tests were told to ignore some.

    Whatever is begun by nohup, or by a shell in the background, hands on what it ignores.
    """
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def manifests(output: Path) -> list[dict[str, object]]:
    """Return the manifests of all runs."""
    return [json.loads(file.read_text()) for file in output.glob("*/*/manifest.json")]


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize("number", NUMBERS)
def test_signals_at_any_moment_are_said(
    demo_recording: Path, tmp_path: Path, number: signal.Signals, jobs: int
) -> None:
    """In the exit code, in the manifest, and in no traceback; a kill in the list of runs."""
    other = tmp_path / "other.mcap"
    shutil.copy(demo_recording, other)
    recordings = [demo_recording, other][:jobs]
    for moment in MOMENTS:
        output = tmp_path / f"runs-{moment}"
        command = [*TABLEMAP, "process", *recordings, "-o", output, "-j", jobs, "--review", "off"]
        begun = subprocess.Popen(
            list(map(str, command)),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=hear_all,
        )
        time.sleep(moment)
        if number in (signal.SIGINT, signal.SIGHUP):  # a terminal tells all that run in it
            os.killpg(begun.pid, number)
            time.sleep(0.2)
            os.killpg(begun.pid, number)
        else:
            begun.send_signal(number)
        _, said = begun.communicate(timeout=120)
        assert "Traceback" not in said, (moment, said)
        ends = [(str(each["status"]), each["error"]) for each in manifests(output)]
        if number == signal.SIGKILL:
            _wait_for_workers(output)
            listed = {row.status for row in list_runs(output)} if output.is_dir() else set()
            assert "running" not in listed
            continue
        assert begun.returncode in (0, -number, 128 + number), (moment, begun.returncode, said)
        assert {status for status, _ in ends} <= {"ok", "interrupted"}, (moment, ends)
        for each in output.glob("*/*/table.json"):
            assert load_run(each.parent).manifest.status == "ok"


def _wait_for_workers(output: Path) -> None:
    """Give the workers of a killed parent time to see that it is gone."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and any(
        row.status == "running" for row in (list_runs(output) if output.is_dir() else [])
    ):
        time.sleep(0.5)


FULL = """
mount -t tmpfs -o size={size} tmpfs {disk} && cd {disk} &&
{command} process {recording} -o {disk}/runs --json > {said}/out 2> {said}/err
echo $? > {said}/code
cp -r {disk}/runs {said}/runs || true
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "size", ["64k", "300k", "450k", "800k", "1500k", "2500k", "4000k", "6000k"]
)
def test_a_full_disk_is_said_within_seconds(
    demo_recording: Path, tmp_path: Path, size: str
) -> None:
    """The manifest is honest, stderr has no line that is not ours, and nothing hangs."""
    disk, said = tmp_path / "disk", tmp_path / "said"
    disk.mkdir()
    said.mkdir()
    command = f"{sys.executable} -c 'from tablemap.cli import main; main()'"
    script = FULL.format(
        size=size, disk=disk, said=said, command=command, recording=demo_recording.resolve()
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))}
    begun = time.monotonic()
    done = subprocess.run(
        ["unshare", "-rm", "bash", "-c", script],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
        timeout=120,
    )
    if not (said / "code").exists():
        pytest.skip(f"no disk of a size of its own can be mounted here: {done.stderr.strip()}")
    line = json.loads((said / "out").read_text())
    error = (said / "err").read_text()
    assert "re_log" not in error
    assert "Traceback" not in error
    assert time.monotonic() - begun < 60
    if line["status"] == "ok":
        assert [each["status"] for each in manifests(said / "runs")] == ["ok"]
        return
    assert line["status"] == "failed"
    assert "full" in line["error"] or "No space left" in line["error"]
    assert {each["status"] for each in manifests(said / "runs")} <= {"failed"}
    assert list((said / "runs").glob("*/*/table.json")) == []
    assert list((said / "runs").glob("*/latest")) == []


@pytest.mark.slow
def test_ten_processes_on_one_output_disturb_each_other_in_nothing(
    demo_recording: Path, tmp_path: Path
) -> None:
    """Ten whole runs, one model; ``latest`` names one of them, and the list has all."""
    output = tmp_path / "runs"
    command = [*TABLEMAP, "process", demo_recording, "-o", output, "--again"]
    begun = [
        subprocess.Popen(
            [*map(str, command), "--json", "-q"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        for _ in range(10)
    ]
    for process in begun:
        for _ in range(2):
            tablemap("runs", "list", output) if output.is_dir() else time.sleep(0.2)
        out, err = process.communicate(timeout=600)
        assert process.returncode == 0, (out, err)
    assert [row.status for row in list_runs(output)] == ["ok"] * 10
    for folder in output.glob("demo/2*"):
        assert {file.name for file in folder.iterdir()} == {*FILES, "manifest.json"}
    models = {load_run(row).model.to_json() for row in output.glob("demo/2*")}
    assert len(models) == 1
    assert (output / "demo" / "latest").resolve() in set(output.resolve().glob("demo/2*"))
    verified = tablemap("runs", "verify", *output.glob("demo/2*"))
    assert verified.returncode == 0, verified.stdout
