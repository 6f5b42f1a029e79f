"""``tablemap process``: recordings in, run folders out."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager, nullcontext
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from tablemap import words
from tablemap.cli import completing
from tablemap.cli.commands import Commands
from tablemap.cli.formats import ListsFormats
from tablemap.cli.options import ConfigFile, End, Quiet, Settings, Start, Strict, window
from tablemap.cli.printing import (
    Ends,
    aligned,
    complain,
    hung,
    outcome_line,
    print_left,
    print_model,
    say,
    stderr_console,
    stdout_console,
    wide,
)
from tablemap.errors import TablemapError

if TYPE_CHECKING:
    from tablemap.archive.publishing import Destination
    from tablemap.config import Config
    from tablemap.events import StageStarted
    from tablemap.inputs import Input
    from tablemap.runs.jobs import Job, Progress
    from tablemap.runs.running import Follow, Outcome

commands = Commands()


@commands.command(cls=ListsFormats)
def process(
    recordings: Annotated[
        list[str],
        typer.Argument(
            help="MCAPs, bags and bags' folders; globs of them, or @list.txt.",
            metavar="RECORDING...",
        ),
    ],
    output: Annotated[
        str, typer.Option("--output", "-o", help="Folder of run folders.", metavar="DIR")
    ] = "runs",
    config: ConfigFile = None,
    settings: Settings = None,
    start: Start = None,
    end: End = None,
    together: Annotated[
        bool, typer.Option("--together", help="The RECORDINGs are files of one drive.")
    ] = False,
    near: Annotated[
        tuple[float, float] | None,
        typer.Option("--near", help="The table nearest to this place in the map.", metavar="X Y"),
    ] = None,
    every_table: Annotated[
        bool, typer.Option("--all", help="Model every table; the others go to tables/NN.json.")
    ] = False,
    method: Annotated[
        Literal["tablemap", "report"] | None,
        typer.Option(
            "--method",
            help="tablemap's method, or the bachelor report's, as the baseline.",
            case_sensitive=False,
        ),
    ] = None,
    formats: Annotated[
        list[str] | None,
        typer.Option(
            "--export",
            help="Write exports/FORMAT (below) too; repeatable.",
            metavar="FORMAT",
            autocompletion=completing.formats,
        ),
    ] = None,
    jobs: Annotated[
        int, typer.Option("--jobs", "-j", min=1, help="Recordings processed at once.", metavar="N")
    ] = 1,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", help="Process on this Dask cluster.", metavar="ADDRESS"),
    ] = None,
    again: Annotated[
        bool, typer.Option("--again", help="Process even if DIR has the same run already.")
    ] = False,
    level: Annotated[
        Literal["standard", "full", "off"] | None,
        typer.Option(
            "--review",
            help="What run.rrd carries: every image, or the model alone.",
            case_sensitive=False,
        ),
    ] = None,
    live: Annotated[
        bool, typer.Option("--live", help="Show the run in the Rerun Viewer while it goes on.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON line a recording on stdout.")
    ] = False,
    strict: Strict = False,
    quiet: Quiet = False,
) -> None:
    """Model the table in each RECORDING; every step goes into DIR/<recording>/<run>/run.rrd."""
    from tablemap.archive.publishing import destination
    from tablemap.config import load_config
    from tablemap.runs import Job, expand

    if every_table and near is not None:
        raise typer.BadParameter("--near and --all exclude each other.")
    if scheduler and (jobs > 1 or live):
        raise typer.BadParameter("--scheduler excludes --jobs and --live.")
    chosen = [
        *window(start, end),
        *([f"review.level={level}"] if level else []),
        *([f"method={method}"] if method else []),
        *(["tables=all"] if every_table else []),
        *([f"tables=[{near[0]!r}, {near[1]!r}]"] if near else []),
    ]
    resolved = load_config(config, overrides=[*(settings or ()), *chosen])
    if formats:
        from tablemap.export import check_formats

        check_formats(formats)
    complete = True
    paths = expand(recordings, together=together)
    many = _many(scheduler, jobs)
    with destination(output) as place:
        if scheduler and place.is_remote:
            raise typer.BadParameter("--scheduler needs an --output that its workers can see.")
        ends = Ends(strict=strict, address=place.address)
        job = Job(place.folder, resolved, follow=_follow(live=live))
        outcomes = closing(_outcomes(paths, job, many, again=again, quiet=quiet))
        is_told = len(paths) > 1 and not quiet and not place.is_remote
        with _left_at_an_end(paths, place.folder) if is_told else nullcontext(), outcomes as found:
            for outcome in found:
                ends.add(outcome)
                run = outcome.run.path if outcome.run else None
                if outcome.model and run and formats:
                    complete &= _export_processed(run, formats, resolved, quiet=quiet)
                if run:
                    complete &= _publish(place, run)
                if as_json:
                    say(json.dumps(outcome_line(outcome, place.address)))
                elif outcome.error and outcome.status == "failed":
                    complain(_named(outcome, among=len(paths)))
                if run and not quiet and len(paths) == 1:
                    shown = place.address(run) if place.is_remote else run
                    _print_outcome(outcome, shown, as_json=as_json)
    if len(paths) > 1 and not quiet:
        say(aligned(ends.rows), err=as_json)
        columns = wide(sys.stderr if as_json else sys.stdout)
        for line in ends.lines:
            say("\n".join(hung("", line, columns)), err=as_json)
    raise typer.Exit(ends.code if complete else 1)


@contextmanager
def _left_at_an_end(paths: list[Input], folder: Path) -> Iterator[None]:
    """Print which folders several recordings left, and how they ended, on an interruption."""
    from tablemap.runs.jobs import runs_of

    begun = datetime.now(UTC).isoformat(timespec="seconds")
    try:
        yield
    except KeyboardInterrupt:
        runs = [run for path in paths for run in runs_of(path, folder)]
        rows = [
            (run.manifest.status, str(run.path)) for run in runs if run.manifest.started >= begun
        ]
        if rows:
            say(aligned(rows), err=True)
            say("open one  tablemap view RUN", err=True)
        raise


def _print_outcome(outcome: Outcome, run: Path | str, *, as_json: bool) -> None:
    """Print the only run's model, or where a failed one lies that got as far as a stage."""
    if outcome.model:
        console = stderr_console() if as_json else stdout_console()
        print_model(outcome.model, run, console=console, others=outcome.others)
    elif outcome.run and outcome.run.manifest.timings and not as_json:
        print_left(run, console=stdout_console())


def _named(outcome: Outcome, *, among: int) -> str:
    """Return a failed outcome's sentence; of several recordings it says whose it is."""
    error = outcome.error or ""
    name = outcome.recording.name
    return error if among == 1 or name in error else f"{name}: {error}"


def _follow(*, live: bool) -> Follow:
    """Return the function that shows a run live; a missing viewer is a warning on stderr."""
    if live:
        from tablemap.review.viewer.live import followed, start_viewer

        try:
            start_viewer()
        except TablemapError as error:
            complain(f"nothing is shown live: {error}", kind="warning")
        else:
            return followed
    return nullcontext


def _publish(place: Destination, run: Path) -> bool:
    """Put an ended run where it is to be; return False, with the reason on stderr, on failure."""
    try:
        place.publish(run)
    except TablemapError as error:
        complain(error)
        return False
    return True


def _export_processed(run: Path, formats: list[str], config: Config, *, quiet: bool) -> bool:
    """Write a new run's exports; return False, with the reason on stderr, if this fails."""
    from tablemap.export import export_run

    try:
        exported = export_run(run, formats, config=config.export)
    except TablemapError as error:
        complain(error)
        return False
    if not quiet:
        for warning in exported.warnings:
            complain(f"{warning.code}: {warning.message}", kind="warning")
    return True


Many = Callable[[list["Input"], "Job", "Progress"], Iterator["Outcome"]]


def _many(scheduler: str | None, jobs: int) -> Many | None:
    """Return the function that processes recordings in parallel; None to process one by one."""
    if scheduler:
        from tablemap.runs.cluster import process_on_cluster

        return partial(
            process_on_cluster,
            address=scheduler,
            warn=partial(complain, kind="warning"),
        )
    if jobs > 1:
        from tablemap.runs import process_many

        return partial(process_many, jobs=jobs)
    return None


def _outcomes(
    recordings: list[Input], job: Job, many: Many | None, *, again: bool, quiet: bool
) -> Generator[Outcome]:
    """Return existing runs of recordings that are done already; process the others."""
    from tablemap.imports import keep_memory
    from tablemap.runs import done_already
    from tablemap.runs.running import Outcome

    waiting = []
    for recording in recordings:
        try:
            held = None if again else done_already(recording, job)
        except TablemapError:  # what is wrong with it is said when it is processed
            held = None
        if held is None:
            waiting.append(recording)
            continue
        if not quiet:
            say(
                f"{words.shown(recording)} is done already; --again processes it once more",
                err=True,
            )
        status: Literal["ok", "partial"] = "partial" if held.manifest.status == "partial" else "ok"
        yield Outcome(recording, held, status, held.manifest.error, held.model, held.others)
    if many and waiting:
        yield from _at_once(waiting, job, many, quiet=quiet)
        return
    keep_memory()
    for recording in waiting:
        try:
            yield process_one(recording, partial(job, recording), quiet=quiet)
        except TablemapError:
            raise  # of what was asked for, and so of every recording
        except Exception as error:  # a defect met by one recording must not stop the others
            if len(recordings) == 1:
                raise
            yield Outcome.of_defect(recording, error)


def _at_once(recordings: list[Input], job: Job, many: Many, *, quiet: bool) -> Iterator[Outcome]:
    """Process with a bar on stderr that counts the recordings and names the current stages."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}", markup=False))
    console = stderr_console()
    hidden = quiet or not console.is_terminal
    with Progress(
        *columns, TimeElapsedColumn(), console=console, transient=True, disable=hidden
    ) as bar:
        task = bar.add_task("", total=len(recordings))

        def progress(path: Input, stage: StageStarted) -> None:
            bar.update(task, description=words.shown(f"{path.name} {stage.name}"))

        for outcome in many(recordings, job, progress):
            bar.advance(task)
            yield outcome


def process_one(
    path: Input, process_to: Callable[[Callable[[object], None]], Outcome], *, quiet: bool
) -> Outcome:
    """Run the given function with a progress bar that names the stage."""
    from tablemap.events import StageStarted, ignore
    from tablemap.runs.running import InterruptedRun

    if quiet:
        return process_to(ignore)
    try:
        with _progress(path.name) as advance:

            def progress(event: object) -> None:
                if isinstance(event, StageStarted):
                    advance(event.name, event.index)

            return process_to(progress)
    except InterruptedRun as stop:
        print_left(stop.run, console=stderr_console())
        raise


@contextmanager
def _progress(name: str) -> Iterator[Callable[[str, int], None]]:
    """Show a bar on stderr that names the stage; the given function moves it on."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from tablemap.pipeline import STAGES

    columns = (
        TextColumn("{task.fields[recording]}", markup=False),
        BarColumn(),
        TextColumn("{task.description}", markup=False),
    )
    console = stderr_console()
    with Progress(
        *columns,
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task("opening", total=len(STAGES), recording=words.shown(name))
        yield lambda stage, index: bar.update(task, description=stage, completed=index)
