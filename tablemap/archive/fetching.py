"""Runs on a server, copied to this machine so that they can be looked at."""

from __future__ import annotations

import atexit
import shutil
from pathlib import Path
from typing import cast

from tablemap.archive.manifest import Manifest
from tablemap.errors import TablemapError
from tablemap.files import read_text
from tablemap.remote import RemotePath, place_at

MANIFEST, LATEST = "manifest.json", "latest"
_FOLDERS = ("", "tables", "exports")


def fetched_run(url: str) -> tuple[Path, str]:
    """Copy a run to a temporary folder that lasts as long as the program.

    ``url`` names the run, a file in it, or its recording, whose ``latest`` names the run. Returns
    the folder and the run's own address. Raises `TablemapError` if there is no run, or the server
    does not give it.
    """
    folder, address = _copied(url)
    atexit.register(shutil.rmtree, folder.parent.parent, ignore_errors=True)
    return folder, address


def copied_run(url: str) -> Path:
    """Copy a run as `fetched_run` does, to a folder that stays."""
    return _copied(url)[0]


def _copied(url: str) -> tuple[Path, str]:
    place_at(url)  # says what to install where that is missing
    given = RemotePath(url.rstrip("/"))
    try:
        run = _run_at(given)
        if run is None:
            raise TablemapError(f"expected a run folder with a manifest.json, found none: {given}")
        import tempfile  # here: it is for runs on servers alone

        folder = Path(tempfile.mkdtemp(prefix="tablemap-")) / run.parent.name / run.name
        for name in _names(run):
            target = folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            with (run / name).open() as stream, target.open("wb") as copy:
                shutil.copyfileobj(stream, copy)
    except OSError as error:
        raise TablemapError(f"the run cannot be fetched ({error.strerror}): {given}") from error
    except ValueError as error:
        raise TablemapError(f"the run's manifest is damaged: {given}") from error
    return folder, str(run)


def _names(run: RemotePath) -> list[str]:
    """Return the names of a run's files, relative to it.

    Raises `OSError` as `RemotePath.iterdir` does, and `ValueError` for a damaged manifest.
    """
    if run.url.startswith("http"):  # a web server lists nothing, and the manifest does
        manifest = Manifest.from_json(read_text(cast(Path, run / MANIFEST)))
        if any(".." in name or name.startswith("/") for name in manifest.files):
            raise ValueError("a file that is not in the run's folder")
        return [MANIFEST, *manifest.files]
    places = [run / part if part else run for part in _FOLDERS]
    return [file.url.removeprefix(f"{run.url}/") for place in places for file in place.iterdir()]


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
