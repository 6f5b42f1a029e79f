"""The rooms keep to themselves: who may import what, and what importing costs."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "tablemap"

ALLOWED = {
    "typer": ["cli/"],
    "mcap": ["recording/", "simulation/"],
    "mcap_protobuf": ["recording/"],
    "rosbags": ["recording/", "simulation/"],
    "rerun": ["review/"],
    "datafusion": ["review/"],
    "distributed": ["batch/"],
    "kiss_icp": ["odometry"],
    "open3d": ["registration", "simulation/", "evaluation/"],
}
ESTIMATORS = (
    "calibration",
    "legs",
    "odometry",
    "outline",
    "pipeline",
    "registration",
    "segmentation",
    "snapshots",
    "surface",
)


def imports_of(file: Path) -> set[str]:
    """Return every module that a file names in an import, at any depth."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return names


FILES = sorted(PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("package", sorted(ALLOWED))
def test_a_package_is_imported_in_its_room_alone(package: str) -> None:
    """One place knows each library."""
    importers = [
        file.relative_to(PACKAGE).as_posix()
        for file in FILES
        if any(name == package or name.startswith(f"{package}.") for name in imports_of(file))
    ]
    assert importers, f"nothing imports {package}"
    assert not [name for name in importers if not name.startswith(tuple(ALLOWED[package]))]


def test_simulation_and_estimators_do_not_know_each_other() -> None:
    """The ruler is not made of what it measures."""
    for file in FILES:
        relative = file.relative_to(PACKAGE).as_posix()
        names = imports_of(file)
        if relative.startswith("simulation/"):
            estimators = tuple(f"tablemap.{name}" for name in ESTIMATORS)
            assert not [n for n in names if n.startswith(estimators)], relative
        elif relative.startswith(ESTIMATORS):
            assert not [n for n in names if n.startswith("tablemap.simulation")], relative


@pytest.mark.parametrize("module", ["tablemap", "tablemap.cli"])
def test_importing_starts_nothing_heavy(module: str) -> None:
    """``tablemap --help`` answers at once."""
    heavy = {"open3d", "rerun", "kiss_icp", "scipy", "shapely", "mcap", "numpy"}
    code = f"import sys, {module}; print(*(set(sys.modules) & {heavy!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


@pytest.mark.parametrize("module", ["tablemap.pipeline", "tablemap.running"])
def test_the_pipeline_loads_open3d_and_rerun_only_when_needed(module: str) -> None:
    """They take seconds to import."""
    code = f"import sys, {module}; print(*(set(sys.modules) & {{'open3d', 'rerun', 'kiss_icp'}}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
