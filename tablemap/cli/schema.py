"""``tablemap schema``: what the fields of a document mean."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

import typer

from tablemap.cli.commands import Commands
from tablemap.cli.printing import aligned, say

commands = Commands()

Document = Literal["table", "truth", "manifest", "config"]


@commands.command()
def schema(
    document: Annotated[
        Document,
        typer.Argument(
            help="table, truth, manifest or config.", metavar="DOCUMENT", case_sensitive=False
        ),
    ] = "table",
    markdown: Annotated[
        bool, typer.Option("--markdown", help="Print a table in Markdown instead of columns.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the JSON Schema on stdout.")
    ] = False,
) -> None:
    """Explain every field of table.json, or of another DOCUMENT that is read or written."""
    found = schemas()[document]
    if as_json:
        say(json.dumps(found, indent=1))
        return
    from tablemap.model.explanation import explained

    rows = [("field", "type", "what it is"), *explained(found)]
    if not markdown:
        say(aligned(rows))
        return
    cells = [[cell.replace("|", "\\|") for cell in row] for row in rows]
    lines = [f"| {' | '.join(row)} |" for row in cells]
    say("\n".join([lines[0], "|---|---|---|", *lines[1:]]))


def schemas() -> dict[str, dict[str, Any]]:
    """Return the JSON Schemas of all documents by their names."""
    from tablemap.archive.manifest import SCHEMA as MANIFEST_SCHEMA
    from tablemap.archive.manifest import Manifest
    from tablemap.config import Config
    from tablemap.evaluation.truth import SCHEMA as TRUTH_SCHEMA
    from tablemap.evaluation.truth import Truth
    from tablemap.model import json_schema
    from tablemap.model.documents import document_schema
    from tablemap.schemas import json_schema as settings_schema

    return {
        "config": settings_schema(Config),
        "table": json_schema(),
        "truth": document_schema(Truth, TRUTH_SCHEMA, mode="validation"),
        "manifest": document_schema(Manifest, MANIFEST_SCHEMA, mode="serialization"),
    }
