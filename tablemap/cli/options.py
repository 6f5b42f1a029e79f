"""Options that commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]
ConfigFile = Annotated[
    Path | None, typer.Option("--config", help="Settings in TOML.", metavar="FILE")
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", help="One setting; repeatable.", metavar="SECTION.KEY=VALUE"),
]
