"""Settings and documents are structs of msgspec: what checks their values."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Annotated, Any, get_args, get_origin

from msgspec import Struct, ValidationError, convert
from msgspec.structs import FieldInfo, fields


@cache
def fields_of(kind: type[Struct]) -> dict[str, FieldInfo]:
    """Return the fields of a kind of structs by name."""
    return {field.name: field for field in fields(kind)}


def checked(value: object, kind: Any, *, strict: bool = True) -> Any:
    """Return a value as an annotation has it; NumPy's numbers become Python's.

    Where the annotation has ``extra={"read": function}``, the function takes the value first.
    Raises `msgspec.ValidationError`, and what the function raises. Unless ``strict``, numbers may
    be given as text.
    """
    for read in reads(kind):
        value = read(value)
    try:
        return convert(value, kind, strict=strict)
    except ValidationError:
        return convert(_plain(value), kind, strict=strict)


def reads(kind: Any) -> list[Callable[[Any], Any]]:
    """Return the functions that an annotation has a value taken by: ``extra={"read": ...}``."""
    metas = get_args(kind)[1:] if get_origin(kind) is Annotated else ()
    return [meta.extra["read"] for meta in metas if "read" in (meta.extra or {})]


def _plain(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    return value.tolist() if hasattr(value, "tolist") else value
