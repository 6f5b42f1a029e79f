"""`tablemap runs ...`: results on stdout, in words and for scripts."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from tablemap.archive import load_run
from tablemap.cli.app import app
from tablemap.config import Config, load_config
from tablemap.errors import ConfigError, RecordingError, TablemapError
from tablemap.inputs import Input
from tablemap.runs import running
from tablemap.runs.verification import verify
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run


def call(*arguments: object, code: int = 0) -> Result:
    """Run the command in this process; what it raises is raised."""
    done = CliRunner().invoke(app, [str(a) for a in arguments], catch_exceptions=False)
    assert done.exit_code == code, done.output
    return done


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A file that stands for a recording."""
    file = tmp_path / "lap.mcap"
    file.write_bytes(b"a recording")
    return file


@pytest.fixture
def runs(recording: Path, tmp_path: Path) -> Path:
    """Two runs of one recording, the second 6 mm longer, and a failed one."""
    folder = tmp_path / "runs"
    make_run(folder, "lap/a", rectangle_model(), recording=recording)
    make_run(folder, "lap/b", rectangle_model(length=1.193), started="2026-05-02T00:00:00+00:00")
    make_run(folder, "hall/c", None, status="failed", started="2026-05-03T00:00:00+00:00")
    return folder


def test_list_prints_columns_json_and_csv(runs: Path) -> None:
    """The same runs each time."""
    text = call("runs", "list", runs, "--sort", "-started").stdout.splitlines()
    assert text[0].split()[-2:] == ["run", "error"]
    runs_listed = [word for line in text for word in line.split() if "/" in word]
    assert runs_listed == ["hall/c", "lap/b", "lap/a"]
    assert text[1].endswith("hall/c  why it is failed")
    assert "1.193 x 0.806" in text[2]
    listed = json.loads(call("runs", "list", runs, "--json", "--shape", "rectangle").stdout)
    assert [row["path"] for row in listed] == ["lap/a", "lap/b"]
    table = call("runs", "list", runs, "--csv", "--where", "length>1.19").stdout
    (row,) = csv.DictReader(io.StringIO(table))
    assert (row["path"], row["length"]) == ("lap/b", "1.193")
    nothing = call("runs", "list", runs, "--recording", "no*", "--json")
    assert json.loads(nothing.stdout) == []


def test_show_says_how_a_run_ended(runs: Path) -> None:
    """With its model or without."""
    text = call("runs", "show", runs / "lap/a").stdout
    assert "rectangle" in text
    assert "lap.mcap" in text
    failed = call("runs", "show", runs / "hall/c").stdout
    assert "why it is failed" in failed
    document = json.loads(call("runs", "show", runs / "lap/a", "--json").stdout)
    assert document["model"]["surface"]["height"]["value"] == 0.743
    assert document["manifest"]["status"] == "ok"


def test_compare_counts_sigmas_and_draws_both(runs: Path, tmp_path: Path) -> None:
    """6 mm at 2 mm each; an SVG and an .rrd on demand."""
    text = call("runs", "compare", runs / "lap/a", runs / "lap/b").stdout
    (line,) = (line for line in text.splitlines() if line.startswith("length"))
    assert re.split(" {2,}", line) == ["length", "1.187 m", "1.193 m", "6.0 mm", "2.8 mm", "2.1"]
    output = tmp_path / "out"
    done = call("runs", "compare", runs / "lap/a", runs / "lap/b", "--json", "-o", output)
    assert json.loads(done.stdout)["words"]["shape"] == {"a": "rectangle", "b": "rectangle"}
    assert "lap/b" in (output / "compare.svg").read_text()
    from tablemap.review.viewer.checking import damage_of

    assert damage_of(output / "compare.rrd") is None
    assert sorted(p.name for p in output.iterdir()) == ["compare.rrd", "compare.svg"]
    with pytest.raises(TablemapError, match="no table model"):
        call("runs", "compare", runs / "lap/a", runs / "hall/c")


def test_compare_of_more_runs_shows_their_spread(runs: Path) -> None:
    """Middle, ends and outliers of each figure, and who differs in a word or a setting."""
    for name, length, legs in (("d", 1.188, 4), ("e", 1.187, 3)):
        config = load_config(overrides=["seed=5"] if name == "e" else [])
        make_run(runs, f"lap/{name}", rectangle_model(length=length, legs=legs), config=config)
    paths = [runs / "lap" / name for name in "abde"]
    lines = call("runs", "compare", *paths).stdout.splitlines()
    told = {name: values for name, *values in (re.split(" {2,}", line) for line in lines)}
    assert told["B"] == [str(paths[1])]
    assert (told["shape"], told["legs"]) == (["rectangle"], ["4", "D 3"])
    # Of 1.187, 1.193, 1.188 and 1.187 m the second is an outlier.
    assert told["length"] == ["1.188 m", "1.187 m", "1.193 m", "2.5 mm", "2.0 mm", "B"]
    assert told["height"] == ["0.743 m", "0.743 m", "0.743 m", "0.0 mm", "2.0 mm"]
    assert told["seed"] == ["0", "0", "0", "5"]
    document = json.loads(call("runs", "compare", *paths, "--json").stdout)
    (length,) = (each for each in document["figures"] if each["name"] == "length")
    assert (length["outliers"], length["values"][1]) == ([1], 1.193)
    assert document["settings"]["seed"] == {"a": 0, "b": 0, "c": 0, "d": 5}
    assert document["c"] == str(paths[2])


def test_compare_of_one_run_or_a_drawing_of_three_is_wrong_usage(runs: Path) -> None:
    """With what it takes."""
    path = runs / "lap/a"
    for given, words in (
        (["runs", "compare", path], "two runs, or more"),
        (["runs", "compare", path, path, path, "-o", "out"], "--output draws two runs, found 3"),
    ):
        assert words in call(*given, code=2).output


def test_compare_and_show_say_what_was_set_otherwise(runs: Path) -> None:
    """Settings and versions that differ, those alone; of one run what is not the default."""
    config = load_config(overrides=["seed=5", "topics.laser=/scan"])
    run = make_run(runs, "lap/d", rectangle_model(), config=config)
    run.update(versions={**run.manifest.versions, "numpy": "0.1"})
    text = call("runs", "compare", runs / "lap/a", run.path).stdout.splitlines()
    settings = text.index(next(line for line in text if line.startswith("settings")))
    told = [line.split() for line in text[settings:] if line]
    assert told[:3] == [["settings", "A", "B"], ["seed", "0", "5"], ["topics.laser", "/scan"]]
    assert told[3] == ["versions", "A", "B"]
    assert [row[0] for row in told[4:]] == ["numpy"]
    document = json.loads(call("runs", "compare", runs / "lap/a", run.path, "--json").stdout)
    assert document["settings"]["seed"] == {"a": 0, "b": 5}
    assert document["versions"]["numpy"]["b"] == "0.1"
    shown = call("runs", "show", run.path).stdout
    assert "seed = 5 (default 0)" in shown
    assert "setting" not in call("runs", "show", runs / "lap/a").stdout


def test_compare_goes_on_where_settings_cannot_be_read(runs: Path) -> None:
    """The models still compare; what is missing is said."""
    (runs / "lap/a/config.toml").write_text("nonsense = 1\n")
    done = call("runs", "compare", runs / "lap/a", runs / "lap/b")
    assert "the settings are not compared: there is no setting 'nonsense'" in done.stderr
    assert "length" in done.stdout
    assert "unknown: there is no setting" in call("runs", "show", runs / "lap/a").stdout


def test_verify_exits_with_1_where_something_is_wrong(runs: Path) -> None:
    """Here no review was written, and one model was changed."""
    (runs / "lap/b/table.json").write_text(rectangle_model().to_json())
    done = call("runs", "verify", runs / "lap/a", runs / "lap/b", "--json", code=1)
    first, second = (json.loads(line) for line in done.stdout.splitlines())
    assert {each["name"] for each in first["checks"] if each["outcome"] != "ok"} == {"review"}
    outcomes = {each["name"]: each["outcome"] for each in second["checks"]}
    assert (outcomes["table.json"], outcomes["recording"]) == ("changed", "unchecked")
    assert "changed" in call("runs", "verify", runs / "lap/b", code=1).stdout


def test_the_review_of_a_run_that_goes_on_is_not_damaged(runs: Path) -> None:
    """Its file has no end yet, which is no fault; nothing can be made anew of it."""
    run = load_run(runs / "lap/a")
    run.update(status="running")
    (run.path / "run.rrd").write_bytes(b"RRF2")
    (review,) = [one for one in verify(run) if one.name == "review"]
    assert review.outcome == "unchecked"
    assert "not finished" in (review.detail or "")


def test_a_run_with_old_names_of_settings_says_the_new_ones(runs: Path, recording: Path) -> None:
    """Its config.toml is left as it is; the names are said in one sentence."""
    file = runs / "lap/a/config.toml"
    file.write_text("[surface]\nlaser_scale_sigma = 0.001\n[legs]\nmargin = 0.4\n")
    with pytest.raises(ConfigError) as caught:
        call("runs", "reprocess", runs / "lap/a")
    assert str(caught.value).startswith(
        "legs.margin is a constant now: _MARGIN in tablemap/stages/legs/silhouettes.py "
        "(old names in the file: 2); "
    )
    assert str(caught.value).endswith(f": {file.resolve()}")
    with pytest.raises(ConfigError, match=r"legs\.margin is a constant now"):
        call("process", recording, "--config", file)


def test_reprocess_takes_the_run_s_settings_and_the_changes(
    runs: Path, recording: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Its recording, output folder, method and tables too."""
    run = make_run(
        runs, "lap/d", None, recording=recording, config=load_config(overrides=["seed=5"])
    )
    run.update(tables=(1.0, 2.0), method="report")
    called: dict[str, object] = {}

    def stand_in(recording: Input, **arguments: object) -> running.Outcome:
        called.update(arguments, recording=recording)
        return running.Outcome(recording, run, "ok", None, None)

    monkeypatch.setattr(running, "run", stand_in)
    done = call("runs", "reprocess", run.path, "--set", "topics.laser=/scan", "--json", "-q")
    assert json.loads(done.stdout)["status"] == "ok"
    config = called["config"]
    assert isinstance(config, Config)
    assert (config.seed, config.topics.laser) == (5, "/scan")
    assert (called["recording"], called["output"]) == (Input.of(recording), runs.resolve())
    assert (config.method, config.tables) == ("report", (1.0, 2.0))
    with pytest.raises(ConfigError):
        call("runs", "reprocess", run.path, "--set", "topics.nonsense=1")
    recording.write_bytes(b"A RECORDING")
    with pytest.raises(RecordingError, match="SHA-256"):
        call("runs", "reprocess", run.path, "--output", tmp_path)


def test_prune_only_lists_until_it_is_told(runs: Path) -> None:
    """Then what was listed is gone."""
    done = call("runs", "prune", runs, "--older-than", 1, "--keep", 1, "--json")
    assert json.loads(done.stdout) == {"removed": False, "runs": ["lap/a", "hall/c"]}
    assert (runs / "lap/a").is_dir()
    done = call("runs", "prune", runs, "--older-than", 1, "--keep", 1, "--yes")
    assert done.stdout.split() == [str(runs / "lap/a"), str(runs / "hall/c")]
    assert not (runs / "lap/a").exists()
    assert load_run(runs / "lap").path.name == "b"
    left = call("runs", "prune", runs, "--status", "ok", "--json")
    assert json.loads(left.stdout)["runs"] == []


def test_pack_and_unpack_bring_a_run_elsewhere(runs: Path, recording: Path, tmp_path: Path) -> None:
    """With its recording."""
    file = tmp_path / "lap.tar.zst"
    done = call("runs", "pack", runs / "lap/a", "-o", file, "--input", "--json")
    assert json.loads(done.stdout) == {"file": str(file)}
    recording.unlink()
    back = call("runs", "unpack", file, "--output", tmp_path / "other").stdout.strip()
    assert Path(back) == tmp_path / "other" / "lap" / "a"
    assert (Path(back) / "input" / "lap.mcap").read_bytes() == b"a recording"
