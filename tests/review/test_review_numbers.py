"""A figure is the same wherever it appears: terminal, page and review."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import is_dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs
from rerun.chunk import RrdReader

from tablemap.errors import ProcessWarning
from tablemap.model import TableModel
from tablemap.model.summary import summary_rows
from tablemap.review import crosscheck, story, text, wording
from tablemap.review.markdown import metres
from tablemap.stages.calibration import Calibration
from tablemap.stages.crosscheck import CrossCheck
from tablemap.stages.legs import Legs
from tablemap.stages.odometry import Odometry
from tablemap.stages.outline import Outline
from tablemap.stages.registration import Registration
from tablemap.stages.segmentation import Segmentation
from tablemap.stages.surface import Surface
from tests.making import made_up_run as made_up
from tests.making.reviews import columns, page, write

SIGMA = re.compile(r"height[^\n]*?([0-9.]+) m (?:±|\+-) ([0-9.]+) mm")


@pytest.fixture(scope="module")
def run() -> list[object]:
    """All results of a made-up run."""
    return made_up.results(stops=8)


@pytest.fixture(scope="module")
def review(run: list[object], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Their review."""
    return write(tmp_path_factory.mktemp("numbers") / "run.rrd", run)


@pytest.fixture(scope="module")
def model(run: list[object]) -> TableModel:
    """The chosen table."""
    return next(one for one in run if isinstance(one, TableModel))


def the(kind: type, run: list[object]) -> object:
    """The last result of a kind."""
    return [one for one in run if isinstance(one, kind)][-1]


@pytest.mark.parametrize(
    ("kind", "written"),
    [
        (Calibration, text.calibration),
        (Segmentation, text.segmentation),
        (Odometry, text.odometry),
        (Registration, text.registration),
        (Outline, text.outline),
        (Surface, text.surface),
        (CrossCheck, crosscheck.summary),
        (Legs, text.legs),
    ],
)
def test_a_stage_s_pane_tells_its_doubts(
    kind: type, written: Callable[[object], str], run: list[object]
) -> None:
    """Beside the view that shows what they are about; notes come after them."""
    result = the(kind, run)
    assert is_dataclass(result)
    warnings = [
        ProcessWarning(code, "surface", f"what {code} says")
        for code in ("legs.no_laser", "accuracy.hidden_rim")
    ]
    lines = written(replace(result, warnings=tuple(warnings))).splitlines()
    told = [line for line in lines if line.startswith("- `")]
    assert told == [
        "- `accuracy.hidden_rim`: what accuracy.hidden_rim says",
        "- `legs.no_laser`: what legs.no_laser says",
    ]


def test_what_the_recording_says_stands_where_one_looks_for_it(run: list[object]) -> None:
    """Of clocks and transforms beside the motion, of calibrations beside the camera."""
    recorded = [
        ProcessWarning(code, "recording", "said")
        for code in ("accuracy.tf_conflict", "recording.topic_choice", "recording.calibration")
    ]
    odometry, calibration = the(Odometry, run), the(Calibration, run)
    assert isinstance(odometry, Odometry)
    assert isinstance(calibration, Calibration)
    for words, code in (
        (text.odometry(odometry, recorded), "accuracy.tf_conflict"),
        (text.calibration(calibration, recorded), "recording.calibration"),
    ):
        told = [line for line in words.splitlines() if line.startswith("- `")]
        assert told == [f"- `{code}`: said"]


def test_the_height_has_one_sigma(run: list[object], review: Path, model: TableModel) -> None:
    """Summary, dimension line, page and terminal give the model's; the stages' pages give none."""
    assert model.surface.height.sigma is not None
    millimetres = f"{1000 * model.surface.height.sigma:.1f}"
    labels = columns(review, "/model/dimensions", "LineStrips3D:labels")[-1]
    said = [
        "\n".join(f"{name} {value}" for name, value in summary_rows(model)),
        re.sub(r"<[^>]+>", " ", page(run)),
        "\n".join(map(str, labels)),
        story.model(model, magnified=(1.0, 1.0)).replace("|", " "),
    ]
    for words in said:
        assert {sigma for _, sigma in SIGMA.findall(words)} == {millimetres}
    segmentation, outline = the(Segmentation, run), the(Outline, run)
    assert isinstance(segmentation, Segmentation)
    assert isinstance(outline, Outline)
    for words in (text.segmentation(segmentation), text.outline(outline)):
        assert metres(segmentation.height, segmentation.height_sigma) not in words
        assert metres(outline.height, outline.height_sigma) not in words
        assert f"{outline.height:.3f} m" in words


def test_a_pair_s_figures_are_named(run: list[object], review: Path) -> None:
    """Beside a pair's clouds stands the rmse of its row; odometry has no clouds, so no figures."""
    registration = the(Registration, run)
    assert isinstance(registration, Registration)
    rows = {
        cells[0]: cells
        for line in text.registration(registration).splitlines()
        if (cells := [one.strip() for one in line.strip("|").split("|")]) and len(cells) == 7
    }
    labels = columns(review, "/registration/pairs/names", "Points3D:labels")[-1]
    assert len(labels) > 5
    for label in map(str, labels):
        name, figure = label.split(": rmse ")
        assert figure == f"{rows[name][4]} mm"
    for pair in registration.pairs:
        name = f"{pair.source} to {pair.target}"
        if pair.kind == "odometry" and name in rows:
            assert rows[name][3:6] == ["", "", ""]


def test_legs_have_one_number(run: list[object], review: Path, model: TableModel) -> None:
    """Entities, labels, the stage's text, the summary and the page count them from one."""
    legs = the(Legs, run)
    assert isinstance(legs, Legs)
    numbers = list(range(1, len(model.legs) + 1))
    found = {chunk.entity_path for chunk in RrdReader(review).stream()}
    for path in ("/legs/{:02d}/fit", "/model/legs/{:02d}"):
        there = {path.format(number) for number in range(len(model.legs) + 5)} & found
        assert there == {path.format(number) for number in numbers}
    for number in numbers:
        labels = columns(review, f"/legs/{number:02d}/fit", "LineStrips3D:labels")[-1]
        assert str(labels[0]).startswith(f"leg {number}:")
    html = page(run)
    assert [int(one) for one in re.findall(r"<title>leg (\d+):", html)] == numbers
    for words in (text.legs(legs), story.model(model, magnified=(1.0, 1.0))):
        rows = re.findall(r"^\| (\d+) (?:circle|rectangle)", words, flags=re.MULTILINE)
        assert [int(one) for one in rows] == numbers


def test_residuals_are_told_alike(run: list[object]) -> None:
    """One sentence on the edge points, the clutter apart, on the page and in the viewer."""
    surface = the(Surface, run)
    assert isinstance(surface, Surface)
    (said,) = re.findall(r"Residuals of [^<]* mm\.", page(run))
    assert "clutter" not in said  # there is none
    assert said in text.surface(surface)
    far = np.concatenate([surface.residuals, [0.4, -0.5]])
    assert wording.residuals(far).startswith(said.split(". ")[0])
    assert "2 more are 30 mm" in wording.residuals(far)


def test_a_small_negative_figure_is_no_minus_zero(model: TableModel) -> None:
    """What rounds to nought has no sign, in the shell and in the panes."""
    tiny = -1e-9
    pose = structs.replace(model.surface.pose, x=tiny, y=tiny, yaw=tiny)
    at_nought = structs.replace(model, surface=structs.replace(model.surface, pose=pose))
    told = [
        story.model(at_nought, magnified=(1.0, 1.0)),
        *[value for _, value in summary_rows(at_nought)],
        metres(tiny, 0.001),
    ]
    for one in told:
        assert not re.search(r"-0\.0+(?![0-9])", one)
