"""The registry of formats: each entry says what its module writes, and every list is made of it."""

from __future__ import annotations

from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

from tablemap.export import Format, all_formats, export_model, formats
from tests.making.command import tablemap_here
from tests.making.exported import MODELS

README = Path(__file__).resolve().parents[2] / "README.md"
STL = """
from tablemap.export.registry import Format

def write(solid, config):
    return {f"{solid.name}.stl": b"solid\\n"}

FORMAT = Format("stl", "a mesh for printing", ("{name}.stl",), None, write)
"""


@pytest.fixture
def stl(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A module more, of a format that the package has not."""
    (tmp_path / "stl.py").write_text(STL)
    monkeypatch.setattr(formats, "__path__", [*formats.__path__, str(tmp_path)])
    all_formats.cache_clear()
    yield
    all_formats.cache_clear()


@pytest.mark.parametrize("name", all_formats())
def test_an_entry_names_the_files_that_are_written(name: str, tmp_path: Path) -> None:
    """All of them and no other, for a top that is a primitive and for one that needs a mesh."""
    entry = all_formats()[name]
    assert entry.world is None or entry.world in entry.files
    expected = {file.format(name="desk") for file in entry.files}
    for shape in ("rectangle", "U"):
        folder = tmp_path / shape
        export_model(MODELS[shape], [name], output=folder, name="desk")
        found = {
            file.relative_to(folder / name).as_posix()
            for file in folder.rglob("*")
            if file.is_file()
        }
        assert {file for file in expected if "*" not in file} <= found
        assert all(any(fnmatchcase(file, known) for known in expected) for file in found)


def test_a_module_is_all_that_a_format_takes(stl: None, tmp_path: Path) -> None:
    """It is written, into a folder or as a file."""
    (file,) = export_model(MODELS["L"], ["stl"], output=tmp_path).files
    assert file == tmp_path / "stl" / "table.stl"
    (file,) = export_model(MODELS["L"], ["stl"], output=tmp_path / "desk.stl").files
    assert file == tmp_path / "desk.stl"


@pytest.mark.parametrize("command", ["export", "process"])
def test_the_help_lists_every_format(command: str) -> None:
    """With its description."""
    listed = tablemap_here(command, "--help").stdout.split("Formats:\n")[1]
    described = dict(line.split(maxsplit=1) for line in listed.splitlines())
    assert described == {name: entry.description for name, entry in all_formats().items()}


def test_the_readme_has_every_format() -> None:
    """A row each, as its entry says."""
    readme = README.read_text(encoding="utf-8").splitlines()
    first = readme.index("| FORMAT | what it is | files |") + 2
    assert readme[first:][: len(all_formats()) + 1] == [*map(_row, all_formats().values()), ""]


def _row(entry: Format) -> str:
    files = [f"`{file.format(name='table')}`" for file in entry.files if file != entry.world]
    placed = f"; placed by `{entry.world.format(name='table')}`" if entry.world else ""
    return f"| `{entry.name}` | {entry.description} | {', '.join(files)}{placed} |"
