"""``tablemap config``: every setting, or the schemas."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from tablemap.cli.options import ConfigFile, Debug, Json, Settings


def config(
    schema: Annotated[
        bool, typer.Option("--schema", help="JSON Schemas of settings and table.json instead.")
    ] = False,
    file: ConfigFile = None,
    settings: Settings = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Print every setting as TOML: the defaults, a file's and yours."""
    from tablemap.config import Config, dump_config, load_config
    from tablemap.model import json_schema

    if schema:
        schemas = {"config": Config.model_json_schema(), "table": json_schema()}
        typer.echo(json.dumps(schemas, indent=1))
        return
    resolved = load_config(file, overrides=settings or ())
    if as_json:
        typer.echo(json.dumps(resolved.model_dump(mode="json"), indent=1))
    else:
        typer.echo(dump_config(resolved), nl=False)
