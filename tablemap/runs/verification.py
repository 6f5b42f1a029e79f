"""Checks of a run: its files, their contents, its review and its recording."""

from __future__ import annotations

from collections.abc import Iterator

from tablemap.archive.folder import RunFolder, load_run
from tablemap.archive.manifest import LEAVE_A_MODEL
from tablemap.archive.verification import Check, check_files, find_input, recorded_input
from tablemap.errors import RecordingError, TablemapError
from tablemap.model import TableModel
from tablemap.paths import AnyPath


def verify(run: AnyPath) -> list[Check]:
    """Check the files' hashes and contents, the .rrd, and the input if it can be found.

    Returns all checks. Raises `TablemapError` if there is no run, or a file of it cannot be read.
    """
    run = load_run(run)
    return [*check_files(run), *_check_contents(run), _check_review(run), _check_input(run)]


def _check_contents(run: RunFolder) -> Iterator[Check]:
    """Check the files that have a schema."""
    model = run.path / "table.json"
    if run.manifest.status in LEAVE_A_MODEL and not model.is_file():
        yield Check("model", "missing", f"the run is {run.manifest.status} and has no table.json")
    for file in run.table_files:
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


_REDRAW = "`tablemap runs redraw` makes it anew"


def _check_review(run: RunFolder) -> Check:
    from tablemap.review.viewer.checking import damage_of

    file = run.path / "run.rrd"
    if not file.is_file():
        return Check("review", "missing", f"there is no run.rrd; {_REDRAW}")
    if run.manifest.status == "running":
        told = "the run was not finished: `tablemap view` shows what it has written"
        return Check("review", "unchecked", told)
    try:
        damage = damage_of(file)
    except TablemapError as error:
        return Check("review", "unchecked", str(error))
    return Check("review", "damaged", f"{damage}; {_REDRAW}") if damage else Check("review", "ok")


def _check_input(run: RunFolder) -> Check:
    found = recorded_input(run)
    if not found.exists():
        return Check("recording", "unchecked", f"it is not here: {found}")
    try:
        find_input(run)
    except RecordingError as error:
        return Check("recording", "changed", str(error))
    if run.manifest.recording.sha256 is None:
        return Check("recording", "unchecked", f"its size alone is known: {found}")
    return Check("recording", "ok", str(found))
