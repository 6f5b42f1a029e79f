"""Reviews and pages of made-up runs."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader

from tablemap import recording
from tablemap.archive import load_run
from tablemap.archive.folder import RunFolder
from tablemap.archive.manifest import Manifest, RecordingEntry
from tablemap.config import Config, ReviewConfig
from tablemap.events import Record, StageFinished
from tablemap.review import Reviewer
from tablemap.review.page.page import Page
from tablemap.review.room import Eye
from tablemap.runs import running
from tests.making import made_up_run as made_up


def write(path: Path, run: list[object], level: str = "standard") -> Path:
    """Write a review of results."""
    path.parent.mkdir(exist_ok=True)
    config = ReviewConfig.read({"level": level})
    with Reviewer(path, run_id=path.parent.name, recording_name="made up", config=config) as record:
        for one in run:
            record(one)
    return path


def run_until(
    stage: str,
    end: Callable[[], None],
    folder: Path,
    patch: Callable[[object, str, object], None],
    *,
    review: ReviewConfig | None = None,
) -> RunFolder:
    """Run the made-up drive to the end of a stage, where ``end`` is called; return its folder."""

    def process(*_: Any, record: Record, **__: Any) -> None:
        for one in made_up.results(stops=4)[1:]:
            record(one)
            if isinstance(one, StageFinished) and one.name == stage:
                end()

    patch(running, "_method", lambda _: process)
    patch(recording, "open_recording", lambda *_, **__: made_up.MadeUpRecording(stops=4))
    file = folder / "lap.mcap"
    folder.mkdir(exist_ok=True)
    file.write_bytes(b"made up")
    with suppress(KeyboardInterrupt, ZeroDivisionError):
        running.run(file, output=folder / "runs", config=Config(review=review or ReviewConfig()))
    return load_run(next((folder / "runs" / "lap").glob("2*")))


def columns(path: Path, entity: str, name: str) -> list[list[object]]:
    """The values of a component of an entity, row by row."""
    found: list[list[object]] = []
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        if chunk.entity_path == entity and name in batch.schema.names:
            found += batch.column(name).to_pylist()
    return found


def eye_of_first_view(path: Path) -> Eye:
    """Where the eye of the last layout's first view begins."""
    return eye_of(path, "Table and stops")


def eye_of(path: Path, name: str) -> Eye:
    """Where the eye of the view whose name so begins stands in the largest layout: the last."""
    reader = RrdReader(path)
    layouts = [list(reader.stream(store=store)) for store in reader.blueprints()]
    eyes: dict[str, Eye] = {}
    names: dict[str, str] = {}
    for chunk in max(layouts, key=len):
        rows = chunk.to_record_batch().to_pydict()
        view = "/".join(chunk.entity_path.split("/")[:3])
        for one in rows.get("ViewBlueprint:display_name", []):
            names[view] = str(one[0])
        if "EyeControls3D:position" in rows:
            (position,), (target,) = (
                rows[f"EyeControls3D:{one}"][-1] for one in ("position", "look_target")
            )
            eyes[view] = Eye(tuple(position), tuple(target))
    return next(eye for view, eye in eyes.items() if names[view].startswith(name))


def manifest(path: str = "/laps/lap.mcap") -> Manifest:
    """A run's manifest."""
    return Manifest(
        schema_name="tablemap/manifest/1",
        run_id="20260101T000000-00000000",
        recording=RecordingEntry(path=path, size=12, sha256="ab" * 32),
        method="tablemap",
        tables="best",
        seed=0,
        versions={"numpy": "2.0"},
        started="2026-01-01T00:00:00+00:00",
        timings={"snapshots": 1.25},
    )


def page(results: list[object], *, status: str = "ok", error: str | None = None) -> str:
    """The page of a run's results."""
    kept = Page()
    for one in results:
        kept(one)
    return kept.html(manifest(), status=status, error=error)
