"""Runs are listed as they are, whatever the index says, and selected by what they hold."""

from __future__ import annotations

import json
from pathlib import Path
from typing import get_args

import pytest

from tablemap.archive.index import INDEX, list_runs
from tablemap.archive.manifest import Status
from tablemap.archive.selection import STATUSES, VERDICTS, Selection
from tablemap.errors import ConfigError, TablemapError
from tablemap.model import Level
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run, read_runs


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """Three runs of two recordings: a low table, a high one, and one that failed."""
    folder = tmp_path / "runs"
    make_run(folder, "kitchen/a", rectangle_model(height=0.70), started="2026-05-01T23:59:59+00:00")
    make_run(folder, "office/b", rectangle_model(height=0.80), started="2026-05-02T08:00:00+00:00")
    make_run(folder, "office/c", None, status="failed", started="2026-05-03T08:00:00+00:00")
    return folder


def test_a_row_holds_the_run_s_figures(runs: Path) -> None:
    """Metres and seconds, with sigmas."""
    first, second, failed = list_runs(runs)
    assert [first.path, second.path, failed.path] == ["kitchen/a", "office/b", "office/c"]
    assert (first.shape, first.verdict, first.status) == ("rectangle", "good", "ok")
    assert first.figures["height"] == 0.70
    assert first.figures["length_sigma"] == 0.002
    assert first.figures["x_sigma"] == 0.002
    assert (first.figures["legs"], first.figures["seconds"]) == (4, 1.75)
    assert (failed.shape, failed.error) == (None, "why it is failed")


def test_the_index_says_what_the_folders_say(runs: Path) -> None:
    """Made by the first listing, used by the second."""
    truth = read_runs(runs)
    assert not (runs / INDEX).exists()
    assert list_runs(runs) == truth
    assert (runs / INDEX).is_file()
    assert list_runs(runs) == truth


def test_an_index_is_used_where_nothing_changed(runs: Path) -> None:
    """A run whose files are as they were is not read again."""
    list_runs(runs)
    text = (runs / INDEX).read_text()
    (runs / INDEX).write_text(text.replace('"good"', '"marked"'))
    assert [row.verdict for row in list_runs(runs)] == ["marked", "marked", None]


def test_what_changed_is_read_again(runs: Path) -> None:
    """A new run, one that is gone, and one with another model."""
    list_runs(runs)
    make_run(runs, "hall/d", rectangle_model())
    (runs / "kitchen/a/manifest.json").unlink()
    (runs / "office/b/table.json").write_text(rectangle_model(height=0.9).to_json())
    rows = {row.path: row for row in list_runs(runs)}
    assert set(rows) == {"hall/d", "office/b", "office/c"}
    assert rows["office/b"].figures["height"] == 0.9
    assert list(rows.values()) == read_runs(runs)


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{", '{"schema": "tablemap/index/2", "names": [], "runs": [[1, 2, 3, 4, "a/b"]]}'],
)
def test_a_damaged_index_is_built_again(runs: Path, text: str) -> None:
    """It is never the truth."""
    (runs / INDEX).write_text(text)
    assert list_runs(runs) == read_runs(runs)
    assert json.loads((runs / INDEX).read_text())["schema"] == "tablemap/index/2"


def test_an_index_with_a_shape_that_is_none_is_built_again(runs: Path) -> None:
    """As any other damage."""
    rows = list_runs(runs)
    text = (runs / INDEX).read_text()
    assert text.count('"rectangle"') >= 2
    (runs / INDEX).write_text(text.replace('"rectangle"', '"blob"'))
    assert list_runs(runs) == rows


def test_damage_is_said_in_the_row(runs: Path) -> None:
    """A manifest or a model that cannot be read hides no run and stops no list."""
    (runs / "kitchen/a/manifest.json").write_text("{")
    (runs / "office/b/table.json").write_text("{}")
    damaged, headless, _ = list_runs(runs)
    assert (damaged.status, damaged.shape) == ("damaged", None)
    assert "manifest" in (damaged.error or "")
    assert headless.shape is None
    assert "schema" in (headless.error or "")


def test_a_folder_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    """And an empty one has no runs."""
    with pytest.raises(TablemapError, match="folder of runs"):
        list_runs(tmp_path / "none")
    assert list_runs(tmp_path) == []


@pytest.mark.parametrize(
    ("selection", "expected"),
    [
        (Selection(), ["kitchen/a", "office/b", "office/c"]),
        (Selection(recording="kit*"), ["kitchen/a"]),
        (Selection(shape=("rectangle",), status=("ok", "failed")), ["kitchen/a", "office/b"]),
        (Selection(verdict=("doubtful",)), []),
        (Selection(since="2026-05-02"), ["office/b", "office/c"]),
        (Selection(until="2026-05-01"), ["kitchen/a"]),
        (Selection(until="2026-05-02T08:00:00"), ["kitchen/a"]),
        (Selection(where=("height<0.75",)), ["kitchen/a"]),
        (Selection(where=("height >= 0.7", "legs=4")), ["kitchen/a", "office/b"]),
        (Selection(where=("height!=0.7",)), ["office/b"]),
        (Selection(sort="-height"), ["office/b", "kitchen/a", "office/c"]),
        (Selection(sort="-started"), ["office/c", "office/b", "kitchen/a"]),
    ],
)
def test_runs_are_selected_and_sorted(
    runs: Path, selection: Selection, expected: list[str]
) -> None:
    """By words, dates and figures; what a run lacks puts it last, or out."""
    assert [row.path for row in selection.of(list_runs(runs))] == expected


@pytest.mark.parametrize(
    "selection",
    [
        Selection(since="yesterday"),
        Selection(where=("height",)),
        Selection(where=("height<low",)),
        Selection(where=("hight<1",)),
        Selection(sort="hight"),
        Selection(shape=("rectangel",)),
    ],
)
def test_what_cannot_be_read_is_wrong_usage(runs: Path, selection: Selection) -> None:
    """With an example or the nearest name."""
    with pytest.raises(ConfigError, match=r"2026|height|rectangle"):
        selection.of(list_runs(runs))


def test_statuses_and_verdicts_are_those_of_manifests_and_models() -> None:
    """And those that a list itself gives a run."""
    assert (*get_args(Status), "dead", "damaged") == STATUSES
    assert get_args(Level) == VERDICTS
