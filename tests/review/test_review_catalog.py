"""A folder of runs as a catalog, asked through the real server."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tablemap.archive import RunFolder
from tablemap.config import ReviewConfig
from tablemap.errors import ExternalToolError, TablemapError
from tablemap.model import TableModel
from tablemap.review import Reviewer
from tablemap.review.viewer.catalog import STREAMS, served_catalog
from tests.making.command import TABLEMAP
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run


def reviewed(folder: Path, name: str, model: TableModel | None, **how: object) -> RunFolder:
    """Make a run with a run.rrd of its own."""
    run = make_run(folder, name, model, **how)  # type: ignore[arg-type]
    review = Reviewer(
        run.path / "run.rrd",
        run_id=run.path.name,
        recording_name=run.path.parent.name,
        config=ReviewConfig(),
    )
    with review:
        if model:
            review(model)
    return run


def test_heights_are_asked_of_all_runs_whatever_their_state(tmp_path: Path) -> None:
    """Whole, failed, cut, still running, a copy, and without an .rrd: one segment a run."""
    from datafusion import col
    from rerun.catalog import CatalogClient

    runs = tmp_path / "runs"
    whole = reviewed(runs, "lap/whole", rectangle_model(height=0.7))
    reviewed(runs, "lap/failed", None, status="failed")
    cut = reviewed(runs, "lap/cut", rectangle_model(height=0.8)).path / "run.rrd"
    cut.write_bytes(cut.read_bytes()[:-100])
    running = reviewed(runs, "hall/running", None, status="running").path / "run.rrd"
    running.write_bytes(running.read_bytes()[:-100])
    make_run(runs, "hall/bare", rectangle_model(height=0.9))
    rubbish = make_run(runs, "hall/rubbish", rectangle_model(height=0.6))
    (rubbish.path / "run.rrd").write_text("no review")
    shutil.copytree(whole.path, runs / "hall" / "copy")
    before = cut.read_bytes()
    with served_catalog(runs) as catalog:
        assert catalog.url.startswith("rerun+http://127.0.0.1:")
        client = CatalogClient(catalog.url)
        dataset = client.get_dataset("runs")
        table = dataset.segment_table()
        names = ("run:path", "run:status", "table:height", "table:shape", "table:height_sigma")
        columns = [col(f"property:{name}")[0].alias(name) for name in names]
        rows = {row["run:path"]: row for row in table.select(*columns).to_pylist()}
        tall = table.filter(col("property:table:height")[0] > 0.75).count()
        drawn = dataset.filter_segments(["whole"]).filter_contents(["/model/**"])
        assert drawn.reader(index="stage").count() > 0
        assert sorted(dataset.segment_ids()) == [
            "bare",
            "cut",
            "failed",
            "rubbish",
            "running",
            "whole",  # as it was recorded, whichever folder it is taken from
        ]
    heights = {path: row["table:height"] for path, row in rows.items()}
    (kept,) = heights.keys() & {"lap/whole", "hall/copy"}
    assert heights == {
        kept: 0.7,
        "lap/failed": None,
        "lap/cut": 0.8,
        "hall/running": None,
        "hall/bare": 0.9,
        "hall/rubbish": 0.6,
    }
    assert tall == 2
    assert rows["lap/cut"]["table:shape"] == "rectangle"
    assert rows["lap/cut"]["table:height_sigma"] == 0.002
    assert rows["lap/failed"]["run:status"] == "failed"
    said = "\n".join(catalog.notes)
    for words in ("lap/cut: cut short", "hall/running: cut short", "copy of another run"):
        assert words in said
    for words in ("hall/bare: its figures alone", "hall/rubbish: its figures alone"):
        assert words in said
    assert len(catalog.notes) == 5
    assert cut.read_bytes() == before


def test_what_cannot_be_served_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No folder, a port that is taken, no DataFusion; an empty folder is served."""
    with pytest.raises(TablemapError, match="folder of runs"), served_catalog(tmp_path / "none"):
        pass
    with served_catalog(tmp_path) as catalog:
        assert catalog.runs == 0
        port = int(catalog.url.rsplit(":", 1)[1])
        with pytest.raises(ExternalToolError, match="--port"), served_catalog(tmp_path, port=port):
            pass
    monkeypatch.setitem(sys.modules, "datafusion", None)
    with (
        pytest.raises(ExternalToolError, match=r"pip install 'rerun-sdk\[catalog\]'"),
        served_catalog(tmp_path),
    ):
        pass


def test_the_command_serves_until_it_is_interrupted(tmp_path: Path) -> None:
    """The address on stdout, how to connect on stderr, and no traceback at the end."""
    from rerun.catalog import CatalogClient

    reviewed(tmp_path, "lap/a", rectangle_model())
    serving = subprocess.Popen(
        [*TABLEMAP, "runs", "serve", str(tmp_path), "--port", "0", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert serving.stdout is not None
    line = json.loads(serving.stdout.readline())
    client = CatalogClient(line["url"])
    assert client.get_dataset(line["dataset"]).segment_ids() == ["a"]
    serving.send_signal(signal.SIGINT)
    _, said = serving.communicate(timeout=30)
    assert (serving.returncode, line["runs"]) == (130, 1)
    assert line["url"] in said
    assert "Traceback" not in said


def streams() -> int:
    """Return how many streams of Rerun this process has, by their threads."""
    names = (each / "comm" for each in Path("/proc/self/task").iterdir())
    return sum("RecordingStr" in name.read_text() for name in names)


def test_serving_many_runs_keeps_no_threads_for_each(tmp_path: Path) -> None:
    """Each run's figures are a stream of Rerun of two threads, and there may be 10,000 runs."""
    for number in range(60):
        make_run(tmp_path, f"hall/{number:02d}", rectangle_model())
    before = streams()
    with served_catalog(tmp_path) as catalog:
        assert catalog.runs == 60
        assert streams() <= before + STREAMS
