"""The README's Python, executed as it is written."""

from __future__ import annotations

import inspect
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import tablemap
from tablemap.errors import WARNING_CODES
from tablemap.model import TableModel
from tablemap.review.viewer import viewer
from tablemap.review.viewer.catalog import served_catalog
from tests.making.command import tablemap_here

README = Path(__file__).resolve().parent.parent / "README.md"
CALLS = re.findall(r"`((?:tablemap|model)\.\w[^`]*\))`", README.read_text(encoding="utf-8"))
COMMANDS = re.findall(
    r"(?:`|^)tablemap ([^`\n]+)", README.read_text(encoding="utf-8"), flags=re.MULTILINE
)
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


@pytest.fixture(scope="module")
def workplace(
    finished: tuple[Path, subprocess.CompletedProcess[str]],
    demo_recording: Path,
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    """The finished demo in ``runs``, its settings, and a recording: the demo's first stops."""
    folder = tmp_path_factory.mktemp("workplace")
    run = shutil.copytree(finished[0], folder / "runs" / "demo" / finished[0].name)
    (run.parent / "latest").symlink_to(run.name)
    shutil.copy(run / "config.toml", folder / "my.toml")
    data = demo_recording.read_bytes()
    (folder / "lap.mcap").write_bytes(data[: int(0.4 * len(data))])
    return folder


@pytest.mark.parametrize("call", CALLS)
def test_a_call_does_what_it_says(
    call: str, workplace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the table of calls, each as it is written."""
    monkeypatch.chdir(workplace)
    run = tablemap.load_run("runs/demo")
    result = eval(call, {"tablemap": tablemap, "run": run, "model": run.model})
    assert result
    if isinstance(result, tablemap.Outcome):
        assert result.model is not None, result.error
        assert result.run is not None
        assert result.run.path.is_relative_to("runs") or result.run.path.is_relative_to(workplace)


@pytest.mark.parametrize("command", sorted(set(COMMANDS)))
def test_a_command_does_what_it_says(
    command: str, workplace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each as it is written; RUN stands for a run, and a viewer is not opened here."""
    opened: list[Path] = []
    monkeypatch.setattr(viewer, "open_viewer", opened.append)
    if command.startswith("evaluate --suite"):  # scores twenty runs: only what it is told is read
        command = "evaluate --help"
    if not (workplace / "lap").exists():
        (workplace / "lap").mkdir()
        (workplace / "lap" / "lap.mcap").symlink_to(workplace / "lap.mcap")
    done = tablemap_here(*command.replace("RUN", "runs/demo").split(), cwd=workplace)
    # The recording is the begin of one, and so read in part.
    assert done.returncode == (3 if command.startswith("process") else 0), done.stderr
    assert len(opened) == command.startswith("view")
    assert opened or done.stdout


def test_every_function_is_among_the_calls() -> None:
    """What is public is documented."""
    functions = {name for name in tablemap.__all__ if inspect.isfunction(getattr(tablemap, name))}
    assert functions <= set(re.findall(r"tablemap\.(\w+)", " ".join(CALLS)))


def test_every_warning_code_has_its_line() -> None:
    """Those that doubt the figures with what to do; all others as notes."""
    text = README.read_text("utf-8")
    doubts, notes = (
        [
            code
            for row in text.split(heading)[1].split("\n## ")[0].split("\n### ")[0].splitlines()
            if row.startswith("| `")
            for code in re.findall(r"`([\w.]+)`", row.split("|")[1])
        ]
        for heading in ("## My run is doubtful, what now", "### Notes")
    )
    doubting = [code for code in WARNING_CODES if code.startswith("accuracy.")]
    assert sorted(doubts) == sorted(doubting)
    assert sorted(notes) == sorted(WARNING_CODES.keys() - set(doubting))


def test_every_link_within_the_page_has_its_heading() -> None:
    """As GitHub and PyPI make anchors of headings."""
    text = README.read_text("utf-8")
    headings = re.findall(r"^#+ (.+)$", text, flags=re.M)
    anchors = {re.sub(r"[^\w -]", "", each.lower()).replace(" ", "-") for each in headings}
    assert set(re.findall(r"\]\(#([^)]+)\)", text)) <= anchors
