"""The viewer opens what was written, or says why it cannot."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from tablemap.config import ReviewConfig
from tablemap.errors import ExternalToolError, TablemapError
from tablemap.review import Reviewer, viewer
from tablemap.review.still import TABS, still
from tests.review import factory

DRIVERS = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    """A folder without an .rrd is refused with its path."""
    with pytest.raises(TablemapError, match=str(tmp_path)):
        viewer.open_viewer(tmp_path)


def test_a_missing_viewer_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the viewer's program the error says how to get it."""
    (tmp_path / "run.rrd").write_bytes(b"")
    monkeypatch.setattr(viewer.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ExternalToolError, match="pip install"):
        viewer.open_viewer(tmp_path)


def test_a_viewer_without_a_screen_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A viewer that ends at once is an error with the place of the file."""
    (tmp_path / "run.rrd").write_bytes(b"")
    monkeypatch.setattr(viewer, "viewer_program", lambda: Path(shutil.which("false") or "false"))
    with pytest.raises(ExternalToolError, match=r"run\.rrd"):
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
        for one in factory.results():
            record(one)
    with pytest.raises(TablemapError, match="Overview"):
        still(path, tmp_path / "none.png", tab="Nonsense")
    for tab in TABS:
        picture = tmp_path / f"{tab}.png"
        assert still(path, picture, tab=tab) == []
        pixels = np.asarray(PIL.Image.open(picture).convert("RGB"), dtype=np.float64)
        assert pixels[70:660].std() > 10
