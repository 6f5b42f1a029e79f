"""The command line: one sentence for what is wrong, and the contract's exit codes."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.test_demo import TABLEMAP, tablemap

README = Path(__file__).resolve().parent.parent / "README.md"
COMMANDS = ["process", "info", "export", "view", "simulate", "evaluate", "config", "runs"]
RUNS = ["list", "show", "compare", "verify", "reprocess", "prune", "pack", "unpack"]


def test_help_names_every_command() -> None:
    """And this file knows them all."""
    for group, known in ((), COMMANDS), (("runs",), RUNS):
        text = tablemap(*group, "--help").stdout
        listed = re.findall(r"^  ([a-z]+)  ", text.split("Commands:")[1], flags=re.M)
        assert sorted(listed) == sorted(known)


@pytest.mark.parametrize("command", [*COMMANDS, *(f"runs {name}" for name in RUNS)])
def test_the_readme_has_every_command_and_option(command: str) -> None:
    """What is not documented is not there."""
    readme = README.read_text(encoding="utf-8")
    assert f"`{command}" in readme or f"tablemap {command}" in readme
    options = set(re.findall(r"(?<![\w-])(--[a-z-]+)", tablemap(*command.split(), "--help").stdout))
    assert options
    assert not {option for option in options if option not in readme}


def test_version() -> None:
    """As the package says."""
    from tablemap import __version__

    assert tablemap("--version").stdout == f"tablemap {__version__}\n"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"this is a text file\n" * 10, "MCAP"),
        (b"", "empty"),
    ],
)
def test_a_file_that_is_no_recording_is_one_sentence(
    content: bytes, words: str, tmp_path: Path
) -> None:
    """By ``process`` and by ``info``."""
    file = tmp_path / "lap.mcap"
    file.write_bytes(content)
    for arguments in (["process", file, "-o", tmp_path / "runs", "-q"], ["info", file]):
        done = tablemap(*arguments)
        assert done.returncode == 1, done.stderr
        assert done.stdout == ""
        assert words in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1


def test_a_recording_without_messages_cannot_be_processed(tmp_path: Path) -> None:
    """What is missing is named; ``info`` says the same and shows the rest."""
    file = tmp_path / "lap.mcap"
    file.write_bytes(b"\x89MCAP0\r\n")
    done = tablemap("process", file, "-o", tmp_path / "runs", "-q")
    assert done.returncode == 1
    assert "depth" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    shown = tablemap("info", file)
    assert shown.returncode == 0
    assert "missing: " in shown.stdout


@pytest.mark.parametrize("command", ["process", "info"])
@pytest.mark.parametrize("name", ["missing.mcap", "."])
def test_a_missing_path_or_a_directory_is_one_sentence(
    command: str, name: str, tmp_path: Path
) -> None:
    """Exit 1, and nothing is made."""
    done = tablemap(command, tmp_path / name, cwd=tmp_path)
    assert done.returncode == 1
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_failed_recording_has_its_json_line(tmp_path: Path) -> None:
    """With null for what there is not."""
    done = tablemap("process", tmp_path / "none.mcap", "--json", cwd=tmp_path)
    line = json.loads(done.stdout)
    assert (line["run"], line["model"], line["status"]) == (None, None, "failed")
    assert "none.mcap" in line["error"]


@pytest.mark.parametrize(
    "arguments",
    [
        ["process"],
        ["process", "a.mcap", "--set", "surface.nonsense=1"],
        ["process", "a.mcap", "--near", "1"],
        ["process", "a.mcap", "--near", "1", "2", "--all"],
        ["process", "a.mcap", "--method", "guess"],
        ["simulate", "demo"],
        ["nonsense"],
    ],
)
def test_wrong_usage_exits_with_2(arguments: list[str], tmp_path: Path) -> None:
    """Before anything is made."""
    done = tablemap(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_scenario_is_one_sentence(tmp_path: Path) -> None:
    """With the nearest name."""
    done = tablemap("simulate", "rectangl", "-o", tmp_path / "a.mcap")
    assert done.returncode == 2
    assert "rectangle" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_run_says_so(
    number: signal.Signals, code: int, demo_recording: Path, tmp_path: Path
) -> None:
    """The folder keeps its review, has no model, and is marked."""
    running = subprocess.Popen(
        [*TABLEMAP, "process", str(demo_recording), "-o", str(tmp_path)],
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 120
    while not list(tmp_path.glob("demo/*/run.rrd")) and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.5)
    running.send_signal(number)
    _, errors = running.communicate(timeout=120)
    assert running.returncode == code, errors
    assert "Traceback" not in errors
    (folder,) = (path for path in (tmp_path / "demo").iterdir() if path.name != "latest")
    assert json.loads((folder / "manifest.json").read_text())["status"] == "interrupted"
    assert (folder / "run.rrd").stat().st_size > 0
    assert not (folder / "table.json").exists()
