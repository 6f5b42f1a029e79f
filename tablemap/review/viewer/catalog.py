"""A folder of runs as a Rerun catalog: one segment a run, the model's figures as its properties.

The catalog is made from the run folders each time. It has each run's .rrd, and beside it a layer
with the contents of manifest.json and table.json. So the figures exist even for runs whose .rrd is
of an older version, was cut short, or is missing.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import rerun as rr
from rerun_bindings import flush_and_cleanup_orphaned_recordings

from tablemap.archive.index import RunRow, list_runs
from tablemap.errors import ExternalToolError, TablemapError
from tablemap.review.viewer.viewer import LOOPBACK, mended

if TYPE_CHECKING:
    from rerun.catalog import DatasetEntry

DATASET = "runs"
FIGURES = "figures"
"""The layer with the figures from the run folders."""
FLUSH_SECONDS = 30
STREAMS = 20
"""Figures' streams after which those that are done with are let go."""


@dataclass(frozen=True)
class Catalog:
    """A served catalog: its address, its number of runs, and notes on unusual runs."""

    url: str
    runs: int
    notes: tuple[str, ...]


@contextmanager
def served_catalog(folder: Path, *, host: str = LOOPBACK, port: int = 0) -> Iterator[Catalog]:
    """Serve the runs of a folder within the context; port 0 takes a free one.

    Raises `ExternalToolError` if the extra is not installed or the port is taken, and
    `TablemapError` if there is no such folder.
    """
    rows = list_runs(folder)
    os.environ["CI"] = "1"  # keeps the server's usage statistics off
    try:
        import datafusion  # noqa: F401 - what rerun.catalog needs
        import rerun.server
    except ImportError as error:
        raise ExternalToolError(
            "the catalog needs DataFusion, which is not installed: pip install 'rerun-sdk[catalog]'"
        ) from error
    with tempfile.TemporaryDirectory(prefix="tablemap-") as room:
        try:
            server = rerun.server.Server(host=host, port=port)
        except Exception as error:
            raise ExternalToolError(
                f"the catalog cannot be served at {host}:{port} ({error}); choose another --port."
            ) from error
        with server:
            dataset = server.client().create_dataset(DATASET)
            notes = _register(dataset, folder, rows, Path(room))
            yield Catalog(server.url(), len(dataset.segment_ids()), tuple(notes))


def _register(dataset: DatasetEntry, folder: Path, rows: Sequence[RunRow], room: Path) -> list[str]:
    """Register each run's steps and figures; return a note on each run with less than both."""
    notes: list[str] = []
    steps: dict[str, RunRow] = {}
    for row in rows:
        (room / row.path).mkdir(parents=True)
        try:
            file = _steps(folder / row.path, room / row.path)
        except TablemapError as error:
            notes.append(f"{row.path}: its figures alone; {error}")
            continue
        steps[file.absolute().as_uri()] = row
        if file.is_relative_to(room):
            notes.append(f"{row.path}: cut short or still running; served as far as it was written")
    segments: dict[str, RunRow] = {}
    without = {row.path: row for row in rows}
    for uri, segment, trouble in _registered(dataset, list(steps), layer="base"):
        if trouble is None:
            segments[segment] = without.pop(steps[uri].path)
        elif "already exists" in trouble:
            copy = without.pop(steps[uri].path)
            notes.append(f"{copy.path}: left out, it is a copy of another run")
        else:
            notes.append(f"{steps[uri].path}: its figures alone; its run.rrd is refused: {trouble}")
    for row in without.values():
        segments[row.path if row.run in segments else row.run] = row
    layers = {}
    for number, (segment, row) in enumerate(segments.items()):
        file = _write_figures(row, segment, room / row.path / f"{FIGURES}.rrd")
        layers[file.as_uri()] = row
        if number % STREAMS == 0:
            # Rerun keeps a stream that is gone, with two threads, until it is told to look.
            flush_and_cleanup_orphaned_recordings()
    for uri, _, trouble in _registered(dataset, list(layers), layer=FIGURES):
        if trouble is not None:
            notes.append(f"{layers[uri].path}: without its figures: {trouble}")
    return notes


def _steps(run: Path, room: Path) -> Path:
    """Return a run's complete .rrd: its own, or a repaired copy in ``room``."""
    file = run / "run.rrd"
    if not file.is_file():
        raise TablemapError("there is no run.rrd")
    return mended(file, room)


def _registered(
    dataset: DatasetEntry, uris: list[str], *, layer: str
) -> Iterator[tuple[str, str, str | None]]:
    """Register files; yield for each its URI, its segment, and its error, if any.

    If the server cannot read one file, it refuses all of the call; then each is registered alone.
    """
    if not uris:
        return
    try:
        results = list(dataset.register(uris, layer_name=layer).iter_results())
    except Exception as error:
        if len(uris) == 1:
            yield uris[0], "", str(error).splitlines()[0]
            return
        for uri in uris:
            yield from _registered(dataset, [uri], layer=layer)
        return
    for result in results:
        yield result.uri, result.segment_id or "", result.error


def _write_figures(row: RunRow, segment: str, file: Path) -> Path:
    """Write a layer with a run's words as ``run`` and its figures as ``table``."""
    rec = rr.RecordingStream("tablemap", recording_id=segment)
    rec.set_log_time_enabled(False)
    rec.save(file)
    words = {name: value for name, value in row.to_dict().items() if isinstance(value, str)}
    table: dict[str, Any] = {name: float(value) for name, value in row.figures.items()}
    run: dict[str, Any] = {}
    for name, value in words.items():
        (table if name in ("shape", "verdict") else run)[name] = value
    if "seconds" in table:
        run["seconds"] = table.pop("seconds")
    rec.send_property("run", rr.AnyValues(**run))
    if table:
        rec.send_property("table", rr.AnyValues(**table))
    rec.flush(timeout_sec=FLUSH_SECONDS)
    rec.disconnect()
    return file
