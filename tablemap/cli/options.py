"""Options that commands share."""

from __future__ import annotations

from typing import Annotated

import typer

Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]
