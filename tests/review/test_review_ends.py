"""However a run ends, its folder says how, and what was done so far can be looked at."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from tablemap.archive import load_run
from tablemap.errors import EstimationError
from tablemap.review.viewer import viewer
from tests.making.reviews import run_until

STAGES = ("segmentation", "registration", "surface")
PARTS = {
    "segmentation": "/segmentation/labels",
    "registration": "/registration/after/scan/03",
    "surface": "/surface/residuals",
}


def kill() -> None:
    """End this process at once, as the kernel does where memory runs out."""
    os.kill(os.getpid(), signal.SIGKILL)


def _run_and_die(stage: str, folder: Path) -> None:
    run_until(stage, kill, folder, setattr)


def entities(file: Path) -> set[str]:
    """The entities of an .rrd."""
    return {chunk.entity_path for chunk in RrdReader(file).stream()}


@pytest.mark.parametrize("stage", [pytest.param(STAGES[0], marks=pytest.mark.slow), *STAGES[1:]])
def test_a_killed_run_opens_mended(stage: str, tmp_path: Path) -> None:
    """After a real kill all finished stages are in a whole copy; the folder says ``running``."""
    process = multiprocessing.get_context("spawn").Process(
        target=_run_and_die, args=(stage, tmp_path)
    )
    process.start()
    process.join(120)
    assert process.exitcode == -signal.SIGKILL
    run = load_run(next((tmp_path / "runs" / "lap").glob("2*")))
    assert run.manifest.status == "running"
    assert not (run.path / "table.json").exists()
    assert not (run.path.parent / "latest").exists()
    path = run.path / "run.rrd"
    cut = path.read_bytes()
    assert not viewer.is_whole(path)
    with viewer.whole(run.path.parent) as copy:
        assert copy != path
        assert viewer.is_whole(copy)
        found = entities(copy)
    for done in STAGES[: STAGES.index(stage) + 1]:
        assert PARTS[done] in found
    assert "/model/top" not in found
    assert path.read_bytes() == cut
    assert not copy.exists()


def interrupt() -> None:
    """What SIGINT and SIGTERM raise."""
    raise KeyboardInterrupt


def divide() -> None:
    """A defect."""
    raise ZeroDivisionError("by nothing")


def fail() -> None:
    """What a stage raises."""
    raise EstimationError("no <two> views overlap")


@pytest.mark.parametrize(
    ("end", "status", "words"),
    [
        (interrupt, "interrupted", "interrupted during registration"),
        (divide, "failed", "ZeroDivisionError: by nothing"),
        (fail, "failed", "no &lt;two&gt; views overlap"),
    ],
)
def test_an_end_on_the_way_leaves_its_page_and_its_review(
    end: Callable[[], None],
    status: str,
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Interruption, defect and failure: why, how far it came, and a whole .rrd of it."""
    run = run_until("registration", end, tmp_path, monkeypatch.setattr)
    assert run.manifest.status == status
    assert set(run.manifest.timings) == {
        "snapshots",
        "calibration",
        "segmentation",
        "odometry",
        "registration",
    }
    page = (run.path / "report.html").read_text(encoding="utf-8")
    assert words in page
    assert f">{status}<" in page
    assert set(run.manifest.files) == {"config.toml", "report.html", "results.npz", "run.rrd"}
    assert viewer.is_whole(run.path / "run.rrd")
    assert PARTS["registration"] in entities(run.path / "run.rrd")
