"""Whether a run is still what was written, and its input what was read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tablemap.archive.folder import LEAVE_A_MODEL, RunFolder
from tablemap.errors import RecordingError, TablemapError
from tablemap.model import TableModel

INPUT = "input"
"""Folder of a run that holds its recording, where one was packed with it."""


@dataclass(frozen=True)
class Check:
    """One thing that was looked at. ``unchecked`` says in ``detail`` why nothing can be said."""

    name: str
    outcome: Literal["ok", "unchecked", "missing", "changed", "damaged"]
    detail: str | None = None

    @property
    def passed(self) -> bool:
        """Whether nothing is known to be wrong."""
        return self.outcome in ("ok", "unchecked")


def verify(run: RunFolder) -> list[Check]:
    """Check the files' hashes and contents, the .rrd, and the input where it can be found."""
    return [*check_files(run), *_check_contents(run), _check_review(run), _check_input(run)]


def check_files(run: RunFolder) -> list[Check]:
    """Compare each file of a finished run with its hash in the manifest."""
    expected = run.manifest.files
    if not expected:
        reason = "the run was not finished" if run.manifest.finished is None else "no hashes kept"
        return [Check("files", "unchecked", f"{reason}: its manifest has no hashes")]
    found = run.hashes()
    checks = []
    for name, digest in expected.items():
        if name not in found:
            checks.append(Check(name, "missing", "the manifest names it"))
        elif found[name] != digest:
            checks.append(Check(name, "changed", "its SHA-256 is not the manifest's"))
        else:
            checks.append(Check(name, "ok"))
    extra = sorted(found.keys() - expected.keys())
    checks.extend(Check(name, "unchecked", "the run did not write it") for name in extra)
    return checks


def input_path(run: RunFolder) -> Path:
    """Return where a run's recording should be: packed with it, or where it was read."""
    path = Path(run.manifest.recording.path)
    packed = run.path / INPUT / path.name
    return packed if packed.is_file() else path


def find_input(run: RunFolder) -> Path:
    """Return the recording of a run.

    Raises `RecordingError` where it is gone, or where size or SHA-256 are not the manifest's.
    """
    from tablemap.recording import sha256

    entry, file = run.manifest.recording, input_path(run)
    if not file.is_file():
        raise RecordingError(f"the run's recording is gone; put it back at {file}")
    size = file.stat().st_size
    if entry.size is not None and size != entry.size:
        raise RecordingError(
            f"the recording is not the run's: expected {entry.size} bytes, found {size}: {file}"
        )
    if entry.sha256 is not None and sha256(file) != entry.sha256:
        raise RecordingError(
            f"the recording is not the run's: its SHA-256 is not the manifest's: {file}"
        )
    return file


def _check_contents(run: RunFolder) -> Iterator[Check]:
    """Read what has a schema."""
    model = run.path / "table.json"
    if run.manifest.status in LEAVE_A_MODEL and not model.is_file():
        yield Check("model", "missing", f"the run is {run.manifest.status} and has no table.json")
    for file in (model, *sorted(run.path.glob("tables/*.json"))):
        if file.is_file():
            name = f"schema of {file.relative_to(run.path).as_posix()}"
            try:
                TableModel.load(file)
                yield Check(name, "ok")
            except TablemapError as error:
                yield Check(name, "damaged", str(error))
    try:
        _ = run.config
        yield Check("settings", "ok")
    except TablemapError as error:
        yield Check("settings", "damaged", str(error))


def _check_review(run: RunFolder) -> Check:
    from tablemap.review.checking import damage_of

    file = run.path / "run.rrd"
    if not file.is_file():
        return Check("review", "missing", "there is no run.rrd")
    try:
        damage = damage_of(file)
    except TablemapError as error:
        return Check("review", "unchecked", str(error))
    return Check("review", "damaged", damage) if damage else Check("review", "ok")


def _check_input(run: RunFolder) -> Check:
    file = input_path(run)
    if not file.is_file():
        return Check("recording", "unchecked", f"it is not here: {file}")
    try:
        find_input(run)
    except RecordingError as error:
        return Check("recording", "changed", str(error))
    if run.manifest.recording.sha256 is None:
        return Check("recording", "unchecked", f"its size alone is known: {file}")
    return Check("recording", "ok", str(file))
