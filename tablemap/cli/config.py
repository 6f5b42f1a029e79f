"""``tablemap config``: every setting, or the schemas."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from tablemap.cli.options import ConfigFile, Json, Settings
from tablemap.cli.printing import say


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
    from tablemap.archive.manifest import SCHEMA as MANIFEST_SCHEMA
    from tablemap.archive.manifest import Manifest
    from tablemap.config import Config, explain_config, load_config
    from tablemap.evaluation.truth import SCHEMA as TRUTH_SCHEMA
    from tablemap.evaluation.truth import Truth
    from tablemap.model import json_schema
    from tablemap.model.documents import document_schema

    if schema:
        schemas = {
            "config": Config.model_json_schema(),
            "table": json_schema(),
            "truth": document_schema(Truth, TRUTH_SCHEMA, mode="validation"),
            "manifest": document_schema(Manifest, MANIFEST_SCHEMA, mode="serialization"),
        }
        say(json.dumps(schemas, indent=1))
        return
    resolved = load_config(file, overrides=settings or ())
    if as_json:
        say(json.dumps(resolved.model_dump(mode="json"), indent=1))
    else:
        say(explain_config(resolved), nl=False)
