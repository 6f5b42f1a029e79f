"""Options that commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tablemap.cli import completing
from tablemap.remote import is_remote

Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]
ConfigFile = Annotated[
    Path | None, typer.Option("--config", help="Settings in TOML.", metavar="FILE")
]
Strict = Annotated[bool, typer.Option("--strict", help="Exit with 4 where a model is doubtful.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors alone.")]
Start = Annotated[
    str | None,
    typer.Option(
        "--start",
        help="Start reading here: seconds from the beginning (-: before the end), or a date.",
        metavar="WHEN",
    ),
]
End = Annotated[
    str | None,
    typer.Option("--end", help="Stop reading here; given like --start.", metavar="WHEN"),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="One setting; repeatable.",
        metavar="SECTION.KEY=VALUE",
        autocompletion=completing.settings(),
    ),
]


def window(start: str | None, end: str | None) -> list[str]:
    """Return the settings of ``--start`` and ``--end``."""
    given = {"start": start, "end": end}
    return [f"topics.{name}={when}" for name, when in given.items() if when is not None]


def check_output(run: str, output: Path | None) -> None:
    """Refuse to write beside a run that is on a server: there is only a copy of it here."""
    if output is None and is_remote(run):
        raise typer.BadParameter("RUN is on a server: --output says where to write.")
