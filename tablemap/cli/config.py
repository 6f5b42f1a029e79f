"""``tablemap config``: every setting, or the schemas."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from tablemap.cli.commands import Commands
from tablemap.cli.options import ConfigFile, Json, Settings
from tablemap.cli.printing import say

commands = Commands()


@commands.command()
def config(
    schema: Annotated[
        bool,
        typer.Option(
            "--schema", help="JSON Schemas of settings, table.json, truth and manifest instead."
        ),
    ] = False,
    file: ConfigFile = None,
    settings: Settings = None,
    as_json: Json = False,
) -> None:
    """Print every setting as TOML, with what it is: the defaults, a file's and yours."""
    if schema:
        from tablemap.cli.schema import schemas

        say(json.dumps(schemas(), indent=1))
        return
    from msgspec import to_builtins

    from tablemap.config import explain_config, load_config

    resolved = load_config(file, overrides=settings or ())
    if as_json:
        say(json.dumps(to_builtins(resolved), indent=1))
    else:
        say(explain_config(resolved), nl=False)
