"""Checks that neither a run nor its input has changed since the run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tablemap.archive.folder import RunFolder
from tablemap.errors import RecordingError
from tablemap.inputs import Input

INPUT = "input"
"""Folder in a run with its recording, if it was packed with the run."""


@dataclass(frozen=True)
class Check:
    """The result of one check; if it is ``unchecked``, ``detail`` says why."""

    name: str
    outcome: Literal["ok", "unchecked", "missing", "changed", "damaged"]
    detail: str | None = None

    @property
    def passed(self) -> bool:
        """Whether the check found nothing wrong."""
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
            checks.append(Check(name, "changed", "its SHA-256 is not the one in the manifest"))
        else:
            checks.append(Check(name, "ok"))
    extra = sorted(found.keys() - expected.keys())
    checks.extend(Check(name, "unchecked", "the run did not write it") for name in extra)
    return checks


def recorded_input(run: RunFolder) -> Input:
    """Return the expected place of a run's recording: in the run, or where it was read."""
    read = run.manifest.recording.input
    packed = Input(tuple(str(run.path / INPUT / path.name) for path in read.paths))
    return packed if packed.exists() else read


def find_input(run: RunFolder) -> Input:
    """Return the recording of a run.

    Raises `RecordingError` if it is gone, or if size or SHA-256 differ from the manifest's.
    """
    entry, found = run.manifest.recording, recorded_input(run)
    if not found.exists():
        raise RecordingError(f"the run's recording is gone; put it back at {found}")
    size = found.size()
    if entry.size is not None and size != entry.size:
        raise RecordingError(
            f"the recording is another one: expected {entry.size} bytes, found {size}: {found}"
        )
    if entry.sha256 is not None and found.sha256() != entry.sha256:
        raise RecordingError(
            f"the recording is another one: its SHA-256 is not the one in the manifest: {found}"
        )
    return found


def confirmed_input(run: RunFolder) -> Input:
    """Return the recording of a run that is surely the one that was read, by its SHA-256.

    A run from elsewhere may name any file of this machine. Raises `RecordingError` where
    `find_input` does, if the recording is not on this machine, or if the manifest has no SHA-256.
    """
    found = recorded_input(run)
    if found.is_remote:
        raise RecordingError(
            f"expected a recording on this machine to pack with the run, found {found}; pack the "
            "run without it"
        )
    if run.manifest.recording.sha256 is None:
        raise RecordingError(
            "the run's manifest has no SHA-256 of its recording, so nothing confirms that this "
            f"file is it; pack the run without it: {found}"
        )
    return find_input(run)
