"""What the command's options say goes into ``config.toml``, so that the file repeats the run."""

from __future__ import annotations

from pathlib import Path

import pytest

from tablemap.config import Config, load_config
from tablemap.inputs import Input
from tablemap.runs.running import Outcome
from tests.making.command import tablemap_here
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a recording whose processing only leaves a run of its config."""
    (tmp_path / "lap.mcap").write_bytes(b"a recording")

    def stand_in(recording: Input, *, output: Path, config: Config, **_: object) -> Outcome:
        folder = make_run(output, "lap/a", rectangle_model(), config=config)
        return Outcome(recording, folder, "ok", None, rectangle_model())

    monkeypatch.setattr("tablemap.runs.jobs.run", stand_in)
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "method", "tables"),
    [
        ([], "tablemap", "best"),
        (["--all"], "tablemap", "all"),
        (["--near", "1.5", "-2"], "tablemap", (1.5, -2.0)),
        (["--method", "report"], "report", "best"),
    ],
)
def test_the_config_of_a_run_repeats_it(
    workplace: Path, arguments: list[str], method: str, tables: object
) -> None:
    """By ``--config`` alone; an option that is given again wins."""
    tablemap_here("process", "lap.mcap", "-q", "-o", "first", *arguments, cwd=workplace)
    file = workplace / "first/lap/a/config.toml"
    again = ("process", "lap.mcap", "-q", "--config", file)
    tablemap_here(*again, "-o", "second", cwd=workplace)
    assert (workplace / "second/lap/a/config.toml").read_text() == file.read_text()
    tablemap_here(*again, "-o", "third", "--near", "7", "8", cwd=workplace)
    config, other = (
        load_config(workplace / name / "lap/a/config.toml") for name in ("second", "third")
    )
    assert (config.method, config.tables) == (method, tables)
    assert (other.method, other.tables) == (method, (7.0, 8.0))
