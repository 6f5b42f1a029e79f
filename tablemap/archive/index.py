"""All runs of a folder as rows, and an index that makes listing them fast.

The folders are the truth. For each run the index keeps its row, with the times and sizes of the
files that were read. A run whose files changed is read again, and a run that is gone is dropped. An
index that is lost, damaged or of another version is built again.
"""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
from collections.abc import Iterator
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from tablemap.errors import TablemapError
from tablemap.files import is_file, read_bytes, write_whole
from tablemap.model.shapes import shape_named
from tablemap.paths import AnyPath, as_path
from tablemap.remote import RemotePath, is_remote, place_at
from tablemap.words import shortened

if TYPE_CHECKING:
    from tablemap.model import TableModel

INDEX, MANIFEST = ".index.json", "manifest.json"
SCHEMA = "tablemap/index/2"
_REQUESTS = 16
"""Requests at once: a list waits for the answers of two or three a run."""
MOST_ROW_BYTES = 32 * 1024
"""No index is read that has more for each run that is there."""

Stamp = tuple[int, int, int, int]
"""Time of change (ns) and size of manifest.json, then of table.json; zeros for a missing file."""


class RunRow(NamedTuple):
    """One run in a list (a tuple, since thousands of them are made at once).

    - ``path``: relative to the folder of runs, ``<recording>/<run>``
    - ``status``: the manifest's; ``dead`` if that is ``running`` and its process is gone;
      ``damaged`` if it cannot be read
    - ``shape``, ``verdict``: None without a model
    - ``figures``: all numbers by name, in metres, radians and seconds; sigmas as ``<name>_sigma``
    """

    path: str
    recording: str
    run: str
    started: str
    status: str
    method: str | None
    error: str | None
    shape: str | None
    verdict: str | None
    figures: dict[str, float]

    def to_dict(self) -> dict[str, object]:
        """Return the row as values for JSON."""
        return self._asdict()


def list_runs(folder: AnyPath = "runs", *, index: AnyPath | None = None) -> list[RunRow]:
    """Return a row for each run under ``folder``, in the order of their paths.

    The ``index`` (by default in the folder) is updated if it may be written; runs on a server have
    none, and each is read. Raises `TablemapError` if there is no such folder.
    """
    if is_remote(folder):
        return _remote_rows(place_at(str(folder)))
    folder = as_path(folder)
    file = folder / INDEX if index is None else as_path(index)
    there = list(_runs(folder))
    held = _load(file, most_bytes=MOST_ROW_BYTES * (len(there) + 1))
    rows: dict[str, tuple[Stamp, RunRow]] = {}
    changed = False
    for path, stamp in there:
        known = held.get(path)
        if known is not None and known[0] == stamp:
            rows[path] = known
        else:
            rows[path] = (stamp, read_row(folder, path))
            changed = True
    if changed or rows.keys() != held.keys():
        _save(file, rows)
    return [_as_it_is(folder, rows[path][1]) for path in sorted(rows)]


def _remote_rows(folder: Path) -> list[RunRow]:
    """Return a row for each run below a place on a server."""
    from concurrent.futures import ThreadPoolExecutor

    given = RemotePath(str(folder))
    if given.url.startswith("http"):
        raise TablemapError(
            "a web server does not tell which runs it has; give a place as s3:// or gs://, or a "
            f"run's own address to `runs show`: {folder}"
        )
    try:
        with ThreadPoolExecutor(_REQUESTS) as pool:
            found = [run for runs in pool.map(RemotePath.folders, given.folders()) for run in runs]
            if not found and not given.exists():
                raise FileNotFoundError(errno.ENOENT, "No such place", str(given))
            whole = pool.map(lambda run: (run / MANIFEST).is_file(), found)
            names = [f"{run.parent.name}/{run.name}" for run in compress(found, whole)]
            return list(pool.map(lambda name: read_row(folder, name), sorted(names)))
    except OSError as error:
        raise TablemapError(f"expected a place with runs ({error.strerror}): {folder}") from error


def _as_it_is(folder: Path, row: RunRow) -> RunRow:
    """Return a row, as ``dead`` where it is said to run and nobody is there that writes it."""
    if row.status != "running":
        return row
    from tablemap.archive.folder import load_run

    try:
        return row._replace(status="dead") if load_run(folder / row.path).is_dead else row
    except TablemapError:
        return row  # it has gone, or changed, since it was read


def read_row(folder: Path, path: str) -> RunRow:
    """Read one run; the row's status says if it cannot be read."""
    # Most listings find all rows in the index, and read no run.
    from tablemap.archive.folder import MODEL, load_run, read_manifest
    from tablemap.archive.manifest import LEAVE_A_MODEL
    from tablemap.model import TableModel

    recording, run = path.split("/")
    try:
        there = folder / path
        if is_remote(there):
            manifest = read_manifest(there, given=there)
        else:
            manifest = load_run(there).manifest
    except TablemapError as error:
        return RunRow(path, recording, run, "", "damaged", None, str(error), None, None, {})
    model, trouble = None, manifest.error
    leaves_one = manifest.status in LEAVE_A_MODEL
    if leaves_one or (manifest.status != "running" and is_file(folder / path / MODEL)):
        try:
            model = TableModel.load(folder / path)
        except TablemapError as error:
            trouble = str(error)
    figures = figures_of(model) if model else {}
    if manifest.timings:
        figures["seconds"] = round(min(sum(manifest.timings.values()), 1e9), 3)
    return RunRow(
        path=path,
        recording=recording,
        run=run,
        started=shortened(manifest.started),
        status=manifest.status,
        method=shortened(manifest.method),
        error=None if trouble is None else shortened(trouble, most=1000),
        shape=model.surface.shape if model else None,
        verdict=model.verdict.level if model else None,
        figures=figures,
    )


def figures_of(model: TableModel) -> dict[str, float]:
    """Return a model's figures by name, and their known sigmas as ``<name>_sigma``."""
    surface, pose = model.surface, model.surface.pose
    named = shape_named(surface.shape).dimensions
    known = {name: size for name, size in surface.dimensions.items() if name in named}
    figures = known | {"height": surface.height}
    optional = {"thickness": surface.thickness, "corner_radius": surface.corner_radius}
    figures |= {name: figure for name, figure in optional.items() if figure is not None}
    numbers: dict[str, float] = {}
    for name, figure in figures.items():
        numbers[name] = figure.value
        if figure.sigma is not None:
            numbers[f"{name}_sigma"] = figure.sigma
    for k, name in enumerate(("x", "y", "yaw")):
        numbers[name] = getattr(pose, name)
        numbers[f"{name}_sigma"] = round(math.sqrt(max(pose.covariance[k][k], 0.0)), 6)
    return numbers | {
        "score": surface.score,
        "legs": len(model.legs),
        "views": sum(snapshot.used for snapshot in model.snapshots),
        "warnings": len(model.warnings),
    }


def _runs(folder: Path) -> Iterator[tuple[str, Stamp]]:
    """Find every run's folder: two levels down, neither hidden nor a link such as ``latest``."""
    try:
        recordings = list(os.scandir(folder))
    except OSError as error:
        raise TablemapError(
            f"expected a folder of runs ({error.strerror}); give the one that "
            f"`tablemap process --output` wrote to: {folder}"
        ) from error
    for recording in recordings:
        if recording.name.startswith(".") or not _is_folder(recording):
            continue
        try:
            runs = list(os.scandir(recording.path))
        except FileNotFoundError:  # it went meanwhile
            continue
        except OSError:  # a row says that it cannot be read
            yield f"{recording.name}/", (0, 0, 0, 0)
            continue
        for run in runs:
            if run.name.startswith(".") or run.is_symlink() or not _is_folder(run):
                continue
            stamp = (
                *_changed(f"{run.path}/{MANIFEST}"),
                *_changed(f"{run.path}/table.json"),
            )
            if stamp[0]:
                yield f"{recording.name}/{run.name}", stamp


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a link that leads to itself
        return False


def _changed(file: str) -> tuple[int, int]:
    try:
        found = os.stat(file)  # noqa: PTH116 - twice as fast as Path's, and called for every run
    except OSError:
        return 0, 0
    return found.st_mtime_ns, found.st_size


def _load(file: Path, *, most_bytes: int) -> dict[str, tuple[Stamp, RunRow]]:
    """Read the index; an index with unexpected content counts as empty."""
    try:
        document: Any = json.loads(read_bytes(file, most_bytes=most_bytes))
        if document["schema"] != SCHEMA:
            return {}
        held: dict[str, tuple[Stamp, RunRow]] = {}
        names = document["names"]
        for a, b, c, d, path, *words, known, values in document["runs"]:
            recording, run = path.split("/")
            figures = dict(zip(names[known], values, strict=True))
            row = RunRow._make((path, recording, run, *words, figures))
            _check(row)
            held[path] = (a, b, c, d), row
    except (
        OSError,
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        RecursionError,
        TablemapError,
    ):
        return {}
    return held


def _check(row: RunRow) -> None:
    """Raise an error for a row out of an index that no run can have."""
    started, status, method, error, shape, verdict = row[3:-1]
    words = [word for word in (method, error, shape, verdict) if word is not None]
    "".join((started, status, *words, *row.figures)).encode()  # neither half a letter
    if shape is not None:
        shape_named(shape)
    if not all(map(math.isfinite, row.figures.values())):
        raise ValueError("a figure that is no number")


def _save(file: Path, rows: dict[str, tuple[Stamp, RunRow]]) -> None:
    """Write the index: one line of values a run; runs with the same figures share their names.

    Every listing reads the whole index, so its size decides how fast a listing is.
    """
    names: dict[tuple[str, ...], int] = {}
    lines = []
    for stamp, row in rows.values():
        known = names.setdefault(tuple(row.figures), len(names))
        words = row[3:-1]  # path says recording and run
        lines.append((*stamp, row.path, *words, known, list(row.figures.values())))
    document = {"schema": SCHEMA, "names": list(names), "runs": lines}
    # A read-only folder is listed too, without an index.
    with contextlib.suppress(OSError):
        write_whole(file, json.dumps(document, separators=(",", ":")))
