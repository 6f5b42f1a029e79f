"""A run is found, mended where it was cut, served, and shown while it goes on."""

from __future__ import annotations

import time
import urllib.request
from pathlib import Path

import pytest

from tablemap.config import ReviewConfig
from tablemap.errors import ExternalToolError, TablemapError
from tablemap.events import RunFailed
from tablemap.review import Reviewer
from tablemap.review.viewer import live, viewer
from tests.making import made_up_run as made_up


def test_a_whole_file_is_shown_as_it_is(tmp_path: Path) -> None:
    """No copy is made of it."""
    path = tmp_path / "run.rrd"
    with Reviewer(path, run_id="whole", recording_name="made up", config=ReviewConfig()):
        pass
    with viewer.whole(path) as shown:
        assert shown == path


def test_a_file_that_is_no_review_is_said(tmp_path: Path) -> None:
    """With its path."""
    path = tmp_path / "notes.rrd"
    path.write_text("no review")
    with pytest.raises(ExternalToolError, match=r"notes\.rrd"), viewer.whole(path):
        pass


def test_a_recording_s_folder_is_its_last_run(tmp_path: Path) -> None:
    """``latest`` where there is one, else the run that began last; a file is itself."""
    for name in ("20260101T000000-a", "20260102T000000-b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "run.rrd").touch()
    assert viewer.review_file(tmp_path) == tmp_path / "20260102T000000-b" / "run.rrd"
    (tmp_path / "latest").symlink_to("20260101T000000-a")
    assert viewer.review_file(tmp_path) == tmp_path / "latest" / "run.rrd"
    assert viewer.review_file(tmp_path / "latest") == tmp_path / "latest" / "run.rrd"
    with pytest.raises(TablemapError, match="none"):
        viewer.review_file(tmp_path / "none")


def test_a_browser_of_this_machine_is_served(tmp_path: Path) -> None:
    """The URL's page is there, on loopback; the server ends with the context."""
    path = tmp_path / "run.rrd"
    with Reviewer(path, run_id="served", recording_name="made up", config=ReviewConfig()):
        pass
    with viewer.served(path) as (url, server):
        assert url.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(url, timeout=20) as answer:
            assert b"<html" in answer.read().lower()
    assert server.poll() is not None


def program(folder: Path, script: str) -> Path:
    """A stand-in for the viewer's program."""
    file = folder / "viewer"
    file.write_text(f"#!/bin/sh\n{script}\n")
    file.chmod(0o755)
    return file


def test_what_is_written_is_passed_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All bytes arrive, those before the end while the file still grows."""
    copy = tmp_path / "copy"
    monkeypatch.setattr(viewer, "viewer_program", lambda: program(tmp_path, f"cat > {copy}"))
    path = tmp_path / "run.rrd"
    with live.followed(path):
        path.write_bytes(b"first")
        deadline = time.monotonic() + 10
        while not (copy.exists() and copy.read_bytes() == b"first"):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        with path.open("ab") as file:
            file.write(b", last")
    assert copy.read_bytes() == b"first, last"


@pytest.mark.parametrize("script", ["exit 1", "exec sleep 60"])
def test_a_viewer_that_ends_or_hangs_costs_little(
    script: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The run goes on as if nobody looked."""
    monkeypatch.setattr(viewer, "viewer_program", lambda: program(tmp_path, script))
    monkeypatch.setattr(live, "LAST_SECONDS", 0.3)
    path = tmp_path / "run.rrd"
    path.write_bytes(bytes(5_000_000))
    began = time.monotonic()
    with live.followed(path):
        time.sleep(0.3)
    assert time.monotonic() - began < 5


def test_a_viewer_without_a_screen_is_said_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An error, within a second or so, that the command turns into a warning."""
    monkeypatch.setattr(viewer, "viewer_program", lambda: program(tmp_path, "exit 1"))
    began = time.monotonic()
    with pytest.raises(ExternalToolError, match="screen"):
        live.start_viewer(viewer.free_port())
    assert time.monotonic() - began < 2


def test_a_review_asks_for_its_best_view(tmp_path: Path) -> None:
    """The number stands in the file; one without snapshots asks for none."""
    best = tmp_path / "best.rrd"
    with Reviewer(best, run_id="best", recording_name="made up", config=ReviewConfig()) as record:
        for one in made_up.results(stops=4):
            record(one)
    assert viewer.first_snapshot(best) in range(4)
    none = tmp_path / "none.rrd"
    with Reviewer(none, run_id="none", recording_name="made up", config=ReviewConfig()) as record:
        record(RunFailed("recording", "no depth"))
    assert viewer.first_snapshot(none) is None
