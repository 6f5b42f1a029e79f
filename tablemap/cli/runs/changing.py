"""``tablemap runs reprocess``, ``redraw`` and ``prune``: runs made anew, and removal of runs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from tablemap.cli import completing
from tablemap.cli.commands import Commands
from tablemap.cli.options import Json, Quiet, Strict, check_output
from tablemap.cli.printing import (
    complain,
    exit_code,
    outcome_line,
    print_left,
    print_model,
    say,
    stderr_console,
    stdout_console,
)
from tablemap.cli.process import process_one
from tablemap.cli.runs.arguments import Run, Runs, Statuses
from tablemap.words import counted

commands = Commands()


@commands.command()
def reprocess(
    run: Run,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="A setting to change; repeatable.",
            metavar="SECTION.KEY=VALUE",
            autocompletion=completing.settings(),
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder of run folders; else RUN's.", metavar="DIR"),
    ] = None,
    as_json: Json = False,
    strict: Strict = False,
    quiet: Quiet = False,
) -> None:
    """Process a RUN's recording again by its own settings, but for what is changed."""
    from tablemap.archive import load_run
    from tablemap.runs.running import reprocess as process_again

    check_output(run, output)
    folder = load_run(run)
    outcome = process_one(
        folder.manifest.recording.input,
        lambda progress: process_again(
            folder, output=output, overrides=settings or (), progress=progress
        ),
        quiet=quiet,
    )
    if as_json:
        say(json.dumps(outcome_line(outcome)))
    elif outcome.status == "failed":
        complain(outcome.error)
        if outcome.run and not quiet:
            print_left(outcome.run.path, console=stdout_console())
    if outcome.model and outcome.run and not quiet:
        console = stderr_console() if as_json else stdout_console()
        path, others = outcome.run.path, outcome.others
        print_model(outcome.model, path, console=console, others=others)
    raise typer.Exit(exit_code([outcome], strict=strict))


@commands.command("redraw")
def redraw_(run: Run) -> None:
    """Make the run.rrd of a RUN anew from the results that it keeps, without its recording."""
    from tablemap.runs.redrawing import left_out, redraw

    say(redraw(run))
    if lacks := left_out(run):
        complain(lacks, kind="note")


@commands.command("prune")
def prune_(
    folder: Runs = Path("runs"),
    older_than: Annotated[
        float | None,
        typer.Option("--older-than", min=0, help="Begun more than DAYS days ago.", metavar="DAYS"),
    ] = None,
    status: Statuses = None,
    keep: Annotated[
        int | None,
        typer.Option("--keep", min=0, help="Keep the newest N that have a model.", metavar="N"),
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Remove them; else only list them.")] = False,
    as_json: Json = False,
) -> None:
    """List the runs in DIR that may go, and remove them with --yes; never a recording's latest."""
    from datetime import UTC, datetime, timedelta

    from tablemap.archive.index import list_runs
    from tablemap.archive.pruning import named_latest, prune, to_prune

    try:
        age = None if older_than is None else timedelta(days=older_than)
    except (ValueError, OverflowError) as error:
        raise typer.BadParameter(f"{older_than} days is no age of a run.") from error
    going = to_prune(
        list_runs(folder),
        now=datetime.now(UTC),
        older_than=age,
        status=status or (),
        keep=keep,
        latest=named_latest(folder),
    )
    if yes:
        prune(folder, going)
    if as_json:
        say(json.dumps({"removed": yes, "runs": [row.path for row in going]}, indent=1))
        return
    for row in going:
        say(folder / row.path)
    said = "removed" if yes else "would be removed; --yes removes them"
    say(f"{counted(len(going), 'run')} {said}", err=True)
