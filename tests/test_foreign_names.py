"""Names that others chose, of files, topics and frames, do nothing but name."""

from __future__ import annotations

import os
import unicodedata
from pathlib import Path
from xml.etree import ElementTree

import pytest
from msgspec import structs

from tablemap.archive import load_run
from tablemap.archive.index import list_runs
from tablemap.export import export_run
from tablemap.runs.running import run
from tests.making import messages as w
from tests.making.command import tablemap_here
from tests.making.models import rectangle_model
from tests.making.quick_run import act_within, make_recording
from tests.making.run_folders import make_run

EVIL = "[/nope][red]\x1b]0;title\x07\x1b]52;c;eA==\x07\r\n\u202e<&>\"'"
"""Markup, a terminal's title and clipboard, a line's begin, turned text, and XML."""
FILES = {
    "dots": "...mcap",
    "two dots": "..mcap",
    "hidden": ".x.mcap",
    "markup": "[nope][bold].mcap",
    "a title": "\x1b]0;title\x07.mcap",
    "a line": "a\nb.mcap",
    "no text": os.fsdecode(b"lap\xff.mcap"),
    "xml": "<&\">'.mcap",
}


def check_text(said: str) -> None:
    """Fail where something is printed that is neither a letter nor the end of a line."""
    assert not [c for c in said if c != "\n" and unicodedata.category(c) in ("Cc", "Cf", "Cs")]


@pytest.mark.parametrize("name", FILES)
def test_a_recording_of_any_name_has_its_runs_below_the_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Two levels below, listed and shown; nothing is written elsewhere."""
    act_within(monkeypatch, lambda: None)
    recording = make_recording(tmp_path, FILES[name])
    output = tmp_path / "out" / "runs"
    outcome = run(recording, output=output)
    assert outcome.status == "ok", outcome.error
    assert outcome.run is not None
    assert outcome.run.path.resolve().parent.parent == output.resolve()
    assert not outcome.run.path.parent.name.startswith(".")
    assert [each.name for each in (tmp_path / "out").iterdir()] == ["runs"]
    assert [row.status for row in list_runs(output)] == ["ok"]
    for arguments in (("list", output), ("show", outcome.run.path), ("list", output, "--json")):
        done = tablemap_here("runs", *arguments)
        assert done.returncode == 0, done.stderr
        check_text(done.stdout + done.stderr)


def test_recordings_of_any_names_are_processed_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One after the other and at once, with their progress; each line is text."""
    act_within(monkeypatch, lambda: None)
    recordings = [make_recording(tmp_path, name) for name in FILES.values()]
    done = tablemap_here("process", *recordings, "-o", tmp_path / "runs")
    assert done.returncode == 0, done.stderr
    check_text(done.stdout + done.stderr)
    assert len(list_runs(tmp_path / "runs")) == len(FILES)


def test_a_defect_stops_no_other_recording_with_one_job(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first fails, and the second and third are processed."""
    met: list[int] = []

    def act() -> None:
        met.append(1)
        if len(met) == 1:
            raise ValueError("of the first")

    act_within(monkeypatch, act)
    recordings = [make_recording(tmp_path, f"{name}.mcap") for name in "abc"]
    done = tablemap_here("process", *recordings, "-o", tmp_path / "runs", "--jobs", "1")
    assert done.returncode == 1
    assert "of the first" in done.stderr
    statuses = {row.recording: row.status for row in list_runs(tmp_path / "runs")}
    assert statuses == {"a": "failed", "b": "ok", "c": "ok"}


@pytest.mark.parametrize("as_json", [False, True])
def test_topics_and_frames_of_any_names_are_shown_as_text(tmp_path: Path, as_json: bool) -> None:
    """By `info`, in tables and in the tree."""

    def calibration(recorder: w.RosRecorder, stamp_ns: int) -> None:
        recorder.camera_info(f"{w.PREFIX}/camera_info", stamp_ns)
        recorder.transforms(stamp_ns, [("base_link", EVIL, (0.0, 0.0, 1.0), w.LEVEL)])
        recorder.scan(f"/{EVIL}", stamp_ns, frame=EVIL)

    path = tmp_path / "drive.mcap"
    w.write_drive(path, calibration=calibration)
    done = tablemap_here("info", path, *(["--json"] if as_json else []))
    assert done.returncode == 0, done.stderr
    check_text(done.stdout + done.stderr)
    assert "nope" in done.stdout


def test_exports_of_any_names_are_well_formed(tmp_path: Path) -> None:
    """Every XML that is written of a table in a frame of this name can be read."""
    model = structs.replace(rectangle_model(), frame=EVIL)
    folder = make_run(tmp_path, "<&\"'>/one", model)
    export_run(folder.path, ["svg", "sdf", "gazebo", "urdf"])
    written = [
        file
        for file in folder.path.rglob("*")
        if file.suffix in (".svg", ".sdf", ".urdf", ".config")
    ]
    assert len(written) >= 7
    for file in written:
        ElementTree.parse(file)
    assert load_run(folder.path).model.frame == EVIL
