"""``tablemap export``: a run's tables for other programs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from tablemap.cli import completing
from tablemap.cli.commands import Commands
from tablemap.cli.formats import ListsFormats
from tablemap.cli.options import ConfigFile, Json, check_output
from tablemap.cli.printing import complain, say

commands = Commands()


@commands.command(cls=ListsFormats)
def export(
    run: Annotated[str, typer.Argument(help="Run folder, or a table.json.", metavar="RUN")],
    formats: Annotated[
        list[str],
        typer.Option(
            "--to",
            help="One of the formats below; repeatable.",
            metavar="FORMAT",
            autocompletion=completing.formats,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Folder of the formats' folders, or a file such as table.glb; else RUN/exports.",
            metavar="PATH",
        ),
    ] = None,
    padding: Annotated[
        float | None,
        typer.Option("--padding", min=0, help="Round a keep-out area.", metavar="METRES"),
    ] = None,
    config: ConfigFile = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="An export setting; repeatable.",
            metavar="EXPORT.KEY=VALUE",
            autocompletion=completing.settings(below="export."),
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a RUN's tables in the formats of other programs."""
    from tablemap.config import load_config
    from tablemap.export import export_run

    check_output(run, output)
    overrides = [*(settings or ()), *([] if padding is None else [f"export.padding={padding}"])]
    resolved = load_config(config, overrides=overrides).export
    exported = export_run(run, formats, output=output, config=resolved)
    for warning in exported.warnings:
        complain(f"{warning.code}: {warning.message}", kind="warning")
    files = [str(file) for file in exported.files]
    if as_json:
        entries = [{"code": w.code, "message": w.message} for w in exported.warnings]
        say(json.dumps({"files": files, "warnings": entries}, indent=1))
    else:
        say("\n".join(files))
