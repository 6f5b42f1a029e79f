"""Types from embedded schemas of ROS, checked before code is made from them.

rosbags writes and compiles Python code for every type: a line for each element of an array, a call
for each type within another. A schema of a hundred bytes can demand gigabytes of code, and one of a
few kilobytes can keep a parser busy for ever. So the size of a schema is limited, its text is
reduced to the parts that define types, and the types are counted before any code is made.
"""

from __future__ import annotations

import re
from typing import Any

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_idl, get_types_from_msg

from tablemap.config import LimitsConfig

Types = dict[str, tuple[list[Any], list[tuple[str, Any]]]]
"""rosbags' definitions: constants and fields by a type's name."""

_IDL_RULE = "=" * 80 + "\n"
_DIRECTIVE = re.compile(r"^\s*#.*$", re.MULTILINE)
_IDL_TEXT = re.compile(r'"(?:\\.|[^"\\])*"|//[^\n]*|/\*.*?\*/', re.DOTALL)
_IDL_ANNOTATION = re.compile(r"@\s*[A-Za-z_][\w:]*(?:\s*\([^()]*\))?")
_IDL_EXPRESSION = re.compile(r"[()|^&*/%~+]|<<|<[^<>]*<")  # sequences in sequences too
_SIZES = {
    "bool": 1,
    "byte": 1,
    "char": 1,
    "octet": 1,
    "int8": 1,
    "uint8": 1,
    "int16": 2,
    "uint16": 2,
    "int32": 4,
    "uint32": 4,
    "float32": 4,
    "int64": 8,
    "uint64": 8,
    "float64": 8,
    "float128": 16,
}


class SchemaError(Exception):
    """A schema that is not read; the text completes "its schema ..."."""


def types_of_msg(text: str, name: str, limits: LimitsConfig) -> Types:
    """Return the types of a message definition of ROS, as its recorders embed it."""
    lines = [
        line for line in text.split("\n") if line.strip() and not line.lstrip().startswith("#")
    ]
    _check_size(text, len(lines), limits)
    types: Types = get_types_from_msg("\n".join(lines) + "\n", name)
    return types


def types_of_idl(text: str, limits: LimitsConfig) -> Types:
    """Return the types of IDL files that rosbag2 joins by a rule and a line ``IDL: NAME``."""
    _check_size(text, text.count(";"), limits)
    types: Types = {}
    for part in text.split(_IDL_RULE):
        head, _, rest = part.partition("\n")
        idl = rest if head.startswith("IDL: ") else part
        idl = _DIRECTIVE.sub("", idl)  # included files follow as their own parts
        # Comments, texts and annotations define no types, but cost most of the parsing time.
        idl = _IDL_TEXT.sub(lambda match: '""' if match[0][0] == '"' else " ", idl)
        idl = _IDL_ANNOTATION.sub(" ", idl)
        if found := _IDL_EXPRESSION.search(idl):
            raise SchemaError(f"has an expression with {found[0]!r}, which is not read")
        if idl.strip():
            types.update(get_types_from_idl(idl))
    return types


def check_types(types: Types, name: str, limits: LimitsConfig, *, ros1: bool) -> set[str]:
    """Check how much code a type needs, and return the types in it that are elements of lists.

    Raises `SchemaError` if the type needs too much code.
    """
    counts = _Counts(types, limits, ros1=ros1)
    counts.of(name, 0)
    return counts.listed


def check_descriptors(data: bytes, limits: LimitsConfig) -> None:
    """Check the names in a protobuf schema: each is held with those of all that it is within.

    A package's name of half the schema's size would be repeated for every field of the other half.
    Raises `SchemaError` if a name is too long.
    """
    for file in FileDescriptorSet.FromString(data).file:
        waiting = [(len(file.package.encode()), each) for each in file.message_type]
        longest = len(file.package.encode())
        while waiting:
            before, kind = waiting.pop()
            length = before + len(kind.name.encode()) + 1
            longest = max(longest, length)
            waiting += [(length, each) for each in kind.nested_type]
        if longest > limits.name_bytes:
            over = limits.over("name_bytes")
            raise SchemaError(f"has the name of a type of {longest} bytes, {over}")


def _check_size(text: str, parts: int, limits: LimitsConfig) -> None:
    if len(text) > limits.schema_kib * 1024:
        raise SchemaError(f"has {len(text) / 1024:.0f} KiB, {limits.over('schema_kib')}")
    if parts > limits.schema_parts:
        raise SchemaError(f"has {parts} parts, {limits.over('schema_parts')}")


class _Counts:
    """Counts the fields of a type, including those of all types within it."""

    def __init__(self, types: Types, limits: LimitsConfig, *, ros1: bool) -> None:
        self._types, self._limits, self._ros1 = types, limits, ros1
        self._known: dict[str, tuple[int, int]] = {}
        self.listed: set[str] = set()

    def of(self, name: str, depth: int) -> tuple[int, int]:
        """Return the number of a type's parts, and its smallest size in a message, bytes."""
        if name in self._known:
            return self._known[name]
        if depth > self._limits.schema_depth:
            over = self._limits.over("schema_depth")
            raise SchemaError(f"has types within types, {over}")
        if name not in self._types:
            raise SchemaError(f"does not define {name}")
        parts, size = 0, 0
        for _, description in self._types[name][1]:
            more, least = self._field(description, depth)
            parts, size = parts + more, size + least
            if parts > self._limits.schema_parts:
                over = self._limits.over("schema_parts")
                raise SchemaError(f"spells out {parts} parts or more, {over}")
        # A type without fields has a byte in CDR, and none in ROS 1.
        self._known[name] = parts, size or (0 if self._ros1 else 1)
        return self._known[name]

    def _field(self, description: Any, depth: int) -> tuple[int, int]:
        kind, what = description
        if kind == Nodetype.BASE:
            return 1, self._base(what[0])
        if kind == Nodetype.NAME:
            parts, size = self.of(what, depth + 1)
            return parts + 1, size
        inner, length = what
        parts, size = self._field(inner, depth)
        if inner[0] == Nodetype.BASE and inner[1][0] != "string":
            return 1, 4 if kind == Nodetype.SEQUENCE else length * size
        if size == 0:
            raise SchemaError("has a list of empty messages")
        if kind == Nodetype.ARRAY:
            return length * parts, length * size
        if inner[0] == Nodetype.BASE:
            raise SchemaError("has a list of texts, which no message that is read has")
        self.listed.add(inner[1])
        return parts, 4

    def _base(self, name: str) -> int:
        if name == "string":
            return 4 if self._ros1 else 5
        if name not in _SIZES:
            raise SchemaError(f"has a field of type {name}, which is not read")
        return _SIZES[name]
