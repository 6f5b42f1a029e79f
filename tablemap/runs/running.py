"""Processing of one recording into one run folder, with review, archive and errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from tablemap.archive.folder import RunFolder, load_run, trajectory_tum
from tablemap.archive.verification import find_input
from tablemap.config import Config, Method, Tables, check_tables, dump_config, load_config
from tablemap.errors import LOSSES, ConfigError, TablemapError
from tablemap.events import OtherTable, Record, RunFailed, StageFinished, StageStarted, ignore
from tablemap.inputs import AnyInput, Input
from tablemap.model import TableModel
from tablemap.paths import AnyPath, as_path

if TYPE_CHECKING:
    from tablemap.pipeline import Processed
    from tablemap.review.page.page import Page

Follow = Callable[[Path], AbstractContextManager[object]]


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    - ``recording``: the input
    - ``run``: its folder, None if there was no file to process
    - ``status``: ``partial`` if only a part of the recording could be read
    - ``error``: one sentence on the failure or loss, None if all went well
    - ``model``: the chosen table, None if there is none
    - ``others``: with all tables, the candidates beside it: each a model, or why it is none
    """

    recording: Input
    run: RunFolder | None
    status: Literal["ok", "partial", "failed"]
    error: str | None
    model: TableModel | None
    others: tuple[OtherTable, ...] = ()


class InterruptedRun(KeyboardInterrupt):
    """An interruption of a run whose folder, ``run``, keeps what was done by then."""

    def __init__(self, run: Path) -> None:
        super().__init__(str(run))
        self.run = run


def run(
    recording: AnyInput,
    *,
    output: AnyPath = "runs",
    config: Config | None = None,
    method: Method | None = None,
    tables: Tables | None = None,
    progress: Record = ignore,
    follow: Follow = nullcontext,
) -> Outcome:
    """Process a recording into a new run folder ``output/<recording>/<run>``.

    Several files of one drive are read together. ``tables`` is ``best``, ``all``, or a place (x, y)
    in the map, metres: then the nearest table is modelled. ``method`` is ``tablemap`` or
    ``report``. If one of both is None, it comes from ``config``. ``progress`` is called with every
    result and event of the stages. The context ``follow(path of run.rrd)`` is entered before that
    file is written, and left afterwards.

    An error of the recording, the disk or the permissions gives a failed `Outcome`; the folder then
    has ``run.rrd``, ``report.html`` and ``manifest.json``, but no ``table.json``. An interruption
    or a defect of the program marks the folder and is raised again. Raises `TablemapError` for
    arguments that are not valid: no path, no such method or tables.
    """
    recording, output, config = Input.of(recording), as_path(output), config or Config()
    method = config.method if method is None else method
    if method not in get_args(Method):
        raise ConfigError(f"expected a method of {', '.join(get_args(Method))}; found {method!r}.")
    tables = config.tables if tables is None else check_tables(tables)
    # config.toml says all of it: it repeats the run.
    config = config.model_copy(update={"method": method, "tables": tables})
    try:
        recording.check()
        folder = RunFolder.create(output, recording, method=method, tables=tables, config=config)
    except ConfigError:
        raise
    except TablemapError as error:
        return Outcome(recording, None, "failed", str(error), None)

    from tablemap.review.page.page import Page

    page = Page()
    stages = _Stages()
    with ThreadPoolExecutor(1, thread_name_prefix="sha256") as hashing:
        digest = hashing.submit(recording.sha256)
        try:
            processed = _process_reviewed(
                recording,
                folder,
                config,
                _method(method),
                tables,
                stages,
                page,
                progress,
                follow,
            )
            entry = folder.manifest.recording.model_copy(update={"sha256": digest.result()})
            folder.update(recording=entry, timings=stages.seconds)
            folder.write("trajectory.tum", trajectory_tum(processed.trajectory))
            folder.write("table.json", processed.model.to_json())
            for other in processed.others:
                if isinstance(other.outcome, TableModel):
                    folder.write(f"tables/{other.number:02d}.json", other.outcome.to_json())
            lost = [w.message for w in processed.model.warnings if w.code in LOSSES]
            status: Literal["ok", "partial"] = "partial" if lost else "ok"
            loss = lost[0] if lost else None
            html = page.html(folder.manifest, status=status, error=loss)
            folder.write("report.html", html)
            folder.finish(status, error=loss)
        except (TablemapError, OSError) as error:
            with suppress(TablemapError, OSError):
                entry = folder.manifest.recording.model_copy(update={"sha256": digest.result()})
                folder.update(recording=entry)
            _leave(folder, page, stages, "failed", str(error))
            return Outcome(recording, folder, "failed", str(error), None)
        except KeyboardInterrupt as stop:
            _leave(folder, page, stages, "interrupted", f"interrupted during {stages.current}")
            raise InterruptedRun(folder.path) from stop
        except BaseException as error:
            _leave(folder, page, stages, "failed", f"{type(error).__name__}: {error}")
            raise
    # As it is written: rounded as table.json rounds.
    model = folder.model
    return Outcome(recording, folder, status, folder.manifest.error, model, processed.others)


def reprocess(
    folder: AnyPath,
    *,
    output: AnyPath | None = None,
    overrides: Sequence[str] = (),
    progress: Record = ignore,
) -> Outcome:
    """Process a run's recording again with its config and ``section.key=value`` changes.

    The new run is put beside the old one unless ``output`` names another folder of runs. It ends
    like `run`. Raises `RecordingError` if the recording is gone or has changed, `ConfigError` for
    settings that are not valid, and `TablemapError` if there is no run.
    """
    folder = load_run(folder)
    manifest = folder.manifest
    # The manifest knows them of runs too whose config.toml does not.
    place = manifest.tables if isinstance(manifest.tables, str) else list(manifest.tables)
    held = [f"method={manifest.method}", f"tables={place}"]
    return run(
        find_input(folder),
        output=folder.path.parent.parent if output is None else output,
        config=load_config(folder.path / "config.toml", overrides=[*held, *overrides]),
        progress=progress,
    )


def _leave(
    folder: RunFolder,
    page: Page,
    stages: _Stages,
    status: Literal["failed", "interrupted"],
    error: str,
) -> None:
    """Finish the folder of a run that did not complete: write its page and how it ended."""
    with suppress(Exception):  # a full disk, or the page itself, may have ended the run
        folder.update(timings=stages.seconds)
        folder.write("report.html", page.html(folder.manifest, status=status, error=error))
    with suppress(TablemapError):  # the manifest then still says ``running``
        folder.finish(status, error=error)


def _process_reviewed(
    source: Input,
    folder: RunFolder,
    config: Config,
    process: Callable[..., Processed],
    tables: Tables,
    stages: _Stages,
    page: Record,
    progress: Record,
    follow: Follow,
) -> Processed:
    """Open and process a recording, and write every result and event to ``run.rrd``."""
    from tablemap.recording import open_recording
    from tablemap.review import Reviewer

    folder.write("config.toml", dump_config(config))
    file = folder.path / "run.rrd"
    with (
        follow(file),
        Reviewer(
            file,
            run_id=folder.manifest.run_id,
            recording_name=source.stem,
            config=config.review,
        ) as review,
    ):

        def record(event: object) -> None:
            for observe in (stages, page, progress, review):
                observe(event)

        try:
            recording = open_recording(source, topics=config.topics, limits=config.limits)
            record(recording)
            return process(recording, config=config, tables=tables, record=record)
        except BaseException as error:
            with suppress(TablemapError):  # the review itself may have failed
                record(RunFailed(stages.current, str(error) or type(error).__name__))
            raise


class _Stages:
    """Keeps the current stage of a run, and the seconds of each stage."""

    def __init__(self) -> None:
        self.current = "recording"
        self.seconds: dict[str, float] = {}

    def __call__(self, event: object) -> None:
        if isinstance(event, StageStarted):
            self.current = event.name
        elif isinstance(event, StageFinished):
            self.seconds[event.name] = round(self.seconds.get(event.name, 0.0) + event.seconds, 4)


def _method(method: Method) -> Callable[..., Processed]:
    if method == "report":
        from tablemap.baseline.method import process as process_as_reported

        return process_as_reported
    from tablemap.pipeline import process

    return process
