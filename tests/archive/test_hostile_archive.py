"""One file that somebody else wrote spoils neither the list of runs nor any other command."""

from __future__ import annotations

import json
import os
import shutil
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tablemap.archive import load_run
from tablemap.archive.index import INDEX, list_runs
from tablemap.config import Config
from tablemap.inputs import Input
from tablemap.runs.jobs import Job, done_already, mark_lost, runs_of
from tests.making.command import tablemap_here
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run

Spoil = Callable[[Path], object]
LONG = "x" * 5000
HALF = "\ud800"


def pipe(file: Path) -> None:
    """Put a pipe there, which nobody ever writes into."""
    os.mkfifo(file)


def endless(file: Path) -> None:
    """Put a device there by a link."""
    file.symlink_to("/dev/zero")


def itself(file: Path) -> None:
    """Put a link there that leads to itself."""
    file.symlink_to(file)


def listening(file: Path) -> None:
    """Put a socket there."""
    here = Path.cwd()
    os.chdir(file.parent)  # its name may have a hundred letters alone
    try:
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(file.name)
    finally:
        os.chdir(here)


def large(file: Path) -> None:
    """Put a file of a hundred megabytes there."""
    with file.open("wb") as stream:
        stream.truncate(100 * 2**20)


def text(content: str | bytes) -> Spoil:
    """Return what puts a text there."""
    data = content.encode() if isinstance(content, str) else content
    return lambda file: file.write_bytes(data)


ANY: dict[str, Spoil] = {
    "a pipe": pipe,
    "a device": endless,
    "a link to itself": itself,
    "a socket": listening,
    "a folder": lambda file: file.mkdir(),
    "a hundred megabytes": large,
    "nothing": text(""),
    "brackets": text("[" * 100_000),
    "braces": text('{"a":' * 100_000),
    "brackets that close": text("[" * 900 + "]" * 900),
    "a long number": text("9" * 5000),
    "an endless number": text("1e999"),
    "no number": text("NaN"),
    "no letters": text(b"\xff\xfe\x00"),
    "half a letter": text('"\\ud800"'),
    "null": text("null"),
    "a list": text("[1, 2, 3]"),
    "keys": text("a.b.c.d = [[[[[[[[[[1]]]]]]]]]]\n[a]\nb = 1"),
}


def changed(*keys: str | int, to: object) -> Spoil:
    """Return what changes one value of a document."""

    def spoil(file: Path) -> None:
        document = json.loads(file.read_text())
        at: Any = document
        for key in keys[:-1]:
            at = at[key]
        at[keys[-1]] = to
        file.write_text(json.dumps(document))

    return spoil


def raw(old: str, new: str) -> Spoil:
    """Return what changes the text of a document."""

    def spoil(file: Path) -> None:
        content = file.read_text()
        assert old in content
        file.write_text(content.replace(old, new, 1))

    return spoil


WRONG: tuple[object, ...] = (None, True, -1, 1e300, 10**4000, "x", LONG, HALF, "a\0b", [], {}, [[]])
OF_MODEL: dict[str, Spoil] = {
    f"{'.'.join(map(str, keys))} {str(value)[:9]!a}": changed(*keys, to=value)
    for keys in (
        ("frame",),
        ("floor_z",),
        ("surface", "shape"),
        ("surface", "height", "value"),
        ("surface", "pose", "x"),
        ("surface", "pose", "covariance"),
        ("surface", "dimensions"),
        ("surface", "outline"),
        ("legs", 0, "dimensions"),
        ("legs", 0, "x"),
        ("snapshots", 0, "stamp_ns"),
        ("verdict", "reasons"),
        ("warnings",),
    )
    for value in WRONG
}
OF_MODEL |= {
    "many dimensions": changed(
        "surface",
        "dimensions",
        to={str(n): {"value": 1, "sigma": None, "status": "measured"} for n in range(20_000)},
    ),
    "many corners": changed("surface", "outline", to=[[n, n % 7] for n in range(10_000)]),
    "corners without number": changed("surface", "outline", to=[[n, n % 7] for n in range(10_001)]),
    "not a number": raw('"floor_z": 0.0', '"floor_z": NaN'),
}
OF_MANIFEST: dict[str, Spoil] = {
    f"{'.'.join(map(str, keys))} {str(value)[:9]!a}": changed(*keys, to=value)
    for keys in (
        ("run_id",),
        ("recording",),
        ("recording", "path"),
        ("recording", "together"),
        ("recording", "raw"),
        ("recording", "size"),
        ("method",),
        ("tables",),
        ("seed",),
        ("versions",),
        ("started",),
        ("finished",),
        ("timings", "surface"),
        ("writer",),
        ("status",),
        ("error",),
        ("files",),
    )
    for value in WRONG
}
OF_MANIFEST |= {
    "paths without end": changed("recording", "together", to=[LONG] * 100),
    "raw bytes": changed("recording", "raw", to=["2f" * 5000]),
    "a process of that number": changed(
        "writer", to={"pid": 2**40, "host": os.uname().nodename, "boot": None}
    ),
    "time without end": changed("timings", to={"a": 1e308, "b": 1e308}),
}
KEYS = ("path", "started", "status", "method", "error", "shape", "verdict")
OF_INDEX: dict[str, Spoil] = {
    f"{name} {str(value)[:9]!a}": changed("runs", 0, 4 + place, to=value)
    for place, name in enumerate(KEYS)
    for value in WRONG
    if value is not None or name in KEYS[:3]
}
OF_INDEX |= {
    f"figures {str(value)[:9]!a}": changed("runs", 0, 12, to=value)
    for value in (*WRONG, ["x"] * 20, [1e999] * 20, [None] * 20)
}
OF_INDEX |= {
    f"{key} {str(value)[:9]!a}": changed(key, to=value)
    for key in ("names", "runs", "schema")
    for value in WRONG
}
OF_CONFIG: dict[str, Spoil] = {
    "a section that is none": text("[nothing]\na = 1\n"),
    "a long name": text(f"[{LONG}]\na = 1\n"),
    "a control character": text('[topics]\ndepth = "\\u001b]52;c;x\\u0007"\n'),
    "a wrong type": text('seed = "x"\n'),
    "a long number": text(f"seed = {'9' * 5000}\n"),
    "a value without end": text("[surface]\na = inf\n"),
}
CASES = {
    f"{file}: {name}": (file, spoil)
    for file, spoils in (
        ("manifest.json", ANY | OF_MANIFEST),
        ("table.json", ANY | OF_MODEL),
        ("config.toml", ANY | OF_CONFIG),
    )
    for name, spoil in spoils.items()
}


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three runs: two good ones, and one between them for the others' mischief."""
    folder = tmp_path_factory.mktemp("good") / "runs"
    for name in ("hall/01", "kitchen/02", "office/03"):
        make_run(folder, name, rectangle_model())
    return folder


@pytest.fixture
def runs(good: Path, tmp_path: Path) -> Path:
    """A copy of them, to be spoilt."""
    return Path(shutil.copytree(good, tmp_path / "runs", symlinks=True))


def spoil(file: Path, how: Spoil) -> None:
    """Spoil a file, in place where there is something to change."""
    content = file.read_bytes() if file.is_file() else None
    if how in ANY.values() and content is not None:
        file.unlink()
    how(file)


@pytest.mark.parametrize("case", CASES)
def test_a_hostile_file_spoils_no_list_of_the_others(runs: Path, case: str) -> None:
    """Every other row is as it was, the first time and from the index; nor is a batch stopped."""
    name, how = CASES[case]
    before = [row for row in list_runs(runs) if row.recording != "kitchen"]
    spoil(runs / "kitchen" / "02" / name, how)
    for _ in range(2):
        rows = list_runs(runs)
        assert [row for row in rows if row.recording != "kitchen"] == before
        for row in rows:
            json.dumps(row.to_dict(), allow_nan=False).encode()
    assert len(runs_of("kitchen.mcap", runs)) <= 1
    recording = runs.parent / "kitchen.mcap"
    recording.write_bytes(b"abc")
    assert done_already(recording, Job(runs, Config())) is None
    assert mark_lost(Input.of(recording), runs, "it died", known=()) == []


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_a_hostile_file_ends_every_command_in_a_sentence(runs: Path, case: str) -> None:
    """Whatever is done with its run, or with the folder that it is in."""
    name, how = CASES[case]
    run = runs / "kitchen" / "02"
    spoil(run / name, how)
    for arguments in (
        ("list", runs, "--sort", "-height"),
        ("list", runs, "--json", "--where", "height>0"),
        ("list", runs, "--csv"),
        ("show", run),
        ("show", run, "--json"),
        ("compare", run, runs / "hall" / "01"),
        ("verify", run),
        ("pack", run, "-o", runs.parent / "packed.tar.zst"),
        ("prune", runs, "--keep", "1"),
    ):
        done = tablemap_here("runs", *arguments)
        said = f"{arguments}: {done.stderr[-2000:]}"
        assert done.returncode in (0, 1, 2), said
        assert "defect" not in done.stderr, said
        assert "\x1b" not in done.stdout + done.stderr
        (done.stdout + done.stderr).encode()
        assert len(done.stderr) < 20_000, said
        if arguments[0] == "list":
            assert done.returncode == 0, said
            assert "hall" in done.stdout
            assert "office" in done.stdout
        if "--json" in arguments and done.returncode == 0:
            json.loads(done.stdout, parse_constant=lambda word: pytest.fail(word))


@pytest.mark.parametrize("case", ANY | OF_INDEX)
def test_a_hostile_index_is_built_again(runs: Path, case: str) -> None:
    """The rows are those of the folders."""
    rows = list_runs(runs)
    spoil(runs / INDEX, (ANY | OF_INDEX)[case])
    found = list_runs(runs)
    assert len(found) == 3
    for row in found:
        json.dumps(row.to_dict(), allow_nan=False).encode()
    assert [row.path for row in found] == [row.path for row in rows]
    assert list_runs(runs) == found


def test_folders_that_cannot_be_looked_into_spoil_no_list(runs: Path) -> None:
    """Links that lead to themselves, pipes, and ``latest`` of either kind."""
    (runs / "loop").symlink_to("loop")
    os.mkfifo(runs / "pipe")
    (runs / "hall" / "loop").symlink_to("loop")
    os.mkfifo(runs / "hall" / "pipe")
    (runs / "hall" / "latest").unlink()
    (runs / "hall" / "latest").symlink_to("latest")
    assert len(list_runs(runs)) == 3
    assert tablemap_here("runs", "prune", runs, "--keep", "0").returncode == 0
    shown = tablemap_here("runs", "show", runs / "hall" / "latest")
    assert shown.returncode == 1
    assert "defect" not in shown.stderr


@pytest.mark.parametrize("name", ["x" * 300, "x/" * 2500, "latest/latest", "\udcff"])
@pytest.mark.parametrize("command", ["show", "verify", "compare", "pack", "list", "unpack"])
def test_paths_that_can_be_none_are_told_in_a_sentence(runs: Path, name: str, command: str) -> None:
    """As a run, as a folder of runs and as a file."""
    more = (runs / "hall" / "01",) if command == "compare" else ()
    done = tablemap_here("runs", command, f"{runs}/{name}", *more)
    assert done.returncode in (1, 2)
    assert "defect" not in done.stderr
    done.stderr.encode()


def test_a_leg_without_dimensions_is_refused_in_words(runs: Path) -> None:
    """By whatever needs its size."""
    run = runs / "kitchen" / "02"
    spoil(run / "table.json", changed("legs", 0, "dimensions", to={}))
    assert len(load_run(run).model.legs) == 4
    for form in ("svg", "urdf", "moveit", "nav2", "geojson", "glb"):
        done = tablemap_here("export", run, "--to", form)
        assert done.returncode == 1
        assert "of leg 1, found no size" in done.stderr
