"""``tablemap view``: a run, or a recording as it is, in the Rerun Viewer."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import Annotated

import typer

from tablemap.cli import completing
from tablemap.cli.commands import Commands
from tablemap.cli.options import End, Json, Start, window
from tablemap.cli.printing import complain, say

commands = Commands()

_MOST_PIXELS = 8192  # a side, of what drivers draw


@commands.command()
def view(
    run: Annotated[
        str,
        typer.Argument(
            help="Run folder, a recording's folder of runs, an .rrd; or a recording: its raw log.",
            metavar="RUN",
        ),
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
            autocompletion=completing.tabs,
        ),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option("--size", help="Of the picture, in pixels.", metavar="WIDTHxHEIGHT"),
    ] = None,
    start: Start = None,
    end: End = None,
    as_json: Json = False,
) -> None:
    """Open a RUN in the Rerun Viewer, or the raw log of a recording."""
    from tablemap.review.viewer import viewer

    if web and picture:
        raise typer.BadParameter("--web and --still exclude each other.")
    if tab and not picture:
        raise typer.BadParameter("--tab goes with --still.")
    if size and not picture:
        raise typer.BadParameter("--size goes with --still.")
    if picture and picture.suffix.lower() != ".png":
        raise typer.BadParameter(f"--still writes a .png, found {picture.name}.")
    pixels = _pixels(size or "1000x700")
    is_review = viewer.is_review(run)
    if is_review and (start or end):
        raise typer.BadParameter("--start and --end go with a recording.")
    with ExitStack() as kept:
        if is_review:
            file = viewer.review_file(run)
            if viewer.is_cut(file):
                say("The run was killed or goes on: this shows what it has written.", err=True)
        else:
            # The viewer reads the file after this program has ended.
            folder = (
                kept.enter_context(TemporaryDirectory(prefix="tablemap-"))
                if web or picture
                else mkdtemp(prefix="tablemap-")
            )
            file = _raw(run, Path(folder), window(start, end))
        _show(file, web=web, picture=picture, tab=tab, size=pixels, as_json=as_json)


def _raw(recording: str, folder: Path, part: list[str]) -> Path:
    """Write the raw log of a recording as an .rrd, and say what of it was lost."""
    from tablemap.config import load_config
    from tablemap.review.raw import write_raw

    config = load_config(overrides=part)
    file, warnings = write_raw(recording, folder, topics=config.topics, limits=config.limits)
    for warning in warnings:
        complain(f"{warning.code}: {warning.message}", kind="warning")
    return file


def _show(
    run: Path,
    *,
    web: bool,
    picture: Path | None,
    tab: str | None,
    size: tuple[int, int],
    as_json: bool,
) -> None:
    """Draw an .rrd as a picture, serve it to a browser, or open it."""
    from tablemap.review.viewer import viewer

    if picture:
        from tablemap.review.viewer.still import still

        for problem in still(run, picture, tab=tab or "Overview", size=size):
            complain(problem, kind="warning")
        say(json.dumps({"picture": str(picture)}) if as_json else picture)
    elif web:
        with viewer.served(run) as (url, server):
            say(json.dumps({"url": url}) if as_json else url)
            server.wait()
    else:
        opened = viewer.open_viewer(run)
        if as_json:
            say(json.dumps({"pid": opened.pid}))


def _pixels(size: str) -> tuple[int, int]:
    width, _, height = size.lower().partition("x")
    if width.isdecimal() and height.isdecimal():
        pixels = int(width), int(height)
        if all(100 <= side <= _MOST_PIXELS for side in pixels):
            return pixels
    raise typer.BadParameter(
        f"expected --size WIDTHxHEIGHT of 100 to {_MOST_PIXELS} pixels, such as 1600x1000; "
        f"found {size}."
    )
