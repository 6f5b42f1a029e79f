"""What tests share: where the demo and the real recordings are."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from pathlib import Path

import pytest

from tests.making.command import tablemap
from tests.making.rewriting import simulate_plain

# What a shell starts in the background ignores SIGINT, and so would the runs that tests interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).resolve().parent.parent
IMPORTS = "imports.txt"


@pytest.fixture(scope="session")
def demo_recording() -> Path:
    """The recording that the project ships."""
    return ROOT / "recordings" / "demo.mcap"


@pytest.fixture(scope="session")
def plain_recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cheap simulated recording with nothing unusual, which tests rewrite."""
    return simulate_plain(tmp_path_factory.mktemp("plain"))


@pytest.fixture(scope="session")
def exact_recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated recording without any error, at full resolution."""
    from tablemap.simulation import load_scenario, simulate, write

    path = tmp_path_factory.mktemp("exact") / "exact.mcap"
    write(simulate(load_scenario("exact"), seed=3), path)
    return path


@pytest.fixture(scope="session")
def real_recordings() -> Path:
    """The folder of real recordings; skips where it is missing."""
    named = os.environ.get("TABLEMAP_REAL_RECORDINGS")
    folder = Path(named) if named else ROOT.parent / "shared" / "recordings"
    if not folder.is_dir():
        pytest.skip(f"no real recordings at {folder}; set TABLEMAP_REAL_RECORDINGS to their folder")
    return folder


@pytest.fixture(scope="session")
def finished(
    demo_recording: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """The demo processed and exported once: its run folder and what the command said."""
    output = tmp_path_factory.mktemp("demo") / "runs"
    done = tablemap(
        *("process", demo_recording, "-o", output, "--json", "--export", "svg", "--export", "nav2"),
        imports=output.parent / IMPORTS,
    )
    assert done.returncode == 0, done.stderr
    return Path(json.loads(done.stdout)["run"]), done


@pytest.fixture(scope="session")
def demo_imports(finished: tuple[Path, object]) -> list[str]:
    """The names of all modules that processing the demo imported."""
    return (finished[0].parents[2] / IMPORTS).read_text(encoding="utf-8").split()
