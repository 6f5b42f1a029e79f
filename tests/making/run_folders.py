"""Run folders for tests that need many and no recording."""

from __future__ import annotations

from pathlib import Path

from tablemap.archive import Manifest, RunFolder
from tablemap.archive.index import RunRow, read_row
from tablemap.archive.liveness import Writer
from tablemap.archive.manifest import RecordingEntry, Status, versions
from tablemap.config import Config, dump_config
from tablemap.model import TableModel
from tablemap.recording import sha256


def read_runs(folder: Path) -> list[RunRow]:
    """Return the rows of all runs without any index: every run is read."""
    manifests = folder.glob("*/*/manifest.json")
    paths = sorted(file.parent.relative_to(folder).as_posix() for file in manifests)
    return [read_row(folder, path) for path in paths if not path.endswith("/latest")]


def make_run(
    output: Path,
    name: str,
    model: TableModel | None,
    *,
    recording: Path | None = None,
    status: Status = "ok",
    started: str = "2026-05-01T12:00:00+00:00",
    config: Config | None = None,
    writer: Writer | None = None,
) -> RunFolder:
    """Make ``output/<stem>/<run>`` of ``name``, finished, as a run of ``recording`` leaves it."""
    path = output / name
    path.mkdir(parents=True)
    entry = RecordingEntry(path=f"/gone/{path.parent.name}.mcap", size=3, sha256="0" * 64)
    if recording:
        entry = RecordingEntry(
            path=str(recording), size=recording.stat().st_size, sha256=sha256(recording)
        )
    manifest = Manifest(
        run_id=path.name,
        recording=entry,
        method="tablemap",
        tables="best",
        seed=0,
        versions=versions(),
        started=started,
        timings={"snapshots": 1.25, "surface": 0.5},
        writer=writer,
    )
    run = RunFolder(path, manifest)
    run.write("config.toml", dump_config(config or Config()))
    if model:
        run.write("trajectory.tum", "0.000000000 0 0 0 0 0 0 1\n")
        run.write("table.json", model.to_json())
    if status == "running":
        run.update()
    else:
        run.finish(status, error=None if status == "ok" else f"why it is {status}")
    return run
