"""The viewer opens what was written, or says why it cannot."""

from __future__ import annotations

import io
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast
from urllib.parse import urlsplit

import numpy as np
import PIL.Image
import pytest
from numpy.typing import NDArray
from rerun.experimental import ViewerClient

from tablemap.archive.manifest import Manifest
from tablemap.errors import ExternalToolError, TablemapError
from tablemap.review.page.page import Page
from tablemap.review.viewer import viewer
from tablemap.review.viewer.still import TABS, _headless, _shoot, _show_tab, _smaller, still
from tests.making import made_up_run as made_up
from tests.making.reviews import write

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
MANIFEST = {
    "schema": "tablemap/manifest/1",
    "run_id": "browsed",
    "recording": {"path": "lap.mcap", "size": 1, "sha256": None},
    "method": "tablemap",
    "tables": "best",
    "seed": 0,
    "versions": {},
    "started": "2026-01-01T00:00:00+00:00",
}
DRAWN_SECONDS = 400
DRIVERS = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))
PANEL = (slice(60, 500), slice(760, None))
"""Rows and columns of the selection panel in a window of 1000 by 700 pixels."""
needs_vulkan = pytest.mark.skipif(
    not any(list(folder.glob("*.json")) for folder in DRIVERS if folder.is_dir()),
    reason="needs a Vulkan driver, such as mesa-vulkan-drivers",
)


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    """A folder without an .rrd is refused with its path."""
    with pytest.raises(TablemapError, match=str(tmp_path)):
        viewer.open_viewer(tmp_path)


def test_a_missing_viewer_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the viewer's program the error says how to get it."""
    (tmp_path / "run.rrd").write_bytes(b"RRF2, and at its end " + viewer.FOOTER)
    monkeypatch.setattr(viewer.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ExternalToolError, match="pip install"):
        viewer.open_viewer(tmp_path)


def test_a_viewer_without_a_screen_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A viewer that ends at once is an error with the place of the file."""
    (tmp_path / "run.rrd").write_bytes(b"RRF2, and at its end " + viewer.FOOTER)
    monkeypatch.setattr(viewer, "viewer_program", lambda: Path(shutil.which("false") or "false"))
    with pytest.raises(ExternalToolError, match=r"ended at once.*run\.rrd"):
        viewer.open_viewer(tmp_path)


def test_statistics_are_off() -> None:
    """The viewer is started with its usage statistics off."""
    assert viewer.viewer_environment()["CI"] == "1"


def test_a_tab_is_shown_and_no_pane_of_its_name() -> None:
    """A table's own tab has panes with the names of the run's tabs: the outermost one is meant."""

    def container(kind: str, name: str, *contents: str) -> dict[str, Any]:
        shown = {"display_name": name, "contents": contents, "container_kind": kind}
        return {"ContainerBlueprint": shown}

    layout: dict[str, Any] = {
        "/container/root": container("Tabs", "", "container/legs", "container/tables"),
        "/container/legs": container("Horizontal", "Legs", "view/a"),
        "/container/tables": container("Tabs", "Tables", "container/one"),
        "/container/one": container("Tabs", "Table 01", "view/b", "view/legs"),
        "/view/a": {"ViewBlueprint": {"display_name": "Legs from above"}},
        "/view/b": {"ViewBlueprint": {"display_name": "Summary"}},
        "/view/legs": {"ViewBlueprint": {"display_name": "Legs"}},
    }
    client = SimpleNamespace(
        get_blueprint=lambda: SimpleNamespace(blueprint=layout), set_blueprint=lambda *_, **__: None
    )
    _show_tab(cast(ViewerClient, client), "legs")
    active = {
        path: one["ContainerBlueprint"].get("active_tab")
        for path, one in layout.items()
        if "ContainerBlueprint" in one
    }
    assert active["/container/root"] == "container/legs"
    assert active["/container/one"] is None


@pytest.mark.slow
@needs_vulkan
def test_every_tab_shows_something(tmp_path: Path) -> None:
    """In the real viewer no view reports an error, and no tab is empty."""
    path = write(tmp_path / "run.rrd", list(made_up.results()))
    with pytest.raises(TablemapError, match="Overview"):
        still(path, tmp_path / "none.png", tab="Nonsense")
    for tab in (*TABS, "Tables"):
        picture = tmp_path / f"{tab}.png"
        assert still(path, picture, tab=tab.lower()) == []
        pixels = np.asarray(PIL.Image.open(picture).convert("RGB"), dtype=np.float64)
        assert pixels[70:660].std() > 10


@pytest.mark.slow
@needs_vulkan
def test_a_link_of_a_text_pane_selects_its_entity(tmp_path: Path) -> None:
    """What a click on one opens: the selection panel then has the entity, each link its own."""
    path = write(tmp_path / "run.rrd", list(made_up.results()))
    with _headless(path, (1000, 700)) as client:
        client.run_command("ui.expand_selection_panel")
        before = panel(client)
        selected = []
        for link in ("model/top", "model/dimensions"):
            client.open(f"recording://{link}")
            selected.append(panel(client))
    assert (np.abs(selected[0] - before).max(axis=-1) > 30).mean() > 0.01
    assert (np.abs(selected[1] - selected[0]).max(axis=-1) > 30).mean() > 0.005


def panel(client: Any) -> NDArray[np.float64]:
    """The selection panel, once it does not change any more."""
    previous = None
    deadline = time.monotonic() + DRAWN_SECONDS
    while time.monotonic() < deadline:
        time.sleep(1.0)
        with PIL.Image.open(io.BytesIO(_shoot(client))) as picture:
            here = np.asarray(picture.convert("RGB"), dtype=np.float64)[PANEL]
        if previous is not None and np.array_equal(here, previous):
            return here
        previous = here
    raise AssertionError(f"the panel changed for {DRAWN_SECONDS} s")


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="needs Chromium")
def test_the_page_is_drawn_by_a_browser_without_a_network(tmp_path: Path) -> None:
    """report.html is not empty, its drawing is in it, and it asks nobody for anything."""
    page = Page()
    for one in made_up.results():
        page(one)
    manifest = Manifest.read(MANIFEST)
    file = tmp_path / "report.html"
    file.write_text(page.html(manifest, status="ok", error=None), encoding="utf-8")
    with browser("light") as (shown, refused):
        shown.goto(file.as_uri())
        assert pixels(shown).std() > 10
    assert refused == []


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="needs Chromium")
@pytest.mark.parametrize("theme", ["dark", "light"])
def test_the_web_view_is_drawn_by_a_browser(theme: str, tmp_path: Path) -> None:
    """The viewer's page draws the run in both themes; it reaches no other machine."""
    path = write(tmp_path / "run.rrd", list(made_up.results()))
    with viewer.served(path) as (url, _), browser(theme) as (shown, _):
        shown.goto(url)
        picture = drawn(shown)
    assert picture[70:, :600].std() > 10  # the table and the stops
    bar = picture[5:30, 450:650].mean()
    assert bar > 200 if theme == "light" else bar < 60


@contextmanager
def browser(theme: str) -> Iterator[tuple[Any, list[str]]]:
    """A page of a browser that reaches this machine alone, and what else it asked for."""
    from playwright.sync_api import Route, sync_playwright

    refused: list[str] = []

    def only_here(route: Route) -> None:
        if urlsplit(route.request.url).hostname in (None, viewer.LOOPBACK):
            route.continue_()
        else:
            refused.append(route.request.url)
            route.abort()

    arguments = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    arguments += [f"--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE {viewer.LOOPBACK}"]
    with sync_playwright() as playwright:
        program = playwright.chromium.launch(executable_path=BROWSER, args=arguments)
        shown = program.new_page(
            viewport={"width": 1000, "height": 700},
            color_scheme="light" if theme == "light" else "dark",
        )
        shown.set_default_timeout(1000 * DRAWN_SECONDS)
        shown.route("**/*", only_here)
        yield shown, refused
        program.close()


def pixels(shown: Any) -> NDArray[np.float64]:
    """What a page looks like, (rows, columns, 3)."""
    with PIL.Image.open(io.BytesIO(shown.screenshot())) as picture:
        return np.asarray(picture.convert("RGB"), dtype=np.float64)


def wood(picture: NDArray[np.float64]) -> float:
    """The share of a picture that has the top's colour, in whatever light."""
    red, green, blue = np.moveaxis(picture, -1, 0)
    return float(((red > 110) & (red - blue > 45) & (red > green) & (green > blue)).mean())


def drawn(shown: Any) -> NDArray[np.float64]:
    """The viewer's picture, once the table is there and nothing moves."""
    previous = None
    deadline = time.monotonic() + DRAWN_SECONDS
    while time.monotonic() < deadline:
        picture = pixels(shown)
        is_there = wood(picture[70:, :430]) > 0.01
        if is_there and previous is not None and np.array_equal(picture, previous):
            return picture
        previous = picture
        time.sleep(1.0)
    raise AssertionError(f"nothing was drawn within {DRAWN_SECONDS} s")


def test_a_picture_keeps_the_colours_of_small_things() -> None:
    """A legend's dots among many shades of a large image have nearly their own colours."""
    rows, columns = np.mgrid[0:400, 0:600]
    shades = np.stack([rows / 2, columns / 3, (rows + columns) / 4], axis=-1).astype(np.uint8)
    dots = {20: (185, 245, 40), 60: (255, 105, 100), 100: (235, 70, 255)}
    for at, colour in dots.items():
        shades[at : at + 5, at : at + 5] = colour
    buffer = io.BytesIO()
    PIL.Image.fromarray(shades).save(buffer, format="PNG")
    with PIL.Image.open(io.BytesIO(_smaller(buffer.getvalue()))) as image:
        few = np.asarray(image.convert("RGB"), dtype=int)
    for at, colour in dots.items():
        assert np.abs(few[at + 2, at + 2] - colour).max() <= 25
