"""Reading of JSON documents with a schema's name in them; errors are one sentence."""

from __future__ import annotations

import json
from typing import Any, Literal, TypeVar

from pydantic import BaseModel, ValidationError

from tablemap.errors import TablemapError
from tablemap.files import read_text
from tablemap.paths import AnyPath, as_place
from tablemap.words import shortened

Document = TypeVar("Document", bound=BaseModel)


def read_document(path: AnyPath, kind: type[Document], *, schema: str, noun: str) -> Document:
    """Read a file and parse its text with `parse_document`; errors end with the path."""
    file = as_place(path)
    try:
        text = read_text(file)
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise TablemapError(f"no {noun} can be read ({reason}): {file}") from error
    try:
        return parse_document(text, kind, schema=schema, noun=noun)
    except TablemapError as error:
        raise TablemapError(f"{str(error).removesuffix('.')}: {file}") from error


def document_schema(
    kind: type[BaseModel], schema: str, *, mode: Literal["serialization", "validation"]
) -> dict[str, object]:
    """Return the JSON Schema of a document; fields that it does not name are allowed.

    ``mode``: ``serialization`` for documents that we write, ``validation`` for those of others.
    """
    found = kind.model_json_schema(mode=mode)
    name = {"const": schema, "description": "name of this schema"}
    found["properties"] = {"schema": name, **found["properties"]} | {"schema": name}
    found["required"] = list(dict.fromkeys(["schema", *found["required"]]))
    return found


def parse_document(text: str, kind: type[Document], *, schema: str, noun: str) -> Document:
    """Return the document in a JSON text; unknown fields are ignored.

    ``noun`` names the document in errors. Raises `TablemapError` if the text is no such document,
    or has another schema.
    """
    try:
        document: Any = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise TablemapError(f"expected a {noun} in JSON, found other text ({error}).") from error
    found = document.get("schema") if isinstance(document, dict) else None
    if found != schema:
        raise TablemapError(
            f"expected a {noun} of schema {schema!r}, found {shortened(repr(found))}; use the "
            "version that wrote it."
        )
    try:
        return kind.model_validate(document)
    except ValidationError as error:
        raise damage(error, noun) from error


def damage(error: ValidationError, noun: str) -> TablemapError:
    """Return the error for the first fault in a document."""
    first = error.errors()[0]
    where = shortened(".".join(str(part) for part in first["loc"]))
    return TablemapError(f"the {noun} is damaged at {where}: {shortened(first['msg'])}.")
