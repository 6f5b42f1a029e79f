"""``tablemap runs``: the archive of run folders."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tablemap.cli.options import Debug, Json
from tablemap.cli.printing import (
    aligned,
    metres_text,
    outcome_line,
    print_model,
    size_text,
    stderr_console,
)
from tablemap.cli.process import process_one

if TYPE_CHECKING:
    from tablemap.archive import RunFolder
    from tablemap.archive.comparison import Comparison
    from tablemap.archive.index import RunRow

runs_app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)

Runs = Annotated[Path, typer.Argument(help="Folder of run folders.", metavar="DIR")]
Run = Annotated[Path, typer.Argument(help="Run folder.", metavar="RUN")]


@runs_app.command("list")
def list_(
    folder: Runs = Path("runs"),
    recording: Annotated[
        str, typer.Option("--recording", help="Recordings of this name.", metavar="PATTERN")
    ] = "*",
    shape: Annotated[
        list[str] | None, typer.Option("--shape", help="Only this shape; repeatable.")
    ] = None,
    status: Annotated[
        list[str] | None, typer.Option("--status", help="Only this status; repeatable.")
    ] = None,
    verdict: Annotated[
        list[str] | None, typer.Option("--verdict", help="Only this verdict; repeatable.")
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
    debug: Debug = False,
) -> None:
    """List the runs in DIR."""
    from tablemap.archive.index import list_runs
    from tablemap.archive.selection import Selection

    rows = Selection(
        recording=recording,
        shape=shape or (),
        status=status or (),
        verdict=verdict or (),
        since=since,
        until=until,
        where=where or (),
        sort=sort,
    ).of(list_runs(folder))
    if as_json:
        lines = ",\n".join(json.dumps(row.to_dict()) for row in rows)
        typer.echo(f"[\n{lines}\n]" if rows else "[]")
    elif as_csv:
        _print_csv(rows)
    elif rows:
        typer.echo(aligned(_run_rows(rows)))
    else:
        typer.echo(f"no such run in {folder}", err=True)


def _run_rows(rows: Sequence[RunRow]) -> Iterator[tuple[str, ...]]:
    yield ("started", "status", "verdict", "shape", "size", "height", "run")
    for row in rows:
        size, height = size_text(row.shape, row.figures), metres_text(row.figures.get("height"))
        begun = row.started[:19].replace("T", " ")
        yield (begun, row.status, row.verdict or "", row.shape or "", size, height, row.path)


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


@runs_app.command()
def show(run: Run, as_json: Json = False, debug: Debug = False) -> None:
    """Show what a RUN was made of, how it ended, and its model."""
    from tablemap.archive import load_run
    from tablemap.summary import summary_rows

    folder = load_run(run)
    manifest = folder.manifest
    model = folder.model if (folder.path / "table.json").is_file() else None
    if as_json:
        document = {
            "path": str(folder.path),
            "manifest": manifest.model_dump(mode="json", by_alias=True),
            "model": json.loads(model.to_json()) if model else None,
        }
        typer.echo(json.dumps(document, indent=1))
        return
    rows = [
        ("run", str(folder.path)),
        ("recording", manifest.recording.path),
        ("method", f"{manifest.method}, seed {manifest.seed}"),
        ("tablemap", manifest.versions.get("tablemap", "unknown")),
        ("started", manifest.started),
        ("seconds", f"{sum(manifest.timings.values()):.1f}"),
        ("status", manifest.status),
        *([("error", manifest.error)] if manifest.error else []),
        *(summary_rows(model) if model else []),
    ]
    typer.echo(aligned(rows))


@runs_app.command()
def compare(
    first: Annotated[Path, typer.Argument(help="Run folder.", metavar="A")],
    second: Annotated[Path, typer.Argument(help="Run folder.", metavar="B")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Write compare.svg and .rrd here.", metavar="DIR"),
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Show the models of A and B side by side, and their differences in sigmas."""
    from tablemap.archive import load_run
    from tablemap.archive.comparison import compare as compare_models

    a, b = load_run(first), load_run(second)
    compared = compare_models(a.model, b.model)
    if as_json:
        document = {"a": str(a.path), "b": str(b.path), **compared.to_dict()}
        typer.echo(json.dumps(document, indent=1))
    else:
        typer.echo(aligned(_comparison_rows(compared)))
    if output:
        for file in _draw(a, b, output):
            typer.echo(file, err=True)


def _comparison_rows(compared: Comparison) -> Iterator[tuple[str, ...]]:
    yield ("", "A", "B", "B - A", "sigma", "sigmas")
    for name, a, b in compared.words:
        yield (name, a, b, "" if a == b else "differs", "", "")
    for row in compared.figures:
        angle = row.name in ("yaw", "angle")
        values = [_degrees(x) if angle else metres_text(x) for x in (row.a, row.b)]
        apart = [
            _degrees(x) if angle else "" if x is None else f"{1000 * x:.1f} mm"
            for x in (row.difference, row.sigma)
        ]
        yield (row.name, *values, *apart, "" if row.sigmas is None else f"{row.sigmas:.1f}")
    if compared.overlap is not None and compared.farthest is not None:
        yield (
            "outlines",
            f"{compared.overlap:.1%} common",
            "",
            f"{1000 * compared.farthest:.1f} mm at most",
            "",
            "",
        )


def _degrees(value: float | None) -> str:
    import math

    return "" if value is None else f"{math.degrees(value):.2f} deg"


def _draw(a: RunFolder, b: RunFolder, output: Path) -> tuple[Path, Path]:
    from tablemap.archive.drawing import write_drawing
    from tablemap.review.overlay import write_overlay

    names = (f"{a.path.parent.name}/{a.path.name}", f"{b.path.parent.name}/{b.path.name}")
    drawing, overlay = output / "compare.svg", output / "compare.rrd"
    write_drawing(drawing, a.model, b.model, names=names)
    write_overlay(overlay, a.model, b.model, names=names, name=" and ".join(names))
    return drawing, overlay


@runs_app.command()
def verify(
    runs: Annotated[list[Path], typer.Argument(help="Run folders.", metavar="RUN")],
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Check that the RUNs and their recordings are what they were."""
    from dataclasses import asdict

    from tablemap.archive import load_run
    from tablemap.archive.verification import verify as verify_run

    failed = False
    for path in runs:
        run = load_run(path)
        checks = verify_run(run)
        failed |= not all(check.passed for check in checks)
        if as_json:
            document = {"run": str(run.path), "checks": [asdict(check) for check in checks]}
            typer.echo(json.dumps(document))
        else:
            typer.echo(run.path)
            rows = [(f"  {each.outcome}", each.name, each.detail or "") for each in checks]
            typer.echo(aligned(rows))
    raise typer.Exit(1 if failed else 0)


@runs_app.command()
def reprocess(
    run: Run,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="A setting to change; repeatable.", metavar="SECTION.KEY=VALUE"),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder of run folders; else RUN's.", metavar="DIR"),
    ] = None,
    as_json: Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors alone.")] = False,
    debug: Debug = False,
) -> None:
    """Process a RUN's recording again by its own settings, but for what is changed."""
    from rich.console import Console

    from tablemap.archive import load_run
    from tablemap.running import reprocess as process_again

    folder = load_run(run)
    outcome = process_one(
        Path(folder.manifest.recording.path),
        lambda progress: process_again(
            folder, output=output, overrides=settings or (), progress=progress
        ),
        quiet=quiet,
    )
    if as_json:
        typer.echo(json.dumps(outcome_line(outcome)))
    elif outcome.status == "failed":
        typer.echo(f"tablemap: {outcome.error}", err=True)
    if outcome.model and outcome.run and not quiet:
        console = stderr_console() if as_json else Console(highlight=False)
        print_model(outcome.model, outcome.run.path, console=console)
    raise typer.Exit({"failed": 1, "partial": 3}.get(outcome.status, 0))


@runs_app.command("prune")
def prune_(
    folder: Runs = Path("runs"),
    older_than: Annotated[
        float | None, typer.Option("--older-than", min=0, help="Begun so long ago.", metavar="DAYS")
    ] = None,
    status: Annotated[
        list[str] | None, typer.Option("--status", help="Only this status; repeatable.")
    ] = None,
    keep: Annotated[
        int | None, typer.Option("--keep", min=0, help="Hold each recording's newest.", metavar="N")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Remove them; else only list them.")] = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """List the runs in DIR that may go, and remove them with --yes."""
    from datetime import UTC, datetime, timedelta

    from tablemap.archive.index import list_runs
    from tablemap.archive.pruning import prune, to_prune

    going = to_prune(
        list_runs(folder),
        now=datetime.now(UTC),
        older_than=None if older_than is None else timedelta(days=older_than),
        status=status or (),
        keep=keep,
    )
    if yes:
        prune(folder, going)
    if as_json:
        typer.echo(json.dumps({"removed": yes, "runs": [row.path for row in going]}, indent=1))
        return
    for row in going:
        typer.echo(folder / row.path)
    said = "removed" if yes else "would go; --yes removes them"
    typer.echo(f"{len(going)} runs {said}", err=True)


@runs_app.command("pack")
def pack_(
    run: Run,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The file to write; else RUN.tar.zst.", metavar="FILE"),
    ] = None,
    with_input: Annotated[bool, typer.Option("--input", help="The recording too.")] = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Write a RUN into one file, to be unpacked elsewhere."""
    from tablemap.archive import load_run
    from tablemap.archive.packing import SUFFIX, pack

    folder = load_run(run)
    name = f"{folder.path.parent.name}-{folder.path.name}{SUFFIX}"
    file = pack(folder, output or Path(name), with_input=with_input)
    typer.echo(json.dumps({"file": str(file)}) if as_json else file)


@runs_app.command("unpack")
def unpack_(
    file: Annotated[Path, typer.Argument(help="What pack wrote.", metavar="FILE")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder of run folders.", metavar="DIR")
    ] = Path("runs"),
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Bring a packed run back as DIR/<recording>/<run>, checked."""
    from tablemap.archive.packing import unpack

    run = unpack(file, output)
    typer.echo(json.dumps({"run": str(run.path)}) if as_json else run.path)
