"""The base of every group of settings, and the sentence about a wrong setting."""

from __future__ import annotations

import difflib
from collections.abc import Mapping

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo


class Section(BaseModel):
    """A group of settings: frozen, and closed to unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def explain(error: ValidationError, root: type[Section]) -> str:
    """Return a sentence about the first error; an unknown name comes with the nearest one."""
    first = error.errors()[0]
    path = [str(part) for part in first["loc"]]
    name = ".".join(path)
    if first["type"] != "extra_forbidden":
        said = first["msg"].removeprefix("Value error, ")
        reason = said[0].lower() + said[1:]
        return f"{name} = {first['input']!r} is not allowed: {reason}."
    fields: Mapping[str, FieldInfo] = root.model_fields
    for part in path[:-1]:
        section = fields[part].annotation
        if not (isinstance(section, type) and issubclass(section, BaseModel)):
            break
        fields = section.model_fields
    names = list(fields)
    if isinstance(first["input"], Mapping):  # a section was meant
        names = [name for name in names if _is_section(fields[name])] or names
    near = difflib.get_close_matches(path[-1], names, n=1, cutoff=0.0)
    prefix = "".join(f"{part}." for part in path[:-1])
    return f"there is no setting {name!r}; the nearest is {prefix + near[0]!r}."


def _is_section(field: FieldInfo) -> bool:
    return isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel)
