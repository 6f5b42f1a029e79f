"""``evaluate`` of runs, and the list of scenarios."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from tablemap.archive import RunFolder
from tests.making.command import tablemap, tablemap_here
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run

TRUTH = {
    "schema": "tablemap/truth/1",
    "frame": "map",
    "surface": {
        "shape": "rectangle",
        "pose": {"x": 0.31, "y": -0.22, "yaw": 0.37},
        "height": 0.743,
        "dimensions": {"length": 1.187, "width": 0.806},
    },
}


@pytest.fixture
def runs(tmp_path: Path) -> list[RunFolder]:
    """Two runs of a recording with truth: one right, one whose length is 3 mm too large."""
    recording = tmp_path / "lap.mcap"
    recording.write_bytes(b"a recording")
    (tmp_path / "lap.truth.json").write_text(json.dumps(TRUTH))
    models = {"a": rectangle_model(), "b": rectangle_model(length=1.190)}
    return [
        make_run(tmp_path / "runs", f"lap/{name}", model, recording=recording)
        for name, model in models.items()
    ]


def test_one_run_is_one_table(runs: list[RunFolder]) -> None:
    """A row a figure: truth, model, error, sigma; then what is counted."""
    done = tablemap_here("evaluate", runs[1].path)
    figures, counts = (part.splitlines() for part in done.stdout.split("\n\n"))
    assert figures[0].split() == ["truth", "model", "error", "sigma", "in", "95", "%", "status"]
    rows = {line.split()[0]: line.split()[1:] for line in figures[1:]}
    assert rows["shape"] == ["rectangle", "rectangle", "right"]
    assert rows["length"] == [
        "1.1870",
        "m",
        "1.1900",
        "m",
        "+3.0",
        "mm",
        "2.0",
        "mm",
        "yes",
        "measured",
    ]
    assert rows["height"] == [
        "0.7430",
        "m",
        "0.7430",
        "m",
        "+0.0",
        "mm",
        "2.0",
        "mm",
        "yes",
        "measured",
    ]
    assert [line.split()[0] for line in counts] == ["poses", "outline", "legs", "views", "remark"]
    assert done.stderr == ""


def test_scores_of_runs_are_written_where_they_are_asked_for(
    runs: list[RunFolder], tmp_path: Path
) -> None:
    """And nowhere else."""
    before = set(tmp_path.rglob("*"))
    assert tablemap_here("evaluate", runs[0].path, cwd=tmp_path).returncode == 0
    assert set(tmp_path.rglob("*")) == before
    out = tmp_path / "out"
    done = tablemap_here("evaluate", *(run.path for run in runs), "-o", out, "--json")
    assert done.returncode == 0, done.stderr
    names = ["errors.svg", "figures.csv", "scores.json", "scores.md"]
    assert sorted(file.name for file in out.iterdir()) == names
    assert json.loads(done.stdout) == json.loads((out / "scores.json").read_text())
    with (out / "figures.csv").open() as file:
        lengths = [row["error"] for row in csv.DictReader(file) if row["figure"] == "length"]
    assert lengths == ["0.000000", "0.003000"]


@pytest.mark.parametrize("options", [["--truth", "lap.truth.json"], ["--tables"]])
def test_what_is_not_of_several_runs_is_wrong_usage(
    options: list[str], runs: list[RunFolder], tmp_path: Path
) -> None:
    """Nothing is scored by half."""
    done = tablemap_here("evaluate", *(run.path for run in runs), *options, cwd=tmp_path)
    assert done.returncode == 2
    assert options[0] in done.stderr


def test_scenarios_are_listed_with_what_they_are() -> None:
    """In columns for people, as objects for scripts."""
    lines = tablemap_here("simulate", "--list").stdout.splitlines()
    (demo,) = (line for line in lines if line.startswith("demo "))
    known = json.loads(tablemap_here("simulate", "--list", "--json").stdout)
    assert len(lines) == len(known)
    (entry,) = (each for each in known if each["name"] == "demo")
    assert demo.split(maxsplit=1) == ["demo", entry["description"]]
    assert {"report", "hard"} <= {name for each in known for name in each["suites"]}


@pytest.mark.parametrize(("columns", "least"), [(60, 50), (150, 100)])
def test_help_uses_the_terminal_s_width(
    columns: int, least: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The longest line is broken no earlier than it must be."""
    monkeypatch.setattr("tests.making.command.PLAIN", {"COLUMNS": str(columns), "NO_COLOR": "1"})
    lines = tablemap("process", "--help").stdout.splitlines()
    assert least < max(map(len, lines)) <= columns
