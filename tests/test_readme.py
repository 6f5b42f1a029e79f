"""The README's Python, executed as it is written."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tablemap.model import TableModel
from tablemap.review.viewer.catalog import served_catalog

README = Path(__file__).resolve().parent.parent / "README.md"
URL = "rerun+http://127.0.0.1:51234"

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


def block_with(word: str) -> str:
    """Return the one fenced block of Python that has a word in it."""
    blocks = re.findall(r"^```python\n(.*?)^```", README.read_text("utf-8"), flags=re.M | re.S)
    (found,) = (block for block in blocks if word in block)
    return str(found)


def test_a_run_is_loaded_drawn_and_asked(
    finished: tuple[Path, subprocess.CompletedProcess[str]],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """As in a notebook that stands beside the runs."""
    (tmp_path / "runs").symlink_to(finished[0].parent.parent)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    exec(compile(block_with("top.contains"), "README.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    top = TableModel.load(finished[0]).surface
    assert lines[0] == f"length {top.dimensions['length'].value:.3f} m, sigma " + str(
        top.dimensions["length"].sigma
    )
    assert lines[2].startswith("height 0.74")
    assert float(lines[3]) == pytest.approx(1.0, abs=1e-6)
    inside, edge, outside = map(float, lines[4].strip("[]").split())
    assert inside == pytest.approx(1.0, abs=1e-3)
    assert 0.001 < edge < 0.999
    assert outside == pytest.approx(0.0, abs=1e-3)
    picture = np.asarray(Image.open(tmp_path / "top.png").convert("L"))
    assert picture.std() > 10


def test_all_heights_are_queried(
    finished: tuple[Path, subprocess.CompletedProcess[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a catalog that is being served, at its own port."""
    code = block_with("CatalogClient")
    assert URL in code
    with served_catalog(finished[0].parent.parent) as catalog:
        assert (catalog.runs, catalog.notes) == (1, ())
        exec(compile(code.replace(URL, catalog.url), "README.md", "exec"), {})
    header, row = capsys.readouterr().out.splitlines()
    assert header.split() == ["recording", "height"]
    height = TableModel.load(finished[0]).surface.height.value
    assert row.split() == ["0", "demo", f"{height:.6f}".rstrip("0")]
