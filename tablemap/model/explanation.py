"""A JSON Schema as one row a field, for people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any


def explained(schema: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Return the path, the type and the meaning of every field of a document, in its order.

    ``[]`` in a path stands for every entry of a list, ``.*`` for every name of a table.
    """
    return list(_fields("", schema, schema.get("$defs", {})))


def _fields(
    path: str, part: Mapping[str, Any], parts: Mapping[str, Any]
) -> Iterator[tuple[str, str, str]]:
    for name, field in part.get("properties", {}).items():
        here = f"{path}.{name}" if path else name
        kind, inner, suffix = _kind(field, parts)
        yield here, kind, str(field.get("description", ""))
        if inner is not None:
            yield from _fields(here + suffix, inner, parts)


def _kind(
    field: Mapping[str, Any], parts: Mapping[str, Any]
) -> tuple[str, Mapping[str, Any] | None, str]:
    """Return a field's type in words, the part below it, and how that is reached."""
    if "$ref" in field:
        return "object", parts[field["$ref"].rpartition("/")[2]], ""
    if "anyOf" in field:
        kinds = [_kind(each, parts) for each in field["anyOf"]]
        below = next((kind for kind in kinds if kind[1] is not None), ("", None, ""))
        return " or ".join(dict.fromkeys(kind for kind, _, _ in kinds)), below[1], below[2]
    if "enum" in field:
        return " | ".join(str(value) or '""' for value in field["enum"]), None, ""
    if "const" in field:
        return f'"{field["const"]}"', None, ""
    if field.get("type") == "array" and isinstance(field.get("items"), Mapping):
        kind, inner, suffix = _kind(field["items"], parts)
        return f"list of {kind}", inner, f"[]{suffix}"
    if field.get("type") == "object" and isinstance(field.get("additionalProperties"), Mapping):
        kind, inner, suffix = _kind(field["additionalProperties"], parts)
        return f"{kind} by name", inner, f".*{suffix}"
    return str(field.get("type", "any")), None, ""
