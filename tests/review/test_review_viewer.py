"""The viewer opens what was written, or says why it cannot."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from numpy.typing import NDArray

from tablemap.archive.manifest import Manifest
from tablemap.config import ReviewConfig
from tablemap.errors import ExternalToolError, TablemapError
from tablemap.review import Reviewer
from tablemap.review.page.page import Page
from tablemap.review.viewer import viewer
from tablemap.review.viewer.still import TABS, still
from tests.making import made_up_run as made_up

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
DRIVERS = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))


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


@pytest.mark.slow
@pytest.mark.skipif(
    not any(list(folder.glob("*.json")) for folder in DRIVERS if folder.is_dir()),
    reason="needs a Vulkan driver, such as mesa-vulkan-drivers",
)
def test_every_tab_shows_something(tmp_path: Path) -> None:
    """In the real viewer no view reports an error, and no tab is empty."""
    path = tmp_path / "run.rrd"
    with Reviewer(path, run_id="tabs", recording_name="made up", config=ReviewConfig()) as record:
        for one in made_up.results():
            record(one)
    with pytest.raises(TablemapError, match="Overview"):
        still(path, tmp_path / "none.png", tab="Nonsense")
    for tab in (*TABS, "Tables"):
        picture = tmp_path / f"{tab}.png"
        assert still(path, picture, tab=tab.lower()) == []
        pixels = np.asarray(PIL.Image.open(picture).convert("RGB"), dtype=np.float64)
        assert pixels[70:660].std() > 10


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="needs Chromium")
def test_the_page_is_drawn_by_a_browser_without_a_network(tmp_path: Path) -> None:
    """report.html is not empty, and its drawing is in it."""
    page = Page()
    for one in made_up.results():
        page(one)
    manifest = Manifest.model_validate(MANIFEST)
    file = tmp_path / "report.html"
    file.write_text(page.html(manifest, status="ok", error=None), encoding="utf-8")
    assert browse(file.as_uri(), tmp_path / "page.png").std() > 10


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="needs Chromium")
def test_the_web_view_is_drawn_by_a_browser(tmp_path: Path) -> None:
    """The viewer's page draws the run; it is not let to ask other machines for anything."""
    path = tmp_path / "run.rrd"
    with Reviewer(path, run_id="web", recording_name="made up", config=ReviewConfig()) as record:
        for one in made_up.results():
            record(one)
    with viewer.served(path) as (url, _):
        assert browse(url, tmp_path / "web.png", seconds=100).std() > 10


def browse(url: str, picture: Path, *, seconds: int = 5) -> NDArray[np.float64]:
    """The pixels of a page, with every name but this machine's unknown."""
    assert BROWSER is not None
    command = [BROWSER, "--headless", "--no-sandbox", "--use-angle=swiftshader"]
    command += ["--enable-unsafe-swiftshader", "--window-size=1000,700"]
    command += ["--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1 , EXCLUDE localhost"]
    command += [f"--user-data-dir={picture.parent / 'profile'}", f"--timeout={1000 * seconds}"]
    command += [f"--virtual-time-budget={1000 * seconds}"]
    subprocess.run(
        [*command, f"--screenshot={picture}", url], check=True, capture_output=True, timeout=300
    )
    return np.asarray(PIL.Image.open(picture).convert("RGB"), dtype=np.float64)
