"""Whether a run is still what was written, and its input what was read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tablemap.archive.folder import RunFolder
from tablemap.errors import RecordingError
from tablemap.inputs import Input

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


def recorded_input(run: RunFolder) -> Input:
    """Return where a run's recording should be: packed with it, or where it was read."""
    read = run.manifest.recording.input
    packed = Input(tuple(str(run.path / INPUT / path.name) for path in read.paths))
    return packed if packed.exists() else read


def find_input(run: RunFolder) -> Input:
    """Return the recording of a run.

    Raises `RecordingError` where it is gone, or where size or SHA-256 are not the manifest's.
    """
    entry, found = run.manifest.recording, recorded_input(run)
    if not found.exists():
        raise RecordingError(f"the run's recording is gone; put it back at {found}")
    size = found.size()
    if entry.size is not None and size != entry.size:
        raise RecordingError(
            f"the recording is not the run's: expected {entry.size} bytes, found {size}: {found}"
        )
    if entry.sha256 is not None and found.sha256() != entry.sha256:
        raise RecordingError(
            f"the recording is not the run's: its SHA-256 is not the manifest's: {found}"
        )
    return found
