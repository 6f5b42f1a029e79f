"""What is said of a doubtful model: why, to people, to scripts and by the exit code."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tablemap import model as m
from tablemap.cli.printing import exit_code
from tablemap.events import OtherTable
from tablemap.inputs import Input
from tablemap.runs import running
from tablemap.runs.running import Outcome
from tests.making.command import tablemap_here
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run

DOUBT = m.WarningEntry(
    code="accuracy.unseen_side", stage="surface", message="One side was not seen.", stamp_ns=None
)
NOTE = m.WarningEntry(
    code="legs.inferred", stage="legs", message="One leg was put by symmetry.", stamp_ns=None
)
DOUBTFUL = rectangle_model().model_copy(
    update={
        "warnings": (NOTE, DOUBT),
        "verdict": m.Verdict(level="doubtful", reasons=(DOUBT.message,)),
    }
)


@pytest.fixture
def acted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with two recordings, of which ``low.mcap`` gives a doubtful model."""
    for name in ("low", "high"):
        (tmp_path / f"{name}.mcap").write_bytes(b"a recording")

    def stand_in(recording: Input, *, output: Path, **_: object) -> Outcome:
        model = DOUBTFUL if recording.stem == "low" else rectangle_model()
        folder = make_run(output, f"{recording.stem}/a", model)
        return Outcome(recording, folder, "ok", None, model)

    monkeypatch.setattr(running, "run", stand_in)
    monkeypatch.setattr("tablemap.runs.jobs.run", stand_in)
    return tmp_path


def test_process_ends_with_why_its_model_is_doubtful(acted: Path) -> None:
    """Apart from the notes, which doubt nothing; a good model ends with how to open it."""
    lines = tablemap_here("process", "low.mcap", cwd=acted).stdout.splitlines()
    assert lines[-2:] == ["doubtful because:", "  accuracy.unseen_side: One side was not seen."]
    assert "note          legs.inferred: One leg was put by symmetry." in map(str.rstrip, lines)
    good = tablemap_here("process", "high.mcap", cwd=acted).stdout
    assert good.splitlines()[-1].startswith("open it")


def test_a_batch_says_it_a_line_a_recording(acted: Path) -> None:
    """After the table of all; of the doubtful ones alone."""
    out = tablemap_here("process", "low.mcap", "high.mcap", cwd=acted).stdout.splitlines()
    assert [line for line in out if "because" in line] == [
        "low.mcap is doubtful because: accuracy.unseen_side: One side was not seen."
    ]


def test_json_has_verdict_figures_and_reasons(acted: Path) -> None:
    """In one line a recording; a script need not open the model."""
    done = tablemap_here("process", "low.mcap", "high.mcap", "--json", "-q", cwd=acted)
    low, high = map(json.loads, done.stdout.splitlines())
    assert (low["verdict"], low["reasons"]) == ("doubtful", [DOUBT.message])
    assert (high["verdict"], high["reasons"]) == ("good", [])
    assert low["figures"]["height"] == 0.743
    assert low["figures"]["length_sigma"] == 0.002


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["low.mcap"], 0),
        (["low.mcap", "--strict"], 4),
        (["high.mcap", "--strict"], 0),
        (["high.mcap", "low.mcap", "--strict"], 4),
    ],
)
def test_strict_makes_doubtful_an_exit_code(acted: Path, arguments: list[str], code: int) -> None:
    """Without it, a doubtful model is a model."""
    assert tablemap_here("process", *arguments, "-q", cwd=acted).returncode == code


def test_a_failed_recording_weighs_more_than_a_doubtful_one() -> None:
    """And doubt more than what was read only in part."""
    recording = Input.of("lap.mcap")
    failed = Outcome(recording, None, "failed", "why", None)
    doubtful = Outcome(recording, None, "partial", "why", DOUBTFUL)
    assert exit_code([doubtful, failed], strict=True) == 1
    assert exit_code([doubtful], strict=True) == 4
    assert exit_code([doubtful], strict=False) == 3


def test_show_says_it_too(acted: Path) -> None:
    """Of a run that was made before."""
    tablemap_here("process", "low.mcap", "-q", cwd=acted)
    lines = tablemap_here("runs", "show", "runs/low/a", cwd=acted).stdout.splitlines()
    assert [line.split(maxsplit=1) for line in lines[-2:]] == [
        ["because", "accuracy.unseen_side: One side was not seen."],
        ["note", "legs.inferred: One leg was put by symmetry."],
    ]


def test_all_tables_are_told_in_a_row_each(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What each is, or why it is none; what the run left is shown again."""
    (tmp_path / "lap.mcap").write_bytes(b"a recording")
    beside = rectangle_model(length=0.8, width=0.5, height=0.45, x=2.0, y=1.0)

    def stand_in(recording: Input, *, output: Path, **_: object) -> Outcome:
        folder = make_run(output, "lap/a", rectangle_model())
        folder.write("tables/01.json", beside.to_json())
        others = (OtherTable(1, beside), OtherTable(2, "it is hardly a table: it is a shelf"))
        return Outcome(recording, folder, "ok", None, rectangle_model(), others)

    monkeypatch.setattr("tablemap.runs.jobs.run", stand_in)
    told = tablemap_here("process", "lap.mcap", "--all", cwd=tmp_path).stdout
    shown = tablemap_here("runs", "show", "runs/lap/a", cwd=tmp_path).stdout
    first, second = (line for line in told.splitlines() if line.startswith("table 0"))
    words = ["table", "01", "rectangle 0.800 x 0.500 m, 0.450 m high, at (2.00, 1.00), good"]
    assert first.rstrip().split(maxsplit=2) == words
    assert second.rstrip().split(maxsplit=2)[1:] == [
        "02",
        "none: it is hardly a table: it is a shelf",
    ]
    (line,) = (line for line in shown.splitlines() if line.startswith("table 0"))
    assert line.split(maxsplit=2) == words
