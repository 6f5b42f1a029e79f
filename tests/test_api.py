"""The public names: what they take, and that whatever is wrong is a `TablemapError`."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

import tablemap
from tablemap.archive.packing import pack, unpack
from tablemap.archive.pruning import prune
from tablemap.errors import ConfigError, TablemapError
from tablemap.inputs import Input
from tablemap.paths import AnyPath
from tablemap.runs import expand
from tests.making.messages import write_drive
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run


class Named(tuple[str]):
    """What stands for a path and is neither text nor a Path."""

    def __fspath__(self) -> str:
        return self[0]


KINDS: dict[str, Callable[[Path], AnyPath]] = {
    "str": str,
    "Path": Path,
    "PathLike": lambda path: Named((str(path),)),
}


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """A folder with one finished run, ``lap/one``, of a recording beside it."""
    recording = tmp_path / "lap.mcap"
    write_drive(recording)
    make_run(tmp_path / "runs", "lap/one", rectangle_model(), recording=recording)
    return tmp_path / "runs"


def test_the_lists_of_public_names_agree() -> None:
    """What loads lazily, what a type checker sees and what a star imports."""
    tree = ast.parse(Path(tablemap.__file__).read_text(encoding="utf-8"))
    (checked,) = (node for node in tree.body if isinstance(node, ast.If))
    seen = {
        alias.name: node.module
        for node in checked.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == tablemap._HOMES
    assert sorted([*seen, "__version__"]) == sorted(tablemap.__all__)
    assert set(tablemap.__all__) <= set(dir(tablemap))


@pytest.mark.parametrize("name", [name for name in tablemap.__all__ if name != "__version__"])
def test_a_public_name_is_documented(name: str) -> None:
    """Itself, and what an object of it is asked for."""
    public = getattr(tablemap, name)
    members = vars(public).items() if inspect.isclass(public) else ()
    for what, member in [(name, public), *members]:
        documented = inspect.isfunction(member) or isinstance(member, property) or what == name
        if documented and not what.startswith("_"):
            assert inspect.getdoc(member), what


def test_what_is_no_public_name_is_not_there() -> None:
    """As of any module."""
    with pytest.raises(AttributeError, match="proces"):
        tablemap.proces  # noqa: B018


@pytest.mark.parametrize("kind", KINDS)
def test_every_path_may_be_text_or_stand_for_one(kind: str, runs: Path, tmp_path: Path) -> None:
    """Of recordings, configs, models, runs, folders of them, and what is written."""
    given = KINDS[kind]
    recording, run, model = (
        given(tmp_path / "lap.mcap"),
        given(runs / "lap" / "one"),
        given(runs / "lap" / "one" / "table.json"),
    )
    assert tablemap.inspect(recording).messages > 0
    with tablemap.open_recording(recording) as opened:
        assert opened.path == tmp_path / "lap.mcap"
    assert tablemap.load_config(given(runs / "lap" / "one" / "config.toml")) == tablemap.Config()
    assert tablemap.TableModel.load(run) == tablemap.TableModel.load(model)
    assert [row.path for row in tablemap.list_runs(given(runs))] == ["lap/one"]
    assert tablemap.load_run(run).path == runs / "lap" / "one"
    assert all(check.passed for check in tablemap.verify(run) if check.name != "review")
    assert tablemap.compare(run, model).overlap == pytest.approx(1.0)
    (file,) = tablemap.export_run(run, ["svg"], output=given(tmp_path / "plans")).files
    assert file == tmp_path / "plans" / "svg" / "table.svg"
    (file,) = tablemap.export_model(
        rectangle_model(), ["svg"], output=given(tmp_path / "a.svg")
    ).files
    assert file == tmp_path / "a.svg"
    outcome = tablemap.run(recording, output=given(tmp_path / "new"))
    assert outcome.run is not None
    assert outcome.run.path.parent == tmp_path / "new" / "lap"
    packed = pack(run, given(tmp_path / "one.tar.zst"))
    assert unpack(given(packed), given(tmp_path / "back")).path.is_dir()
    prune(given(runs), tablemap.list_runs(given(runs)))
    assert list(runs.glob("lap/*")) == []
    assert expand([recording, given(tmp_path / "*.mcap")]) == [Input.of(tmp_path / "lap.mcap")]


def test_a_run_that_is_open_is_taken_wherever_its_path_is(runs: Path, tmp_path: Path) -> None:
    """It is not read again; its file of a model is found in it."""
    run = tablemap.load_run(runs / "lap")
    assert tablemap.load_run(run) is run
    assert tablemap.TableModel.load(run) == run.model
    assert tablemap.compare(run, run.model).overlap == pytest.approx(1.0)
    assert all(check.passed for check in tablemap.verify(run) if check.name != "review")
    (file,) = tablemap.export_run(run, ["svg"]).files
    assert file == run.path / "exports" / "svg" / "table.svg"
    assert pack(run, tmp_path / "one.tar.zst").is_file()
    again = tablemap.reprocess(run, overrides=["review.level=off"])
    assert again.run is not None
    assert again.run.path.parent == run.path.parent
    assert again.run.config.review.level == "off"


def test_what_need_not_be_said_is_as_the_command_has_it(
    runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Runs go to ``runs``, by the defaults of every setting."""
    monkeypatch.chdir(tmp_path)
    outcome = tablemap.run("lap.mcap")
    assert outcome.run is not None
    assert outcome.run.path.parent == Path("runs/lap")
    assert outcome.run.config == tablemap.load_config() == tablemap.Config()
    assert len(tablemap.list_runs()) == 2


NOWHERE = Path("nowhere/at/all")
TOP = rectangle_model().surface
WRONG: dict[str, Callable[[Path], object]] = {
    "inspect: missing": lambda _: tablemap.inspect(NOWHERE),
    "inspect: text": lambda folder: tablemap.inspect(folder / "text"),
    "inspect: empty folder": lambda folder: tablemap.inspect(folder / "runs"),
    "inspect: no path": lambda _: tablemap.inspect(5),  # type: ignore[arg-type]
    "open_recording: missing": lambda _: tablemap.open_recording(NOWHERE),
    "open_recording: text": lambda folder: tablemap.open_recording(folder / "text"),
    "open_recording: null": lambda _: tablemap.open_recording("lap\0.mcap"),
    "load_config: missing": lambda _: tablemap.load_config(NOWHERE),
    "load_config: folder": lambda folder: tablemap.load_config(folder),
    "load_config: no text": lambda folder: tablemap.load_config(folder / "bytes"),
    "load_config: no TOML": lambda folder: tablemap.load_config(folder / "text"),
    "load_config: deep": lambda folder: tablemap.load_config(folder / "deep"),
    "load_config: NaN": lambda _: tablemap.load_config(overrides=["export.padding=nan"]),
    "load_config: no pair": lambda _: tablemap.load_config(overrides=["seed"]),
    "Config: range": lambda _: tablemap.Config(seed=-1),
    "Config: unknown": lambda _: tablemap.Config(sed=1),  # type: ignore[call-arg]
    "load_run: missing": lambda _: tablemap.load_run(NOWHERE),
    "load_run: no run": lambda folder: tablemap.load_run(folder),
    "load_run: no text": lambda folder: tablemap.load_run(folder / "damaged"),
    "load_run: no path": lambda _: tablemap.load_run(None),  # type: ignore[arg-type]
    "list_runs: missing": lambda _: tablemap.list_runs(NOWHERE),
    "list_runs: file": lambda folder: tablemap.list_runs(folder / "text"),
    "verify: missing": lambda _: tablemap.verify(NOWHERE),
    "verify: file": lambda folder: tablemap.verify(folder / "text"),
    "reprocess: missing": lambda _: tablemap.reprocess(NOWHERE),
    "reprocess: setting": lambda folder: tablemap.reprocess(
        folder / "made/one", overrides=["a.b=1"]
    ),
    "compare: missing": lambda _: tablemap.compare(NOWHERE, rectangle_model()),
    "compare: text": lambda folder: tablemap.compare(rectangle_model(), folder / "text"),
    "TableModel: nothing": lambda _: tablemap.TableModel(),  # type: ignore[call-arg]
    "TableModel.load: missing": lambda _: tablemap.TableModel.load(NOWHERE),
    "TableModel.load: no text": lambda folder: tablemap.TableModel.load(folder / "bytes"),
    "TableModel.load: deep": lambda folder: tablemap.TableModel.load(folder / "deep"),
    "TableModel.from_json: text": lambda _: tablemap.TableModel.from_json("text"),
    "TableModel.from_json: other": lambda _: tablemap.TableModel.from_json("[]"),
    "TableModel.from_json: NaN": lambda _: tablemap.TableModel.from_json(
        rectangle_model().to_json().replace('"floor_z": 0.0', '"floor_z": "nan"')
    ),
    "TableModel.to_json: NaN": lambda _: structs.replace(
        rectangle_model(), floor_z=float("nan")
    ).to_json(),
    "contains: shapes": lambda _: TOP.contains([1.0, 2.0], [1.0, 2.0, 3.0]),
    "contains: words": lambda _: TOP.contains("left", "right"),
    "contains: frame": lambda _: TOP.contains(0.0, 0.0, frame="base"),  # type: ignore[arg-type]
    "export_model: format": lambda folder: tablemap.export_model(
        rectangle_model(), ["pdf"], output=folder
    ),
    "export_model: name": lambda folder: tablemap.export_model(
        rectangle_model(), ["svg"], output=folder, name="../up"
    ),
    "export_model: file in the way": lambda folder: tablemap.export_model(
        rectangle_model(), ["svg"], output=folder / "text"
    ),
    "export_run: missing": lambda _: tablemap.export_run(NOWHERE, ["svg"]),
    "export_run: text": lambda folder: tablemap.export_run(folder / "text", ["svg"]),
    "run: NaN": lambda folder: tablemap.run(folder / "lap.mcap", tables=(float("nan"), 0.0)),
    "run: tables": lambda folder: tablemap.run(folder / "lap.mcap", tables="two"),  # type: ignore[arg-type]
    "run: method": lambda folder: tablemap.run(folder / "lap.mcap", method="guess"),  # type: ignore[arg-type]
    "run: no path": lambda _: tablemap.run(None),  # type: ignore[arg-type]
    "process: NaN": lambda folder: tablemap.process(
        tablemap.open_recording(folder / "lap.mcap"), tables=(0.0, float("nan"))
    ),
    "pack: folder": lambda folder: pack(folder / "made/one", folder),
    "unpack: text": lambda folder: unpack(folder / "text", folder / "runs"),
}
"""Calls that cannot be done; each is given a folder with files of the wrong kind."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files that are none of what is asked for, and one recording and run that are right."""
    folder = tmp_path_factory.mktemp("wrong")
    write_drive(folder / "lap.mcap")
    make_run(folder, "made/one", rectangle_model(), recording=folder / "lap.mcap")
    (folder / "text").write_text("this is text\n")
    (folder / "deep").write_text("a = " + "[" * 100_000)
    (folder / "bytes").write_bytes(b"\xff\xfe\x00")
    (folder / "runs").mkdir()
    (folder / "damaged").mkdir()
    (folder / "damaged" / "manifest.json").write_bytes(b"\xff\xfe\x00")
    return folder


@pytest.mark.parametrize("call", WRONG)
def test_whatever_is_wrong_is_an_error_of_tablemap(
    call: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In one sentence, and nothing is made."""
    monkeypatch.chdir(folder)
    before = sorted(folder.rglob("*"))
    with pytest.raises(TablemapError) as raised:
        WRONG[call](folder)
    assert len(str(raised.value).splitlines()) == 1
    assert len(str(raised.value)) > 20
    assert sorted(folder.rglob("*")) == before


@pytest.mark.parametrize("recording", ["missing.mcap", "text", "bytes", "runs"])
def test_a_recording_that_is_none_fails_the_run(recording: str, folder: Path) -> None:
    """As the outcome says; nothing is raised, so that the next one can be processed."""
    outcome = tablemap.run(folder / recording, output=folder / "output")
    assert (outcome.status, outcome.model) == ("failed", None)
    assert outcome.error


def test_points_that_are_not_finite_are_not_known() -> None:
    """Of many, the others are answered."""
    inside = TOP.contains([TOP.pose.x, np.nan, np.inf], TOP.pose.y)
    assert inside[0] == pytest.approx(1.0)
    assert np.isnan(inside[1:]).all()


def test_a_setting_that_cannot_be_is_a_config_error() -> None:
    """However it is given."""
    with pytest.raises(ConfigError, match="seed"):
        tablemap.load_config(overrides=["seed=-1"])
