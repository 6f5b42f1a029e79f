"""Where the likeliest surface gives no model, the next one is tried, and that is said."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from msgspec import structs

from tablemap import pipeline
from tablemap.errors import EstimationError, ProcessWarning
from tablemap.model import TableModel
from tablemap.model.table import Verdict, WarningEntry
from tablemap.recording import Recording, open_recording
from tablemap.stages.segmentation import Segmentation, TableCandidate
from tablemap.stages.snapshots.result import UNKNOWN_CAMERA
from tests.making.models import rectangle_model


def candidate(x: float, *, is_closed: bool = False) -> TableCandidate:
    """Return a candidate at x."""
    hull = np.zeros((3, 2))
    return TableCandidate(x, 0.5, 0.7, 1.0, (0, 1, 2), 1.0, 5 - x, hull, x == 1.0, None, is_closed)


CANDIDATES = (candidate(1.0), candidate(2.0), candidate(3.0, is_closed=True), candidate(4.0))


class Stages:
    """Stages that give nothing but failures: ``failing`` has the x of candidates and a stage."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, failing: dict[float, str]) -> None:
        self.failing = failing
        self.tried: list[float] = []
        self.models: list[Segmentation] = []
        self.doubts: list[ProcessWarning] = []
        nothing = SimpleNamespace(
            snapshots=(),
            mounting=None,
            is_found=False,
            legs=(),
            trajectory=None,
            map_from_base=(),
            camera=UNKNOWN_CAMERA,
        )
        for name in ("take_snapshots", "calibrate", "flatten", "estimate_odometry", "cross_check"):
            monkeypatch.setattr(pipeline, name, lambda *_, **__: nothing)
        for name in ("find_legs", "admitted_legs"):
            monkeypatch.setattr(pipeline, name, lambda *_, **__: nothing)
        monkeypatch.setattr(pipeline, "find_adjoining", lambda *_, **__: None)
        monkeypatch.setattr(pipeline, "segment", self.segment)
        monkeypatch.setattr("tablemap.stages.segmentation.stage.segment", self.segment)
        monkeypatch.setattr(pipeline, "segment_again", lambda _, first, **__: first)
        monkeypatch.setattr(pipeline, "register", self.register)
        monkeypatch.setattr(pipeline, "find_edges", self.find_edges)
        monkeypatch.setattr(pipeline, "find_step", lambda *_: None)
        monkeypatch.setattr(pipeline, "fit_surface", self.fit_surface)
        monkeypatch.setattr(pipeline, "assemble", self.assemble)

    def segment(self, *_: Any, candidate: TableCandidate | None = None, **__: Any) -> Segmentation:
        """Choose the first, or label the given one."""
        return Segmentation((), 0.7, 0.001, (candidate,) if candidate else CANDIDATES, ())

    def register(self, *_: Any, edges: Any, **__: Any) -> Any:
        """Fail as a registration by edges does."""
        outline = edges()
        self.fail("registration", outline.x)
        return SimpleNamespace(trajectory=None, map_from_base=(), used_poses={})

    def find_edges(self, _: Any, segmentation: Segmentation, **__: Any) -> Any:
        """Tell whose edges these are."""
        chosen = segmentation.candidates[0]
        if len(segmentation.candidates) > 1:
            chosen = next(each for each in segmentation.candidates if each.chosen)
        self.fail("outline", chosen.x)
        outline = SimpleNamespace(x=chosen.x, top_in=lambda _: None)
        outline.on = lambda _: outline
        return outline

    def fit_surface(self, outline: Any, *_: Any, **__: Any) -> Any:
        """Fail as a fit does."""
        self.fail("surface", outline.x)
        return SimpleNamespace()

    def fail(self, stage: str, x: float) -> None:
        """Raise in the stage in which this candidate fails."""
        if not self.tried or self.tried[-1] != x:
            self.tried.append(x)
        if self.failing.get(x) == stage:
            raise EstimationError(f"no {stage} at {x:g}")

    def assemble(self, findings: Any) -> TableModel:
        """Return a model, and keep what it was made of."""
        self.models.append(findings.segmentation)
        warnings = tuple(
            WarningEntry(stage=each.stage, code=each.code, message=each.message, stamp_ns=None)
            for each in (*findings.segmentation.warnings, *self.doubts)
        )
        return structs.replace(rectangle_model(), warnings=warnings)


def process(tables: Any = "best") -> pipeline.Processed:
    """Run the pipeline over a recording that no stage looks at."""
    recording = cast(Recording, SimpleNamespace(warnings=[]))
    return pipeline.process(recording, tables=tables)


@pytest.mark.parametrize("stage", ["registration", "outline", "surface"])
def test_the_next_candidate_is_tried(monkeypatch: pytest.MonkeyPatch, stage: str) -> None:
    """Whichever stage the first fails in; the warning says both places and the reason."""
    stages = Stages(monkeypatch, {1.0: stage})
    process()
    assert stages.tried == [1.0, 2.0]
    (segmentation,) = stages.models
    assert [each.chosen for each in segmentation.candidates] == [False, True, False, False]
    (warning,) = segmentation.warnings
    assert warning.code == "accuracy.second_choice"
    for words in ("(1.00, 0.50)", f"no {stage} at 1", "(2.00, 0.50)"):
        assert words in warning.message


def test_where_none_gives_a_table_places_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first one's failure, and an option for each of the likeliest three, so that a person
    reads the sentence; a closed front is not tried by itself."""
    stages = Stages(monkeypatch, dict.fromkeys([1.0, 2.0, 4.0], "surface"))
    with pytest.raises(EstimationError) as failed:
        process()
    assert stages.tried == [1.0, 2.0, 4.0]
    assert "no surface at 1; no other candidate" in str(failed.value)
    for x in (1, 2, 3):
        assert f"--near {x}.00 0.50 (0.70 m high)" in str(failed.value)
    assert "--near 4" not in str(failed.value)
    assert "and 1 more (tab Views" in str(failed.value)


def test_a_second_choice_with_unseen_sides_is_no_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stairs have steps that were seen in part: the run fails; a first choice may have such."""
    unseen = ProcessWarning("accuracy.unseen_side", "surface", "1 of 4 sides was not seen")
    stages = Stages(monkeypatch, {})
    stages.doubts = [unseen]
    assert process().model.warnings[-1].code == unseen.code
    stages = Stages(monkeypatch, {1.0: "surface"})
    stages.doubts = [unseen]
    with pytest.raises(EstimationError, match="no surface at 1; no other candidate"):
        process()
    assert stages.tried == [1.0, 2.0, 4.0]


def test_a_second_choice_with_one_measured_side_is_no_table(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A step shows its front edge, and of the other sides a part."""
    surface = rectangle_model().surface
    first, *others = surface.edges
    part = tuple(structs.replace(each, status="inferred") for each in others)
    step = structs.replace(surface, edges=(first, *part))
    stages = Stages(monkeypatch, {1.0: "surface"})
    whole = stages.assemble
    monkeypatch.setattr(
        pipeline, "assemble", lambda found: structs.replace(whole(found), surface=step)
    )
    with pytest.raises(EstimationError):
        process()
    assert stages.tried == [1.0, 2.0, 4.0]


def failed_at(stages: Stages, *places: float) -> Any:
    """Return an assembly that calls the models of these candidates failed."""
    whole = stages.assemble

    def assemble(found: Any) -> TableModel:
        model = whole(found)
        if stages.tried[-1] not in places:
            return model
        verdict = Verdict(level="failed", reasons=("no side of the top was measured",))
        return structs.replace(model, verdict=verdict)

    return assemble


def test_a_failed_verdict_is_no_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """The next candidate that gives a better verdict is taken, and the warning says why."""
    stages = Stages(monkeypatch, {})
    monkeypatch.setattr(pipeline, "assemble", failed_at(stages, 1.0, 2.0))
    model = process().model
    assert stages.tried == [1.0, 2.0, 4.0]
    assert model.verdict.level != "failed"
    (warning,) = (w for w in model.warnings if w.code == "accuracy.second_choice")
    assert "no side of the top was measured" in warning.message


def test_where_no_verdict_is_better_the_first_model_stays(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its results are recorded last, for a review shows the last ones."""
    stages = Stages(monkeypatch, {2.0: "surface"})
    monkeypatch.setattr(pipeline, "assemble", failed_at(stages, 1.0, 4.0))
    done = process()
    assert stages.tried == [1.0, 2.0, 4.0, 1.0]
    assert done.model.verdict.level == "failed"
    assert not any(w.code == "accuracy.second_choice" for w in done.model.warnings)


def test_a_place_that_was_asked_for_keeps_its_failed_verdict(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With --near nothing else is tried."""
    stages = Stages(monkeypatch, {})
    monkeypatch.setattr(pipeline, "assemble", failed_at(stages, 1.0))
    assert process((1.0, 0.5)).model.verdict.level == "failed"
    assert stages.tried == [1.0]


def test_stairs_are_no_table(real_recordings: Path) -> None:
    """Five views of a staircase end in one sentence."""
    with pytest.raises(EstimationError) as failed:
        pipeline.process(open_recording(real_recordings / "no_table_stairs.mcap"))
    assert "\n" not in str(failed.value)
    assert str(failed.value).count("--near") == 3
    assert len(str(failed.value)) < 600


def test_a_place_that_was_asked_for_has_no_second_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    """With --near another table is none."""
    stages = Stages(monkeypatch, {1.0: "surface"})
    with pytest.raises(EstimationError, match="no surface at 1"):
        process((1.0, 0.5))
    assert stages.tried == [1.0]


def test_all_goes_on_past_failing_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first that gives a model is chosen; of the others each model or reason is kept."""
    stages = Stages(monkeypatch, {1.0: "surface", 4.0: "outline"})
    done = process("all")
    assert [other.number for other in done.others] == [1, 2, 3]
    first, closed, last = (other.outcome for other in done.others)
    assert isinstance(first, str)
    assert "no surface at 1" in first
    assert isinstance(closed, TableModel)
    assert isinstance(last, str)
    assert "no outline at 4" in last
    assert len(stages.models) == 2
