"""What commands on run folders have in common."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tablemap.cli import completing

Runs = Annotated[Path, typer.Argument(help="Folder of run folders.", metavar="DIR")]
Statuses = Annotated[
    list[str] | None,
    typer.Option(
        "--status",
        help="Only this status; repeatable.",
        metavar="STATUS",
        autocompletion=completing.statuses,
    ),
]
Run = Annotated[str, typer.Argument(help="Run folder.", metavar="RUN")]
