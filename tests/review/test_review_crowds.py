"""Many stops and pairs stay readable: the worst and the current ones are shown, the rest waits."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from tablemap import palette
from tablemap.events import StageFinished, StageStarted
from tablemap.model import TableModel
from tablemap.review import text
from tablemap.review.alignment import WORST_PAIRS
from tablemap.review.matrix import CELL
from tablemap.review.numbering import letter
from tablemap.review.text import pair_residual, worst_first
from tablemap.review.wording import candidate_names
from tablemap.stages.legs import Legs, RejectedCluster
from tablemap.stages.odometry import OdometryMap, OdometryScan
from tablemap.stages.registration import Registration
from tablemap.stages.surface import FittedFigure, Surface
from tests.making import made_up_run as made_up
from tests.making.reviews import columns, write

STOPS = 8


@pytest.fixture(scope="module")
def run() -> list[object]:
    """All results of a made-up run."""
    return made_up.results(stops=STOPS)


@pytest.fixture(scope="module")
def review(run: list[object], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Their review."""
    return write(tmp_path_factory.mktemp("crowds") / "run.rrd", run)


def registration_of(run: list[object]) -> Registration:
    """The run's registration."""
    return next(one for one in run if isinstance(one, Registration))


def tabs(path: Path) -> set[str]:
    """The names of all containers of the largest layout: that of the last stages."""
    reader = RrdReader(path)
    layouts: list[set[str]] = []
    for store in reader.blueprints():
        batches = [chunk.to_record_batch().to_pydict() for chunk in reader.stream(store=store)]
        named = [batch.get("ContainerBlueprint:display_name", []) for batch in batches]
        layouts.append({str(one[0]) for names in named for one in names if one})
    return max(layouts, key=len)


def timelines(path: Path, entity: str) -> set[str]:
    """The timelines of an entity's rows."""
    return {
        name
        for chunk in RrdReader(path).stream()
        if chunk.entity_path == entity
        for name in chunk.timeline_names
    }


def test_the_worst_pairs_are_always_shown(run: list[object], review: Path) -> None:
    """So many and no more, the dropped ones among them, and none worse is left out."""
    registration = registration_of(run)
    (labels,) = columns(review, "/registration/graph_worst", "LineStrips3D:labels")
    assert len(labels) == WORST_PAIRS
    shown = {str(one).split(",")[0] for one in labels}
    dropped = [pair for pair in registration.pairs if not pair.used]
    assert dropped
    assert {f"{pair.source} to {pair.target}" for pair in dropped} <= shown
    off = {
        f"{pair.source} to {pair.target}": pair_residual(registration, pair)
        for pair in registration.pairs
        if pair.used
    }
    assert min(off[one] for one in shown & off.keys()) >= max(
        figure for name, figure in off.items() if name not in shown
    )


def test_a_stop_shows_its_own_pairs_camera_and_points(run: list[object], review: Path) -> None:
    """One row a snapshot, on the drive's timelines alone."""
    registration = registration_of(run)
    rows = columns(review, "/registration/graph_at_stop", "LineStrips3D:labels")
    assert len(rows) == STOPS
    for index, labels in enumerate(rows):
        own = {
            f"{pair.source} to {pair.target}, {pair.kind}"
            for pair in registration.pairs
            if index in (pair.source, pair.target)
        }
        assert {str(one).split(":")[0] for one in labels} == own
    names = columns(review, "/stop/camera/names", "Points3D:labels")
    assert [str(one[0]) for one in names[-STOPS:]] == [
        f"stop {k}" + ("" if is_used else ", not used")
        for k, is_used in enumerate(registration.used)
    ]
    assert len(columns(review, "/stop/points", "Points3D:positions")) == STOPS
    for entity in ("/registration/graph_at_stop", "/stop/camera", "/stop/points"):
        assert timelines(review, entity) >= {"snapshot", "sensor_time"}
        assert "stage" not in timelines(review, entity)


def test_the_matrix_has_every_pair(run: list[object], review: Path) -> None:
    """In the cell of its stops, on both sides of the diagonal, grey where it was dropped.

    Of several pairs of two stops it shows the worst used one. The stop at the cursor is framed.
    """
    registration = registration_of(run)
    (places,) = columns(review, "/registration/matrix/pairs", "Points2D:positions")
    (tints,) = columns(review, "/registration/matrix/pairs", "Points2D:colors")
    (labels,) = columns(review, "/registration/matrix/pairs", "Points2D:labels")
    cells = [tuple((np.array(one) // CELL).astype(int)) for one in places]
    both = {(pair.source, pair.target) for pair in registration.pairs}
    assert sorted(cells) == sorted(both | {(b, a) for a, b in both})
    red, green, blue = palette.LEFT_OUT.on_dark
    grey = (red << 24) + (green << 16) + (blue << 8) + 255
    for cell, tint, label in zip(cells, tints, labels, strict=True):
        here = [one for one in registration.pairs if {one.source, one.target} == set(cell)]
        used = [one for one in here if one.used]
        assert (tint == grey) == (not used)
        if used:
            worst = max(pair_residual(registration, one) for one in used)
            assert str(label).endswith(f"off by {1000 * worst:.1f} mm")
    frames = columns(review, "/registration/matrix/at_stop", "Boxes2D:centers")
    assert [round(one[0][1] / CELL - 0.5) for one in frames] == list(range(STOPS))


def test_a_stop_shows_its_worst_pair(run: list[object], review: Path) -> None:
    """Alone and in the map: the source where ICP began and where it ended."""
    registration = registration_of(run)
    ordered = [pair for pair in worst_first(registration) if pair.kind != "odometry"]
    names = columns(review, "/registration/pair_at_stop/names", "Points3D:labels")
    assert len(names) == STOPS + 1
    for index, told in enumerate(names[:STOPS]):
        worst = next(pair for pair in ordered if index in (pair.source, pair.target))
        assert str(told[0]).startswith(f"{worst.source} to {worst.target}: rmse")
    before, after = (
        columns(review, f"/registration/pair_at_stop/{name}", "Points3D:positions")
        for name in ("before", "after")
    )
    # Over ICP's iterations only the moving cloud is drawn anew.
    assert len(before) == STOPS + 1
    assert len(after) > STOPS + 3
    still = before[:STOPS] + [before[STOPS]] * (len(after) - STOPS)
    away = [
        float(np.linalg.norm(np.subtract(one, other), axis=-1).mean())
        for one, other in zip(still, after, strict=True)
    ]
    assert all(0.001 < one < 0.5 for one in away[:STOPS])
    assert away[STOPS] == 0.0
    assert away[-1] > 0.001


def test_the_way_is_coloured_by_its_error(run: list[object], review: Path) -> None:
    """Green where the localisation was right, red from 50 mm on; its pieces join."""
    (pieces,) = columns(review, "/trajectory/correction", "LineStrips3D:strips")
    (tints,) = columns(review, "/trajectory/correction", "LineStrips3D:colors")
    assert len(pieces) == len(tints) > 5
    assert len(set(tints)) > 1
    for one, following in pairwise(pieces):
        assert np.allclose(one[-1], following[0])


def test_a_tab_needs_data(run: list[object], review: Path, tmp_path: Path) -> None:
    """Without a laser there is no tab Odometry; before its stage begins, none has its tab."""
    assert {"Odometry", "Registration", "Legs"} <= tabs(review)
    without = [one for one in run if not isinstance(one, (OdometryScan, OdometryMap))]
    assert "Odometry" not in tabs(write(tmp_path / "without" / "run.rrd", without))
    begins = next(
        k for k, one in enumerate(run) if isinstance(one, StageStarted) and one.name == "outline"
    )
    found = tabs(write(tmp_path / "cut" / "run.rrd", run[:begins]))
    assert "Registration" in found
    assert not {"Surface", "Legs"} & found


def test_stages_of_other_tables_leave_the_summary(run: list[object], tmp_path: Path) -> None:
    """With all tables, stages go on after the model: the summary stays the model's."""
    kept = next(k for k, one in enumerate(run) if isinstance(one, TableModel)) + 1
    more = [StageStarted("surface", 9), StageFinished("surface", 9, 0.1)]
    path = write(tmp_path / "all" / "run.rrd", [*run[:kept], *more])
    pages = [str(one[0]) for one in columns(path, "/summary", "TextDocument:text")]
    assert any(page.startswith("# Still going: legs is done") for page in pages)
    assert not any("surface is done" in page for page in pages[-2:])
    model = run[kept - 1]
    assert isinstance(model, TableModel)
    assert f": {model.verdict.level}" in pages[-1]


def test_of_many_clusters_the_largest_have_letters(tmp_path: Path) -> None:
    """The list beside the view names all; the view has room for a dozen, not for none."""
    run = made_up.results(stops=4)
    few = [np.full((points, 2), 0.01 * points) for points in range(5, 20)]
    many = tuple(RejectedCluster(one[0, 0], 0.0, one, "too far out") for one in few)
    crowded = [replace(one, rejected=many) if isinstance(one, Legs) else one for one in run]
    path = write(tmp_path / "many" / "run.rrd", crowded)
    (shown,) = columns(path, "/legs/rejected/names", "Points3D:labels")[-1:]
    assert shown == [letter(k) for k in range(3, 15)]


def test_letters_go_on_after_z() -> None:
    """As the columns of a spreadsheet."""
    assert [letter(k) for k in (0, 25, 26, 27, 51, 52)] == ["a", "z", "aa", "ab", "az", "ba"]


def test_links_lead_to_entities(review: Path) -> None:
    """Each link of a text pane names what the file has, below its own table too."""
    there = {chunk.entity_path for chunk in RrdReader(review).stream()}
    pages = {entity for entity in there if entity.endswith("/summary")}
    found: set[str] = set()
    for entity in pages:
        for page in columns(review, entity, "TextDocument:text"):
            found |= set(re.findall(r"\(recording://([^)]+)\)", str(page[0])))
    assert {"model/top", "surface/chosen", "tables/01/model/top"} <= found
    for link in found:
        assert any(f"{one}/".startswith(f"/{link}/") for one in there), link


def test_candidates_of_one_shape_have_names_of_their_own(tmp_path: Path) -> None:
    """A rounded and a sharp rectangle are two lines; the chosen one alone is called so."""
    run = made_up.results(stops=4)
    surface = next(one for one in run if isinstance(one, Surface))
    first = surface.candidates[0]
    bent = replace(first, corner_radius=FittedFigure(0.1, 0.01), score=0.9)
    twice = replace(surface, candidates=(bent, first, replace(first, score=0.01)))
    assert candidate_names(twice.candidates) == [
        f"rounded {first.shape}",
        first.shape,
        f"{first.shape} 2",
    ]
    assert text.surface(twice).count("(chosen)") == 1
    assert f"rounded {first.shape} (chosen)" in text.surface(twice)
    again = [replace(one, candidates=twice.candidates) if one is surface else one for one in run]
    path = write(tmp_path / "twice" / "run.rrd", again)
    (chosen,) = columns(path, f"/surface/candidates/rounded_{first.shape}", "LineStrips3D:colors")
    (other,) = columns(path, f"/surface/candidates/{first.shape}_2", "LineStrips3D:colors")
    assert chosen != other
