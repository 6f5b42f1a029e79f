"""``tablemap view``: a run in the Rerun Viewer."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from tablemap.cli.options import Json


def view(
    run: Annotated[
        Path,
        typer.Argument(help="Run folder, a recording's folder of runs, or an .rrd.", metavar="RUN"),
    ],
    web: Annotated[
        bool, typer.Option("--web", help="Serve it to a browser of this machine; print the URL.")
    ] = False,
    picture: Annotated[
        Path | None,
        typer.Option("--still", help="Write a picture, without a screen.", metavar="OUT.png"),
    ] = None,
    tab: Annotated[
        str | None,
        typer.Option(
            "--tab",
            help="Of the picture: Overview, Views, Odometry, Registration, Pairs, Surface, Legs "
            "or Timings.",
            metavar="NAME",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Open a RUN in the Rerun Viewer."""
    from tablemap.review.viewer import viewer

    if web and picture:
        raise typer.BadParameter("--web and --still exclude each other.")
    if tab and not picture:
        raise typer.BadParameter("--tab goes with --still.")
    if not viewer.is_whole(viewer.review_file(run)):
        typer.echo("The run was killed or goes on: this shows what it has written.", err=True)
    if picture:
        from tablemap.review.viewer.still import still

        for problem in still(run, picture, tab=tab or "Overview"):
            typer.echo(f"warning: {problem}", err=True)
        typer.echo(json.dumps({"picture": str(picture)}) if as_json else picture)
    elif web:
        with viewer.served(run) as (url, server):
            typer.echo(json.dumps({"url": url}) if as_json else url)
            server.wait()
    else:
        opened = viewer.open_viewer(run)
        if as_json:
            typer.echo(json.dumps({"pid": opened.pid}))
