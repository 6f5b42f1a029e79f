"""``tablemap runs pack``, ``unpack`` and ``serve``: runs for other machines."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from tablemap.cli.commands import Commands
from tablemap.cli.options import Json, check_output
from tablemap.cli.printing import complain, say
from tablemap.cli.runs.arguments import Run, Runs
from tablemap.words import counted

commands = Commands()


@commands.command("pack")
def pack_(
    run: Run,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The file to write; else RUN.tar.zst.", metavar="FILE"),
    ] = None,
    with_input: Annotated[bool, typer.Option("--input", help="The recording too.")] = False,
    as_json: Json = False,
) -> None:
    """Write a RUN into one file, to be unpacked elsewhere."""
    from tablemap.archive.packing import pack

    check_output(run, output)
    file = pack(run, output, with_input=with_input)
    say(json.dumps({"file": str(file)}) if as_json else file)


@commands.command("unpack")
def unpack_(
    file: Annotated[Path, typer.Argument(help="What pack wrote.", metavar="FILE")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder of run folders.", metavar="DIR")
    ] = Path("runs"),
    limit: Annotated[
        float, typer.Option("--limit", min=0, help="Unpack no more than this.", metavar="GB")
    ] = 64,
    as_json: Json = False,
) -> None:
    """Bring a packed run back as DIR/<recording>/<run>, checked."""
    from tablemap.archive.packing import unpack

    run = unpack(file, output, most_bytes=int(min(limit, 1e9) * 1e9))
    say(json.dumps({"run": str(run.path)}) if as_json else run.path)


@commands.command("serve")
def serve_(
    folder: Runs = Path("runs"),
    port: Annotated[
        int,
        typer.Option(
            "--port", min=0, max=65535, help="Where to listen; 0: any free port.", metavar="PORT"
        ),
    ] = 51234,
    host: Annotated[
        str,
        typer.Option(
            "--host", help="Who may connect; 0.0.0.0: other machines too.", metavar="HOST"
        ),
    ] = "127.0.0.1",
    as_json: Json = False,
) -> None:
    """Serve the runs in DIR as a Rerun catalog, until it is interrupted."""
    import threading

    from tablemap.review.viewer.catalog import DATASET, served_catalog

    with served_catalog(folder, host=host, port=port) as catalog:
        for note in catalog.notes:
            complain(note, kind="note")
        if as_json:
            document = {"url": catalog.url, "dataset": DATASET, "runs": catalog.runs}
            say(json.dumps(document))
        else:
            say(catalog.url)
        runs = counted(catalog.runs, "run")
        say(f"{runs}; open them with: rerun {catalog.url}; or ask in Python:", err=True)
        code = f'CatalogClient("{catalog.url}").get_dataset("{DATASET}").segment_table()'
        say(f"  from rerun.catalog import CatalogClient\n  {code}", err=True)
        sys.stdout.flush()
        threading.Event().wait()
