"""``tablemap convert``: recordings in, one MCAP with what processing needs out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from tablemap.cli.commands import Commands
from tablemap.cli.options import ConfigFile, End, Json, Settings, Start, window
from tablemap.cli.printing import complain, say, stderr_console

commands = Commands()


@commands.command()
def convert(
    recordings: Annotated[
        list[str],
        typer.Argument(help="A recording, or all files of one drive.", metavar="RECORDING..."),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The MCAP to write.", metavar="OUT.mcap")
    ],
    start: Start = None,
    end: End = None,
    colour: Annotated[
        bool, typer.Option("--colour/--no-colour", help="Keep the colour images.")
    ] = True,
    config: ConfigFile = None,
    settings: Settings = None,
    as_json: Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors alone.")] = False,
) -> None:
    """Write what processing needs of a drive as one MCAP that gives the same table."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from tablemap.config import load_config
    from tablemap.recording import convert as convert_recording

    resolved = load_config(config, overrides=[*(settings or ()), *window(start, end)])
    console = stderr_console()
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn())
    hidden = quiet or not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=hidden) as bar:
        task = bar.add_task(output.name, total=1.0)
        done = convert_recording(
            recordings,
            output,
            topics=resolved.topics,
            limits=resolved.limits,
            colour=colour,
            progress=lambda share: bar.update(task, completed=share),
        )
    if as_json:
        document = {
            "output": str(done.path),
            "size_bytes": done.size_bytes,
            "topics": done.topics,
            "warnings": [{"code": each.code, "message": each.message} for each in done.warnings],
        }
        say(json.dumps(document, indent=1))
        return
    if not quiet:
        for warning in done.warnings:
            complain(f"{warning.code}: {warning.message}", kind="warning")
        for topic, count in sorted(done.topics.items()):
            say(f"{count:8} {topic}", err=True)
        say(f"{done.path} ({done.size_bytes / 1e6:.1f} MB)")
