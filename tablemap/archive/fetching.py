"""Runs on a server, copied to this machine so that they can be looked at."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from pathlib import Path

from tablemap.errors import TablemapError
from tablemap.remote import RemotePath, place_at

MANIFEST, LATEST = "manifest.json", "latest"
_FOLDERS = ("", "tables", "exports")


def fetched_run(url: str) -> Path:
    """Copy a run to a temporary folder that lasts as long as the program, and return it.

    ``url`` names the run, a file in it, or its recording, whose ``latest`` names the run. Raises
    `TablemapError` if there is no run, or the server does not give it.
    """
    run = copied_run(url)
    atexit.register(shutil.rmtree, run.parent.parent, ignore_errors=True)
    return run


def copied_run(url: str) -> Path:
    """Copy a run as `fetched_run` does, to a folder that stays."""
    place_at(url)  # says what to install where that is missing
    given = RemotePath(url.rstrip("/"))
    try:
        run = _run_at(given)
        if run is None:
            raise TablemapError(f"expected a run folder with a manifest.json, found none: {given}")
        folder = Path(tempfile.mkdtemp(prefix="tablemap-")) / run.parent.name / run.name
        for part in _FOLDERS:
            source = run / part if part else run
            for file in source.iterdir():
                target = folder / part / file.name
                target.parent.mkdir(parents=True, exist_ok=True)
                with file.open() as stream, target.open("wb") as copy:
                    shutil.copyfileobj(stream, copy)
    except OSError as error:
        raise TablemapError(f"the run cannot be fetched ({error.strerror}): {given}") from error
    return folder


def is_run(url: str) -> bool:
    """Tell whether a place on a server is a run, a file of one, or a recording's folder of runs."""
    try:
        return url.endswith(".rrd") or _run_at(RemotePath(url.rstrip("/"))) is not None
    except OSError:
        return False  # who reads it says why it cannot be read


def _run_at(given: RemotePath) -> RemotePath | None:
    """Return the run that a place names, None where there is none."""
    for place in (given, given.parent):
        if (place / MANIFEST).is_file():
            return place
    latest = given if given.name == LATEST else given / LATEST
    if not latest.is_file():
        return None
    run = latest.parent / latest.read_text("utf-8").strip()
    return run if (run / MANIFEST).is_file() else None
