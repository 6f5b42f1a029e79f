"""report.html: one page that needs nothing else, whatever the run was like."""

from __future__ import annotations

import base64
import io
import math
import re
from html.parser import HTMLParser
from xml.etree import ElementTree

import PIL.Image
import pytest
from msgspec import structs

from tablemap import palette
from tablemap.events import OtherTable, RunFailed
from tablemap.model import TableModel, Verdict, WarningEntry
from tablemap.review.page.page import Page
from tablemap.review.page.plan import plan
from tablemap.stages.segmentation import Segmentation
from tablemap.stages.surface import Surface
from tests.making import made_up_run as made_up
from tests.making.reviews import manifest, page

VOID = {"meta", "br"}


@pytest.fixture(scope="module")
def run() -> list[object]:
    """All results of a made-up run."""
    return made_up.results(stops=8)


@pytest.fixture(scope="module")
def model(run: list[object]) -> TableModel:
    """Its model."""
    return next(one for one in run if isinstance(one, TableModel))


class Balance(HTMLParser):
    """Checks that every element that opens is closed in its place."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note an element."""
        self.seen.add(tag)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """Take it back."""
        assert self.open.pop() == tag


def elements(html: str) -> set[str]:
    """The elements of a page that is well formed."""
    parser = Balance()
    parser.feed(html)
    parser.close()
    assert parser.open == []
    return parser.seen


def test_the_page_has_the_model_and_needs_no_network(run: list[object], model: TableModel) -> None:
    """Verdict, figures, plan, residuals, legs, stops, warnings and provenance; nothing to fetch."""
    html = page(run)
    assert "svg" in elements(html)
    assert not elements(html) & {"script", "link", "img", "iframe"}
    assert not re.search(r"https?://|url\(|@import", html)
    assert html.index(model.verdict.level) < html.index("<svg")
    for name, figure in model.surface.dimensions.items():
        assert f"{name} {figure.value:.3f} m" in html
    for words in ("Residuals along the outline", "Where this comes from", "ab" * 32, "/laps/lap"):
        assert words in html
    assert html.count("<title>leg ") == len(model.legs)
    for warning in model.warnings:
        assert warning.code in html


def test_the_other_tables_have_a_line_each(run: list[object]) -> None:
    """What they are, or why there is no model of them."""
    html = page(run)
    others = html[html.index("Other tables") : html.index("Where this comes from")]
    assert "rectangle 0.900 x 0.600" in others
    assert "none of 8 views shows enough of it" in others
    assert html.count("<h1>") == 1


def test_a_doubt_has_its_code_at_the_top(model: TableModel) -> None:
    """In the words of the shell; another table's stands beside its verdict, in its colour."""
    doubt = WarningEntry(
        code="accuracy.unseen_side", stage="surface", message="A side was not seen.", stamp_ns=None
    )
    verdict = Verdict(level="doubtful", reasons=(doubt.message,))
    doubted = structs.replace(model, warnings=(doubt,), verdict=verdict)
    html = page([doubted, OtherTable(1, doubted)])
    assert "<li>accuracy.unseen_side: A side was not seen.</li>" in html
    others = html[html.index("Other tables") :]
    assert '<td class="doubtful short">doubtful</td>' in others
    assert "; accuracy.unseen_side: A side was not seen.</td>" in others


def test_long_reasons_stand_below_the_figures_on_a_narrow_screen(model: TableModel) -> None:
    """In a table of many columns; what is short keeps its columns."""
    unused = structs.replace(model.snapshots[0], used=False, reason="not seen, " * 5)
    for snapshots, kind in (((unused,), ' class="worded"'), (model.snapshots[:1], "")):
        html = page([structs.replace(model, snapshots=snapshots)])
        assert f"<table{kind}>\n<tr><th>stop</th>" in html


def test_a_failed_run_says_what_failed() -> None:
    """The stage and the sentence come first; there is no drawing."""
    html = page([RunFailed("registration", "ignored")], status="failed", error="no <two> views")
    assert "svg" not in elements(html)
    assert html.index("registration") < html.index("Where this comes from")
    assert "no &lt;two&gt; views" in html


def test_a_failed_run_shows_what_was_seen(run: list[object]) -> None:
    """The surfaces with heights and reasons, and the camera's view that shows most of them."""
    end = next(k for k, one in enumerate(run) if isinstance(one, Segmentation)) + 1
    segmentation = run[end - 1]
    assert isinstance(segmentation, Segmentation)
    html = page([*run[:end], RunFailed("segmentation", "ignored")], status="failed", error="none")
    assert f"Surfaces found ({len(segmentation.candidates)})" in html
    for number, one in enumerate(segmentation.candidates):
        row = re.search(rf"<tr><td[^>]*>{number}</td>.*?</tr>", html)
        assert row is not None
        assert f"{one.height:.3f} m" in row[0]
        assert (one.reason or "it gave no table") in row[0]
    drawn = re.search(r"<svg.*?</svg>", html, flags=re.DOTALL)
    assert drawn is not None
    assert "data:image/jpeg" in drawn[0]
    assert drawn[0].count("<polyline") >= 1
    assert re.findall(r">(\d+)</text>", drawn[0])


def test_names_cannot_break_the_page(model: TableModel) -> None:
    """What stands in a recording is text, not markup."""
    kept = Page()
    kept(structs.replace(model, frame="<script>&map"))
    html = kept.html(manifest("/<b>&.mcap"), status="ok", error=None)
    assert "script" not in elements(html)
    assert "&lt;b&gt;&amp;.mcap" in html


def drawing(model: TableModel) -> ElementTree.Element:
    """The plan's SVG."""
    return ElementTree.fromstring(plan(model).split("<p ")[0])


def test_the_plan_is_to_scale(model: TableModel) -> None:
    """The outline's sides in pixels are in the ratio of its sides in metres."""
    polygon = drawing(model).find("polygon")
    assert polygon is not None
    corners = [tuple(map(float, one.split(","))) for one in polygon.attrib["points"].split()]
    first, second = (math.dist(corners[k], corners[k + 1]) for k in (0, 1))
    outline = model.surface.outline
    metres = [math.dist(outline[k], outline[k + 1]) for k in (0, 1)]
    assert first / second == pytest.approx(metres[0] / metres[1], rel=0.01)


def test_views_from_one_place_share_a_number(model: TableModel) -> None:
    """A stop at which the head looked three ways is drawn once, and used if one view was."""
    first, *others = model.snapshots
    turned = (structs.replace(first, used=False, reason="not seen"), first, first)
    svg = drawing(structs.replace(model, snapshots=(*turned, *others)))
    labels = [one.text for one in svg.findall("text") if one.attrib.get("fill") == "white"]
    assert labels[:2] == ["0-2", "3"]
    assert len(labels) == 1 + len(others)
    (wider,) = [one for one in svg.findall("circle") if one.attrib["r"] == "12"]
    assert wider.attrib["fill"] == palette.REGISTERED.css


def test_sides_are_drawn_by_status(model: TableModel) -> None:
    """A side that was not seen is dotted and red."""
    edges = list(model.surface.edges)
    edges[0] = structs.replace(edges[0], status="unseen")
    surface = structs.replace(model.surface, edges=tuple(edges))
    sides = drawing(structs.replace(model, surface=surface)).findall("polyline")
    assert [side.attrib["stroke"] == "#b3261e" for side in sides] == [
        edge.status == "unseen" for edge in edges
    ]


def test_a_polygon_has_its_sides_lengths(model: TableModel) -> None:
    """Where there are no named dimensions."""
    surface = structs.replace(model.surface, shape="polygon", dimensions={})
    words = [
        text.text or "" for text in drawing(structs.replace(model, surface=surface)).iter("text")
    ]
    assert sum(bool(re.fullmatch(r"\d\.\d{3} m", one)) for one in words) == len(surface.edges)


def test_poor_results_make_a_page(model: TableModel, run: list[object]) -> None:
    """No outline, no legs, no stops, no residuals."""
    surface = structs.replace(model.surface, outline=(), edges=(), dimensions={})
    poor = structs.replace(model, surface=surface, legs=(), snapshots=())
    emptied = [made_up.emptied(one) for one in run if isinstance(one, Surface)]
    assert "no outline" in page([*emptied, poor], status="partial", error="cut <short>")


def test_the_best_view_has_the_model_in_it() -> None:
    """A JPEG within the page, and over it the outline's lines, inside of the picture."""
    html = page(made_up.results(stops=4))
    (picture,) = re.findall(r"<h2>In the camera's image</h2>(<svg.*?</svg>)", html, flags=re.S)
    drawn = ElementTree.fromstring(picture)
    image = drawn.find("image")
    assert image is not None
    kind, data = image.attrib["href"].split(",")
    assert kind == "data:image/jpeg;base64"
    with PIL.Image.open(io.BytesIO(base64.b64decode(data))) as jpeg:
        assert jpeg.size == (made_up.CAMERA.width, made_up.CAMERA.height)
    lines = drawn.findall("polyline")
    assert len(lines) > 4
    for line in lines:
        for x, y in (point.split(",") for point in line.attrib["points"].split()):
            assert 0 <= float(x) <= made_up.CAMERA.width
            assert 0 <= float(y) <= made_up.CAMERA.height


def test_without_a_view_of_the_edge_there_is_no_picture(model: TableModel) -> None:
    """A model alone has its page."""
    assert "In the camera" not in page([model])


def test_an_option_of_the_command_line_stays_on_one_line() -> None:
    """A browser breaks lines at hyphens: nobody could copy "- -near 2.20 0.50"."""
    run = [RunFailed("segmentation", "none was found: --near 2.20 -0.50 (0.74 m high) may be one.")]
    html = page(run, error=run[0].message)
    assert '<span class="short">--near 2.20 -0.50</span> (0.74 m high)' in html
    assert re.search(r"[.]short [{] white-space: nowrap", html)
