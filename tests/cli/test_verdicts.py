"""What is said of a doubtful model: why, to people, to scripts and by the exit code."""

from __future__ import annotations

import json
import weakref
from pathlib import Path

import pytest
from msgspec import structs

from tablemap import model as m
from tablemap.cli.printing import Ends, exit_code
from tablemap.events import OtherTable
from tablemap.inputs import Input
from tablemap.runs import running
from tablemap.runs.running import Outcome
from tests.making.command import tablemap_here
from tests.making.models import rectangle_model
from tests.making.quick_run import act_within, make_recording
from tests.making.run_folders import make_run

DOUBT = m.WarningEntry(
    code="accuracy.unseen_side", stage="surface", message="One side was not seen.", stamp_ns=None
)
NOTE = m.WarningEntry(
    code="legs.inferred", stage="legs", message="One leg was placed by symmetry.", stamp_ns=None
)
DOUBTFUL = structs.replace(
    rectangle_model(),
    warnings=(NOTE, DOUBT),
    verdict=m.Verdict(level="doubtful", reasons=(DOUBT.message,)),
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
    assert "note          legs.inferred: One leg was placed by symmetry." in map(str.rstrip, lines)
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
        ["note", "legs.inferred: One leg was placed by symmetry."],
    ]


BESIDE = rectangle_model(length=0.8, width=0.5, height=0.45, x=2.0, y=1.0)
WHY_NONE = "the surface at (1.00, 3.00), 0.40 m high, is probably no table: seen by one view alone"


@pytest.fixture
def with_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with two drives past three surfaces: the table, another, and one that is none."""
    others = (OtherTable(1, BESIDE), OtherTable(2, WHY_NONE))
    act_within(monkeypatch, lambda: None, others=others)
    for name in ("lap", "second"):
        make_recording(tmp_path, f"{name}.mcap")
    return tmp_path


def test_all_tables_are_told_in_a_row_each(with_all: Path) -> None:
    """What each is, or why it is none: when it is made, when it is there, and by ``runs show``."""
    tellings = [
        tablemap_here(*command.split(), cwd=with_all).stdout
        for command in ("process lap.mcap --all", "process lap.mcap --all", "runs show runs/lap")
    ]
    for told in tellings:
        first, second = (line for line in told.splitlines() if line.startswith("table 0"))
        words = ["table", "01", "rectangle 0.800 x 0.500 m, 0.450 m high, at (2.00, 1.00), good"]
        assert first.rstrip().split(maxsplit=2) == words
        assert second.rstrip().split(maxsplit=2) == ["table", "02", f"none: {WHY_NONE}"]


def test_a_run_that_is_there_is_told_as_when_it_was_made(with_all: Path) -> None:
    """By the same path, and in the same words."""
    first, second = (tablemap_here("process", "lap.mcap", cwd=with_all) for _ in range(2))
    assert "is done already" in second.stderr
    assert second.stdout == first.stdout


def test_a_batch_tells_all_tables_of_each_recording(with_all: Path) -> None:
    """After the table of the chosen ones, a line each."""
    told = tablemap_here("process", "lap.mcap", "second.mcap", "--all", "-q", cwd=with_all)
    assert (told.returncode, told.stdout) == (0, "")
    told = tablemap_here("process", "lap.mcap", "second.mcap", "--all", cwd=with_all)
    lines = [line for line in told.stdout.splitlines() if ", table 0" in line]
    assert [line.split(":")[0] for line in lines] == [
        "lap.mcap, table 01",
        "lap.mcap, table 02",
        "second.mcap, table 01",
        "second.mcap, table 02",
    ]
    assert lines[1] == f"lap.mcap, table 02: none: {WHY_NONE}"


def test_json_has_all_tables(with_all: Path) -> None:
    """With the paths of their models, or why there is none; of a run that was made before too."""
    line = json.loads(
        tablemap_here("process", "lap.mcap", "--all", "--json", "-q", cwd=with_all).stdout
    )
    shown = json.loads(tablemap_here("runs", "show", "runs/lap", "--json", cwd=with_all).stdout)
    for document in (line, shown):
        first, second = document["others"]
        assert m.TableModel.load(with_all / first["model"]).to_json() == BESIDE.to_json()
        assert (first["verdict"], first["figures"]["height"]) == ("good", 0.45)
        assert second == {"number": 2, "model": None, "error": WHY_NONE}


def test_how_recordings_ended_is_kept_without_their_models() -> None:
    """Thousands are processed by one command."""
    outcome = Outcome(Input.of("lap.mcap"), None, "ok", None, DOUBTFUL)
    held = weakref.ref(outcome)
    ends = Ends(strict=True)
    ends.add(outcome)
    del outcome
    assert held() is None
    assert (ends.code, len(ends.rows), len(ends.lines)) == (4, 2, 1)
    assert "lap.mcap is doubtful because" in ends.lines[0]
