"""Whether a run is still what was written, and its input what was read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tablemap.archive.folder import RunFolder
from tablemap.errors import RecordingError

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
