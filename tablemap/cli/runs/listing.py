"""``tablemap runs list``: the runs of a folder."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from tablemap.cli import completing
from tablemap.cli.commands import Commands
from tablemap.cli.options import Json
from tablemap.cli.printing import aligned, metres_text, say, size_text
from tablemap.cli.runs.arguments import Statuses
from tablemap.words import shortened

if TYPE_CHECKING:
    from tablemap.archive.index import RunRow

commands = Commands()


MOST_OF_ERROR = 90
"""Letters of a run's error that fit beside its other columns; `runs show` has all of it."""


@commands.command("list")
def list_(
    folder: Annotated[
        str, typer.Argument(help="Folder of run folders, or s3://BUCKET/RUNS.", metavar="DIR")
    ] = "runs",
    recording: Annotated[
        str, typer.Option("--recording", help="Recordings of this name.", metavar="PATTERN")
    ] = "*",
    shape: Annotated[
        list[str] | None,
        typer.Option(
            "--shape",
            help="Only this shape; repeatable.",
            metavar="SHAPE",
            autocompletion=completing.shapes,
        ),
    ] = None,
    status: Statuses = None,
    verdict: Annotated[
        list[str] | None,
        typer.Option(
            "--verdict",
            help="Only this verdict; repeatable.",
            metavar="VERDICT",
            autocompletion=completing.verdicts,
        ),
    ] = None,
    since: Annotated[
        str | None, typer.Option("--since", help="Begun then or later (UTC).", metavar="DATE")
    ] = None,
    until: Annotated[
        str | None, typer.Option("--until", help="Begun then or before (UTC).", metavar="DATE")
    ] = None,
    where: Annotated[
        list[str] | None,
        typer.Option("--where", help="Such as 'height<0.7'; repeatable.", metavar="CONDITION"),
    ] = None,
    sort: Annotated[
        str, typer.Option("--sort", help="A column or a figure; -KEY reverses.", metavar="KEY")
    ] = "started",
    as_json: Json = False,
    as_csv: Annotated[
        bool, typer.Option("--csv", help="Print all columns and figures as CSV.")
    ] = False,
) -> None:
    """List the runs in DIR."""
    from tablemap.archive.index import list_runs
    from tablemap.archive.selection import Selection

    found = list_runs(folder)
    rows = Selection(
        recording=recording,
        shape=shape or (),
        status=status or (),
        verdict=verdict or (),
        since=since,
        until=until,
        where=where or (),
        sort=sort,
    ).of(found)
    if as_json:
        lines = ",\n".join(json.dumps(row.to_dict()) for row in rows)
        say(f"[\n{lines}\n]" if rows else "[]")
    elif as_csv:
        _print_csv(rows)
    elif rows:
        say(aligned(_run_rows(rows)))
    else:
        say(f"no {'such ' if found else ''}run in {folder}", err=True)


def _run_rows(rows: Sequence[RunRow]) -> Iterator[tuple[str, ...]]:
    failed = any(row.error for row in rows)
    header = ("started", "status", "verdict", "shape", "size", "height", "run")
    yield (*header, "error") if failed else header
    for row in rows:
        size, height = size_text(row.shape, row.figures), metres_text(row.figures.get("height"))
        begun = row.started[:19].replace("T", " ")
        cells = (begun, row.status, row.verdict or "", row.shape or "", size, height, row.path)
        error = shortened(" ".join((row.error or "").split()), most=MOST_OF_ERROR)
        yield (*cells, error) if failed else cells


def _print_csv(rows: Sequence[RunRow]) -> None:
    import csv

    words = ["path", "recording", "run", "started", "status", "method"]
    words += ["shape", "verdict", "error"]
    figures = sorted({name for row in rows for name in row.figures})
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow([*words, *figures])
    for row in rows:
        texts = [getattr(row, name) for name in words]
        writer.writerow([*texts, *(row.figures.get(name) for name in figures)])
