"""JSON Schemas of settings and documents."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from typing import Annotated, Any, Literal, get_args, get_origin

from msgspec import Struct, json
from msgspec.structs import fields

MOST = sys.float_info.max
"""The largest finite number: a bound that says no more than that a number is finite."""


def json_schema(kind: type[Struct]) -> dict[str, Any]:
    """Return the JSON Schema of a kind of objects; choices stand as they are written there.

    A field whose annotation has ``extra={"names": names}`` is one of these names.
    """
    found = json.schema(kind)
    for each in _structs(kind):
        properties = found["$defs"][each.__name__]["properties"]
        for field in fields(each):
            metas = get_args(field.type)[1:] if get_origin(field.type) is Annotated else ()
            for names in (meta.extra["names"] for meta in metas if "names" in (meta.extra or {})):
                properties[field.encode_name]["enum"] = list(names)
    top = found["$defs"].pop(kind.__name__)
    parts = {"$defs": found["$defs"]} if found["$defs"] else {}
    orders = {frozenset(order): list(order) for order in choices(kind)}
    return dict(_in_order({**top, **parts}, orders))


def choices(kind: Any) -> Iterator[tuple[object, ...]]:
    """Yield the values of every choice in a type and below it."""
    return (get_args(part) for part in _parts(kind) if get_origin(part) is Literal)


def _structs(kind: Any) -> Iterator[type[Struct]]:
    return (part for part in _parts(kind) if isinstance(part, type) and issubclass(part, Struct))


def _parts(kind: Any) -> Iterator[Any]:
    """Yield a type and all types in it."""
    yield kind
    if isinstance(kind, type) and issubclass(kind, Struct):
        below: Iterable[Any] = (field.type for field in fields(kind))
    else:
        below = () if get_origin(kind) is Literal else get_args(kind)
    for part in below:
        yield from _parts(part)


def _in_order(part: Any, orders: dict[frozenset[object], list[object]]) -> Any:
    """Return a part of a schema; each choice has the order of those with the same values."""
    if isinstance(part, dict):
        return {
            name: orders.get(frozenset(value), value)
            if name == "enum" and isinstance(value, list)
            else _in_order(value, orders)
            for name, value in part.items()
            if not (name in ("minimum", "maximum") and value in (-MOST, MOST))
        }
    return [_in_order(each, orders) for each in part] if isinstance(part, list) else part
