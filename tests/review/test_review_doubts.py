"""A doubt that is somewhere is outlined there: in the views, in the images, and on the page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun.blueprint as rrb
import shapely

from tablemap.config import ReviewConfig
from tablemap.errors import ProcessWarning, WarnedPlace
from tablemap.model import TableModel
from tablemap.review import Reviewer
from tablemap.review.blueprint import blueprint
from tablemap.review.doubted import Doubted
from tests.making import made_up_run as made_up
from tests.making.marked_run import doubted
from tests.making.reviews import columns, page, write

SQUARE = np.array([[1.4, -0.5], [1.6, -0.5], [1.6, -0.3], [1.4, -0.3]])
BODY = ProcessWarning(
    "accuracy.closed_body",
    "legs",
    "A closed body stands there.",
    places=(WarnedPlace.ring(SQUARE).standing(),),
)
SIDE = ProcessWarning(
    "accuracy.unseen_side",
    "surface",
    "A side was not seen.",
    places=(WarnedPlace.along(SQUARE[:2]),),
)
LEVEL = ProcessWarning(
    "accuracy.two_levels",
    "legs",
    "A level lies lower.",
    places=(WarnedPlace.ring(SQUARE, height=0.5),),
)
TABLE = "/tables/01"


@pytest.fixture(scope="module")
def run() -> list[object]:
    """All results of a made-up run."""
    return made_up.results(stops=8)


@pytest.fixture(scope="module")
def review(run: list[object], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its review, with three doubts."""
    path = tmp_path_factory.mktemp("doubts") / "run.rrd"
    return write(path, doubted(run, SIDE, BODY, LEVEL))


def lines(path: Path, entity: str) -> list[np.ndarray]:
    """The lines (n, 3) that an entity ends with."""
    rows = columns(path, entity, "LineStrips3D:strips")
    return [np.array(line, dtype=np.float64) for line in rows[-1]] if rows else []


def names(path: Path, entity: str) -> list[object]:
    """The texts that stand beside an entity's lines."""
    rows = columns(path, f"{entity}/names", "Points3D:labels")
    return rows[-1] if rows else []


@pytest.mark.parametrize("below", ["", TABLE], ids=["the chosen table", "another one"])
def test_the_overview_names_all_doubts(review: Path, below: str) -> None:
    """By their codes, as the shell and the tables of warnings have them."""
    assert names(review, f"{below}/doubts/overview") == ["unseen side", "closed body", "two levels"]


def test_each_view_shows_the_doubts_of_its_stages(review: Path) -> None:
    """The legs' tab has what stands under the top, the surface's all that is about the top."""
    assert names(review, "/doubts/legs") == ["closed body", "two levels"]
    assert names(review, "/doubts/surface") == ["unseen side", "closed body", "two levels"]
    assert not lines(review, "/doubts/registration")
    assert not lines(review, "/doubts/views")


def test_a_body_is_outlined_from_the_floor_to_the_top(review: Path, run: list[object]) -> None:
    """Its outline lies over where it stands, at both heights, with an edge at each corner."""
    model = next(one for one in run if isinstance(one, TableModel))
    top, bottom, *uprights, level = lines(review, "/doubts/legs")
    for ring, height in (
        (top, model.surface.height.value),
        (bottom, 0.0),
        (level, 0.5),
    ):
        assert np.allclose(ring[:, 2], model.floor_z + height, atol=0.02)
        assert np.allclose(ring[:4, :2], SQUARE, atol=1e-6)
        assert np.allclose(ring[0], ring[-1])
    assert len(uprights) == len(SQUARE)
    for upright in uprights:
        assert np.allclose(upright[0, :2], upright[1, :2])


def test_the_images_show_the_doubts(review: Path) -> None:
    """In each view in which the place lies, within the image."""
    drawn = [row for row in columns(review, "/camera/doubts", "LineStrips2D:strips") if row]
    assert len(drawn) >= made_up.MadeUpRecording(stops=8).stops / 2
    for row in drawn:
        pixels = np.concatenate([np.array(line, dtype=np.float64) for line in row])
        assert (pixels >= 0).all()
        assert (pixels <= (made_up.CAMERA.width, made_up.CAMERA.height)).all()


def test_the_page_shows_the_doubts(run: list[object]) -> None:
    """On the plan and in the camera's picture, each with its name; the colour is explained."""
    html = page(doubted(run, SIDE, BODY))
    plan = html[html.index("From above") : html.index("<h2>Sides")]
    picture = html[html.index("In the camera") : html.index("From above")]
    for drawn in (plan, picture):
        assert "<title>closed body</title>" in drawn
        assert "what the doubts are about" in drawn
    assert ">unseen side</text>" in plan
    assert "what the doubts are about" not in page(run)


def test_a_withdrawn_doubt_is_not_drawn(run: list[object]) -> None:
    """A stage may run again and say something else; what is no doubt is not outlined either."""
    model = next(one for one in run if isinstance(one, TableModel))
    note = replace(SIDE, code="surface.inferred_side")
    found = Doubted()
    for one in doubted(run, note, BODY, LEVEL, kept=(note, LEVEL)):
        found.take(one)
        if isinstance(one, TableModel):
            model = one
    (only,) = found.of(model)
    assert only.name == "two levels"
    assert shapely.Polygon(only.lines[0][:, :2]).equals(shapely.Polygon(SQUARE))


@pytest.mark.parametrize(
    ("code", "front"),
    [
        (None, {"Edges by kind", "Residuals along the outline", "Pose graph as a matrix"}),
        ("height_scatter", {"Height by view (mm)", "Edges by kind"}),
        ("shape_ambiguous", {"Residuals and candidates", "Residuals along the outline"}),
        ("localisation", {"Trajectories"}),
    ],
)
def test_the_plot_of_a_doubt_is_in_front(
    code: str | None, front: set[str], run: list[object], tmp_path: Path
) -> None:
    """Of the tabs within a stage's tab; else the first is."""
    said = [] if code is None else [ProcessWarning(f"accuracy.{code}", "surface", "doubtful")]
    with Reviewer(
        tmp_path / "run.rrd", run_id="front", recording_name="made up", config=ReviewConfig()
    ) as reviewer:
        for one in doubted(run, *said):
            reviewer(one)
        layout = blueprint(reviewer._stream.scene).root_container
    assert front <= set(fronts(layout))


def fronts(part: object) -> list[str]:
    """The names of the tabs in front, in all containers of tabs of a layout."""
    inner = list(getattr(part, "contents", [])) if isinstance(part, rrb.Container) else []
    own = [str(inner[part.active_tab or 0].name)] if isinstance(part, rrb.Tabs) else []
    return [*own, *[name for one in inner for name in fronts(one)]]
