"""Documents in JSON with a schema's name in them; errors are one sentence."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextvars import ContextVar
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Self, TypeVar, Union, cast, get_args, get_origin

import msgspec
from msgspec import Struct, StructMeta, convert
from msgspec.structs import FieldInfo, force_setattr

from tablemap.errors import TablemapError
from tablemap.files import read_text
from tablemap.paths import AnyPath, as_place
from tablemap.schemas import MOST, json_schema
from tablemap.structs import checked, fields_of, reads
from tablemap.words import shortened


class DocumentError(TablemapError, ValueError):
    """A document, or a part of one, that is not what it should be."""


_IS_READ = ContextVar("is_read", default=False)
"""Whether the parts that are made now come from `msgspec`, which has checked types and ranges."""


class _Parts(StructMeta):
    """Makes parts of documents; one that lacks a field is damaged."""

    def __call__(self, *values: Any, **given: Any) -> Any:
        known = fields_of(cast("type[Struct]", self)).values()
        if missing := [each.name for each in known if each.required and each.name not in given]:
            raise DocumentError(f"{self.__name__} needs {', '.join(missing)}.")
        return super().__call__(*values, **given)


class DocumentPart(Struct, frozen=True, kw_only=True, metaclass=_Parts):
    """A part of a document: frozen; unknown fields in the file are ignored.

    Raises `DocumentError` for a field that is missing or not valid.
    """

    def __post_init__(self) -> None:
        """Check every field; of a part that is read, those that `msgspec` does not check."""
        for name, field in _fields_to_check(type(self), is_read=_IS_READ.get()).items():
            given = getattr(self, name)
            if given is field.default:
                continue
            try:
                value = checked(given, field.type)
            except (msgspec.ValidationError, ValueError) as error:
                where, reason = _said(error)
                raise DocumentError(f"{type(self).__name__}.{name}{where}: {reason}.") from error
            if value is not given:
                force_setattr(self, name, value)

    @classmethod
    def read(cls, fields: object, noun: str = "document") -> Self:
        """Return the part with these fields, those of its parts as mappings too.

        Raises `DocumentError` with the place of the first fault.
        """
        reading = _IS_READ.set(True)
        try:
            return convert(fields, cls, str_keys=True)
        except msgspec.ValidationError as error:
            where, reason = _said(error)
            place = f" at {shortened(where.lstrip('.'))}" if where else ""
            raise DocumentError(f"the {noun} is damaged{place}: {shortened(reason)}.") from error
        finally:
            _IS_READ.reset(reading)

    def fields(self) -> dict[str, Any]:
        """Return all fields as JSON has them, numbers as they are written."""
        return {name: write(getattr(self, own)) for own, name, write in _writers(type(self))}


@cache
def _fields_to_check(kind: type[DocumentPart], *, is_read: bool) -> dict[str, FieldInfo]:
    every = fields_of(kind)
    return {name: field for name, field in every.items() if not is_read or reads(field.type)}


Document = TypeVar("Document", bound=DocumentPart)


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
    kind: type[DocumentPart], schema: str, *, mode: Literal["serialization", "validation"]
) -> dict[str, object]:
    """Return the JSON Schema of a document; fields that it does not name are allowed.

    ``mode``: ``serialization`` for documents that we write, ``validation`` for those of others.
    """
    found = json_schema(kind)
    if mode == "serialization":  # we write all fields
        for part in (found, *found.get("$defs", {}).values()):
            part["required"] = list(part["properties"])
    name = {"const": schema, "description": "name of this schema"}
    found["properties"] = {"schema": name, **found["properties"]} | {"schema": name}
    found["required"] = list(dict.fromkeys(["schema", *found["required"]]))
    return found


def parse_document(text: str, kind: type[Document], *, schema: str, noun: str) -> Document:
    """Return the document in a JSON text; unknown fields are ignored.

    ``noun`` names the document in errors. Raises `TablemapError` if the text is no such document,
    or has another schema.
    """
    document = parsed(text, noun)
    found = document.get("schema") if isinstance(document, dict) else None
    if found != schema:
        raise TablemapError(
            f"expected a {noun} of schema {schema!r}, found {shortened(repr(found))}; use the "
            "version that wrote it."
        )
    return kind.read(document, noun)


def parsed(text: str | bytes, noun: str) -> Any:
    """Return what a JSON text holds. Raises `DocumentError` if it is none."""
    try:
        return msgspec.json.decode(text)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise DocumentError(f"expected a {noun} in JSON, found other text ({error}).") from error


def _said(error: Exception) -> tuple[str, str]:
    """Return where an error is, and what it says, as one clause."""
    said, _, path = str(error).partition(" - at ")
    where = "".join(re.findall(r"`\$(.*?)`", path))
    inner = re.fullmatch(r"\w+\.(\S+): (.*)\.", said)  # of a part's own check
    if inner:
        where, said = f"{where}.{inner[1]}", inner[2]
    unknown = re.fullmatch(r"Object contains unknown field `(.*)`", said)
    if unknown:
        return f"{where}.{unknown[1]}", "there is no such field"
    if str(MOST) in said:
        return where, "expected a finite number"
    return where, said[0].lower() + said[1:].replace("`", "")


@cache
def _writers(
    kind: type[DocumentPart],
) -> list[tuple[str, str, Callable[[Any], Any]]]:
    """Return for each field its name, its name in JSON, and what makes JSON of its value."""
    return [
        (field.name, field.encode_name, _writer(field.type)) for field in fields_of(kind).values()
    ]


def _writer(kind: Any) -> Callable[[Any], Any]:
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        own = [meta.extra["write"] for meta in parts[1:] if "write" in (meta.extra or {})]
        return own[0] if own else _writer(parts[0])
    if isinstance(kind, type) and issubclass(kind, DocumentPart):
        return DocumentPart.fields
    if origin in (Union, UnionType) and NoneType in parts:
        (some,) = (_writer(part) for part in parts if part is not NoneType)
        return lambda value: None if value is None else some(value)
    if origin is tuple and parts[-1] is Ellipsis:
        each = _writer(parts[0])
        return lambda values: [each(value) for value in values]
    if origin is tuple:
        every = [_writer(part) for part in parts]
        return lambda values: [write(value) for write, value in zip(every, values, strict=True)]
    if origin is dict:
        named = _writer(parts[1])
        return lambda values: {str(name): named(value) for name, value in values.items()}
    return _as_it_is


def _as_it_is(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
