"""What importing a part of the package costs, and what tests import of each other."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

import pytest

from tablemap.archive.index import list_runs
from tests.making.command import tablemap
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run


@pytest.mark.parametrize("module", ["tablemap", "tablemap.cli"])
def test_importing_starts_nothing_heavy(module: str) -> None:
    """``tablemap --help`` answers at once."""
    heavy = {"open3d", "rerun", "kiss_icp", "scipy", "shapely", "mcap", "numpy"}
    code = f"import sys, {module}; print(*(set(sys.modules) & {heavy!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


@pytest.mark.parametrize("module", ["tablemap.pipeline", "tablemap.runs.running"])
def test_the_pipeline_loads_open3d_and_rerun_only_when_needed(module: str) -> None:
    """They take seconds to import."""
    code = f"import sys, {module}; print(*(set(sys.modules) & {{'open3d', 'rerun', 'kiss_icp'}}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


PARSES = {"typer", "rich", "click", "shellingham", "annotated_doc"}
"""What every command imports: Typer, and what Typer imports."""

READS = {"msgspec", "typing_extensions", "tomli_w"}
"""What reads settings, manifests and models."""


@pytest.mark.parametrize(
    ("arguments", "allowed"),
    [
        (["--help"], PARSES),
        (["--version"], PARSES),
        (["process", "--help"], PARSES),
        (["runs", "--help"], PARSES),
        (["runs", "list"], PARSES),
        (["runs", "show", "runs/lap/one"], PARSES | READS),
        (["config"], PARSES | READS),
        (["schema", "config"], PARSES | READS),
        (["simulate", "--list"], PARSES | READS),
    ],
    ids=lambda given: " ".join(given) if isinstance(given, list) else "",
)
def test_what_answers_at_once_imports_little(
    arguments: list[str], allowed: set[str], tmp_path: Path
) -> None:
    """Help and lists parse words; settings and runs are validated too. Nothing computes."""
    make_run(tmp_path / "runs", "lap/one", rectangle_model())
    list_runs(tmp_path / "runs")
    listing = tmp_path / "imports.txt"
    done = tablemap(*arguments, imports=listing, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    imported = listing.read_text(encoding="utf-8").split()
    assert "tablemap.cli.app" in imported
    packages = {name.split(".")[0] for name in imported} - _of_python() - {"tablemap"}
    assert packages <= allowed


def _of_python() -> set[str]:
    """Return Python's own modules and what an empty program has, as of editable installs."""
    code = "import sys, zoneinfo; print(*sys.stdlib_module_names, *sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_a_list_of_indexed_runs_imports_no_model(tmp_path: Path) -> None:
    """The index has all that is listed."""
    make_run(tmp_path, "lap/one", rectangle_model())
    list_runs(tmp_path)
    listing = tmp_path / "imports.txt"
    done = tablemap("runs", "list", tmp_path, imports=listing)
    assert "lap/one" in done.stdout
    imported = listing.read_text(encoding="utf-8").split()
    assert "tablemap.archive.index" in imported
    assert "tablemap.model.table" not in imported


def test_open3d_draws_once_it_is_asked_to() -> None:
    """Whoever calls the library and Open3D in one program finds Open3D whole."""
    code = (
        "import sys; from tablemap import imports; o3d = imports.open3d(); "
        "print('dash' in sys.modules, hasattr(o3d, 'no_such_thing')); "
        "import open3d; print(callable(open3d.visualization.draw), 'dash' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False", "True", "True"]


def test_a_program_that_hides_pandas_makes_arrow_arrays_without_it() -> None:
    """Rerun's logging is made of them."""
    code = (
        "import sys; from tablemap.imports import hide_pandas; hide_pandas(); "
        "import pyarrow; print(len(pyarrow.array([True, False])), 'pandas' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["2", "False"]


def test_a_program_without_the_notes_of_scipy_has_all_its_functions() -> None:
    """A part of SciPy that takes more of its documentation apart finds the whole tool for it."""
    code = (
        "import sys; from tablemap.imports import without_scipy_notes; without_scipy_notes(); "
        "import scipy.ndimage; print(scipy.ndimage.label([1, 0, 1])[1]); "
        "print(hasattr(sys.modules['scipy._lib._docscrape'], '__file__')); "
        "import scipy.stats; print(scipy.stats.norm.cdf(0.0))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["2", "False", "0.5"]


def test_test_modules_import_nothing_from_each_other() -> None:
    """What several need is made in ``tests/making``."""
    for file in Path(__file__).parent.rglob("*.py"):
        found = re.findall(r"^(?:from|import) (tests\.\S+)", file.read_text("utf-8"), flags=re.M)
        assert all(name.split(".")[1] == "making" for name in found), file


def test_a_class_name_stands_once() -> None:
    """A name says which class is meant, whatever module a reader comes from."""
    package = Path(__file__).resolve().parent.parent / "tablemap"
    names = Counter(
        node.name.removeprefix("_")
        for file in package.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text("utf-8")))
        if isinstance(node, ast.ClassDef)
    )
    assert len(names) > 300
    assert [name for name, count in names.items() if count > 1] == []


def test_nothing_says_to_install_what_belongs_to_another_project() -> None:
    """``tablemap`` on PyPI is not this package: extras are installed of a checkout, or by name."""
    root = Path(__file__).resolve().parent.parent
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["name"] != "tablemap"
    texts = [root / "README.md", root / "pyproject.toml", *(root / "tablemap").rglob("*.py")]
    wrong = re.compile(r"pip install '?tablemap\b|\"tablemap\[")
    assert [text for text in texts if wrong.search(text.read_text(encoding="utf-8"))] == []
