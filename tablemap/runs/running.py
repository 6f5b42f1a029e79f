"""Processing of one recording into one run folder, with review, archive and errors."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from msgspec.structs import replace

from tablemap.archive.folder import RunFolder, check_writable, load_run, table_name
from tablemap.archive.liveness import Heart
from tablemap.archive.tum import trajectory_tum
from tablemap.archive.verification import find_input
from tablemap.config import Config, Method, Tables, check_tables, dump_config, load_config
from tablemap.errors import LOSSES, ConfigError, TablemapError
from tablemap.events import OtherTable, Record, RunFailed, StageFinished, StageStarted, ignore
from tablemap.inputs import AnyInput, Input
from tablemap.interrupts import told_to_stop, undisturbed
from tablemap.model import TableModel
from tablemap.paths import AnyPath, as_path
from tablemap.words import shown

if TYPE_CHECKING:
    from tablemap.pipeline import Processed

Follow = Callable[[Path], AbstractContextManager[object]]

REVIEW = "run.rrd"
RESULTS = "results.npz"
_DIGEST_SECONDS = 5.0  # that a run which is left waits for its recording's hash


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

    @staticmethod
    def of_defect(recording: Input, error: Exception) -> Outcome:
        """Return how a run ended that has met a defect of the program, or the memory's end."""
        if isinstance(error, MemoryError):
            return Outcome(recording, None, "failed", out_of_memory(recording), None)
        sentence = (
            f"this is a defect of tablemap: {type(error).__name__}: {error}; run it again with "
            f"--debug and report what it prints: {recording}"
        )
        return Outcome(recording, None, "failed", sentence, None)


def out_of_memory(recording: object) -> str:
    """Return the sentence about a recording for which there was not enough memory."""
    return (
        "the memory does not suffice; free some, process fewer recordings at once, or lower the "
        f"settings of [limits]: {recording}"
    )


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
    config = replace(config, method=method, tables=tables)
    running = _Running(recording)
    try:
        recording.check()
        folder = running.begin(output, method=method, tables=tables, config=config)
        with Heart(folder.path):
            processed = running.process(folder, config, _method(method), tables, progress, follow)
            status, loss = running.keep(folder, processed)
        # As it is written: rounded as table.json rounds.
        return Outcome(recording, folder, status, loss, folder.model, processed.others)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt) or told_to_stop():
            running.leave("interrupted", f"interrupted during {running.stage}")
            if running.folder is None:
                raise KeyboardInterrupt from error
            raise InterruptedRun(running.folder.path) from error
        if isinstance(error, MemoryError):
            sentence = out_of_memory(recording)
        elif isinstance(error, (TablemapError, OSError)):
            sentence = str(error)
        else:
            running.leave("failed", f"{type(error).__name__}: {error}")
            raise
        running.leave("failed", sentence)
        return Outcome(recording, running.folder, "failed", sentence, None)


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
    if output is None:
        check_writable(folder)
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


class _Running:
    """A run that goes on: its folder, its page, which stage it is in, and how it is left."""

    def __init__(self, recording: Input) -> None:
        from tablemap.review.page.page import Page

        self.folder: RunFolder | None = None
        self.stage = "recording"
        self._recording = recording
        self._page = Page()
        self._seconds: dict[str, float] = {}
        self._streamed = [REVIEW]
        self._digest = _Digest(recording)

    def begin(self, output: Path, *, method: str, tables: Tables, config: Config) -> RunFolder:
        """Make the folder of the run."""
        self.folder = RunFolder.create(
            output, self._recording, method=method, tables=tables, config=config
        )
        self._digest.start()
        return self.folder

    def process(
        self,
        folder: RunFolder,
        config: Config,
        process: Callable[..., Processed],
        tables: Tables,
        progress: Record,
        follow: Follow,
    ) -> Processed:
        """Open and process the recording; everything that happens is written to ``run.rrd``."""
        from tablemap.recording import open_recording
        from tablemap.review import Reviewer
        from tablemap.review.keeping.results import Keeper

        folder.write("config.toml", dump_config(config))
        file = folder.path / REVIEW
        if config.review.level != "off":
            self._streamed.append(RESULTS)
        with (
            follow(file),
            Reviewer(
                file,
                run_id=folder.manifest.run_id,
                recording_name=shown(self._recording.stem),
                config=config.review,
            ) as review,
            Keeper(folder.path / RESULTS, config.review) as keep,
        ):

            def record(event: object) -> None:
                for observe in (self._observe, self._page, progress, review, keep):
                    observe(event)

            try:
                with open_recording(
                    self._recording, topics=config.topics, limits=config.limits
                ) as recording:
                    record(recording)
                    return process(recording, config=config, tables=tables, record=record)
            except BaseException as error:
                with suppress(TablemapError):  # where the review itself is what failed
                    record(RunFailed(self.stage, str(error) or type(error).__name__))
                raise

    def keep(
        self, folder: RunFolder, processed: Processed
    ) -> tuple[Literal["ok", "partial"], str | None]:
        """Write the model; return the run's status, and what of the recording was lost."""
        self._note(folder, self._digest.wait())
        folder.write("trajectory.tum", trajectory_tum(processed.trajectory))
        rejected = {}
        for other in processed.others:
            if isinstance(other.outcome, TableModel):
                folder.write(table_name(other.number), other.outcome.to_json())
            else:
                rejected[other.number] = other.outcome
        if rejected:
            folder.update(rejected=rejected)
        lost = [w.message for w in processed.model.warnings if w.code in LOSSES]
        status: Literal["ok", "partial"] = "partial" if lost else "ok"
        _check_review(folder.path / REVIEW)
        loss = lost[0] if lost else None
        folder.write("report.html", self._page.html(folder.manifest, status=status, error=loss))
        folder.write("table.json", processed.model.to_json())
        folder.finish(status, error=loss, streamed=self._streamed)
        return status, loss

    def leave(self, status: Literal["failed", "interrupted"], error: str) -> None:
        """Leave a folder whose run did not come to its end, with its page and how it ended.

        First how it ended, for the disk may be full, or the page be what the run failed of.
        """
        folder = self.folder
        if folder is None:  # it was not made
            return
        with undisturbed(), suppress(TablemapError):  # else the manifest still says that it runs
            folder.finish(status, error=error)
            with suppress(Exception):
                self._note(folder, self._digest.wait(_DIGEST_SECONDS))
                html = self._page.html(folder.manifest, status=status, error=error)
                folder.write("report.html", html)
                folder.finish(status, error=error)

    def _note(self, folder: RunFolder, digest: str | None) -> None:
        entry = replace(folder.manifest.recording, sha256=digest)
        folder.update(recording=entry, timings=self._seconds)

    def _observe(self, event: object) -> None:
        if isinstance(event, StageStarted):
            self.stage = event.name
        elif isinstance(event, StageFinished):
            seconds = self._seconds.get(event.name, 0.0) + event.seconds
            self._seconds[event.name] = round(seconds, 4)


def _check_review(file: Path) -> None:
    """Raise `TablemapError` where the review lacks its end: that is written without a word."""
    from tablemap.review.viewer.viewer import is_whole

    if file.is_file() and not is_whole(file):
        raise TablemapError(
            "the review file could not be written to its end; free some space or choose "
            f"another --output: {file}"
        )


class _Digest:
    """The SHA-256 of a recording, computed beside the run; a run that is left waits for no more."""

    def __init__(self, recording: Input) -> None:
        self._found: str | BaseException | None = None
        self._thread = threading.Thread(
            target=self._compute, args=(recording,), name="sha256", daemon=True
        )

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def _compute(self, recording: Input) -> None:
        try:
            self._found = recording.sha256()
        except Exception as error:  # raised where it is asked for
            self._found = error

    def wait(self, seconds: float | None = None) -> str | None:
        """Return it, or None where it is not known in time; raises what reading has raised."""
        self._thread.join(seconds)
        if isinstance(self._found, BaseException):
            raise self._found
        return self._found


def _method(method: Method) -> Callable[..., Processed]:
    if method == "report":
        from tablemap.baseline.method import process as process_as_reported

        return process_as_reported
    from tablemap.pipeline import process

    return process
