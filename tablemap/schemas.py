"""JSON Schemas of settings and documents."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, get_args, get_origin

from msgspec import Struct, json
from msgspec.structs import fields


def json_schema(kind: type[Struct]) -> dict[str, Any]:
    """Return the JSON Schema of a kind of objects; choices stand as they are written there."""
    found = json.schema(kind)
    top = found["$defs"].pop(kind.__name__)
    parts = {"$defs": found["$defs"]} if found["$defs"] else {}
    orders = {frozenset(order): list(order) for order in choices(kind)}
    return dict(_in_order({**top, **parts}, orders))


def choices(kind: Any) -> Iterator[tuple[object, ...]]:
    """Yield the values of every choice in a type and below it."""
    if get_origin(kind) is Literal:
        yield get_args(kind)
    elif isinstance(kind, type) and issubclass(kind, Struct):
        for field in fields(kind):
            yield from choices(field.type)
    else:
        for part in get_args(kind):
            yield from choices(part)


def _in_order(part: Any, orders: dict[frozenset[object], list[object]]) -> Any:
    """Return a part of a schema; each choice has the order of those with the same values."""
    if isinstance(part, dict):
        return {
            name: orders.get(frozenset(value), value)
            if name == "enum" and isinstance(value, list)
            else _in_order(value, orders)
            for name, value in part.items()
        }
    return [_in_order(each, orders) for each in part] if isinstance(part, list) else part
