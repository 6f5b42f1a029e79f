"""Every result and event of every stage has its place in the review."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import types
from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass
from pathlib import Path

import pytest

import tablemap.events
from tablemap import pipeline
from tablemap.config import ReviewConfig
from tablemap.errors import ProcessWarning
from tablemap.model import TableModel
from tablemap.review import Reviewer

ENTRANCES = {
    "snapshots": ("take_snapshots",),
    "calibration": ("calibrate",),
    "segmentation": ("segment",),
    "odometry": ("estimate_odometry",),
    "registration": ("register",),
    "outline": ("find_edges",),
    "surface": ("fit_surface",),
    "legs": ("find_legs",),
    "crosscheck": ("cross_check",),
}


@pytest.fixture
def reviewer(tmp_path: Path) -> Iterator[Reviewer]:
    """An open review."""
    with Reviewer(
        tmp_path / "run.rrd", run_id="places", recording_name="made up", config=ReviewConfig()
    ) as opened:
        yield opened


def modules(name: str) -> list[types.ModuleType]:
    """A stage's module, or all modules of its folder."""
    stage = importlib.import_module(f"tablemap.stages.{name}")
    inner = pkgutil.walk_packages(stage.__path__, f"{stage.__name__}.")
    return [stage, *[importlib.import_module(one.name) for one in inner]]


def events(module: types.ModuleType) -> list[type]:
    """The dataclasses of a module whose docstring says that they are events."""
    return [
        one
        for _, one in inspect.getmembers(module, inspect.isclass)
        if is_dataclass(one)
        and one.__module__ == module.__name__
        and (one.__doc__ or "").startswith("Event:")
    ]


def test_every_stage_has_an_entrance_here() -> None:
    """A stage that is added to the pipeline is added to this test."""
    assert set(ENTRANCES) == set(pipeline.STAGES)


@pytest.mark.parametrize("stage", pipeline.STAGES)
def test_results_have_places(stage: str, reviewer: Reviewer) -> None:
    """What a stage's function returns can be drawn."""
    module = importlib.import_module(f"tablemap.stages.{stage}")
    for name in ENTRANCES[stage]:
        returned = inspect.signature(getattr(module, name)).return_annotation
        assert getattr(module, returned) in reviewer.places


@pytest.mark.parametrize("stage", pipeline.STAGES)
def test_events_have_places(stage: str, reviewer: Reviewer) -> None:
    """What a stage hands on as an event can be drawn."""
    for module in modules(stage):
        missing = [one.__name__ for one in events(module) if one not in reviewer.places]
        assert not missing, f"no place for {missing} of {module.__name__}"


def recorded() -> set[str]:
    """The names of all that the package makes in a call of ``record``."""
    package = Path(tablemap.events.__file__).parent
    calls = [
        node
        for file in package.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    ]
    made = [
        argument.func.id
        for call in calls
        if isinstance(call.func, ast.Name) and call.func.id == "record"
        for argument in call.args
        if isinstance(argument, ast.Call) and isinstance(argument.func, ast.Name)
    ]
    return set(made)


def test_all_that_is_recorded_has_a_place(reviewer: Reviewer) -> None:
    """No call of ``record`` in the package hands on what nobody draws, and events are recorded."""
    found = recorded()
    assert {"OdometryScan", "PairIteration", "TablesFound", "StageFinished"} <= found
    assert found <= {one.__name__ for one in reviewer.places}
    promised = {
        one.__name__
        for stage in pipeline.STAGES
        for module in modules(stage)
        for one in events(module)
    }
    assert promised <= found


def test_the_run_itself_has_places(reviewer: Reviewer) -> None:
    """Stages, failures, warnings and the model can be drawn; the search for events finds some."""
    found = events(tablemap.events)
    assert len(found) >= 3
    for one in [*found, ProcessWarning, TableModel]:
        assert one in reviewer.places


def test_unknown_types_are_refused(reviewer: Reviewer) -> None:
    """What has no place is an error, not silence."""

    @dataclass(frozen=True)
    class Unheard:
        value: int = 0

    with pytest.raises(TypeError, match="Unheard has no place"):
        reviewer(Unheard())
