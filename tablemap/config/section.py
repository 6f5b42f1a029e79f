"""The base of every group of settings, and the sentence about a wrong setting.

The annotation of a setting has its limits and its description. It is no text but a value, as that
takes less time to read: modules of settings do without ``from __future__ import annotations``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Self, TypeGuard, cast, get_args, get_origin

from msgspec import Meta, Struct, StructMeta, ValidationError, convert
from msgspec.structs import FieldInfo, force_setattr

from tablemap.errors import ConfigError
from tablemap.schemas import choices
from tablemap.structs import checked, fields_of

LIMITS = {
    "gt": (">", "greater than"),
    "ge": (">=", "greater than or equal to"),
    "lt": ("<", "less than"),
    "le": ("<=", "less than or equal to"),
}
"""What an annotation says of a setting's range, each with its sign and its words."""
_TYPES = {
    bool: "true or false",
    int: "a valid integer",
    float: "a valid number",
    str: "a valid string",
    tuple: "a list of valid numbers",
}


class _Groups(StructMeta):
    """Makes groups of settings, and refuses names that are none."""

    def __call__(self, *values: Any, **given: Any) -> Any:
        group = cast("type[Section]", self)
        for name in given.keys() - set(group.__struct_fields__):
            raise _unknown(group, name, given[name], prefix="")
        return super().__call__(*values, **given)


class Section(Struct, frozen=True, forbid_unknown_fields=True, metaclass=_Groups):
    """A group of settings: frozen, and closed to unknown names.

    Raises `ConfigError` for a setting that is unknown or out of its range.
    """

    def __post_init__(self) -> None:
        """Check every setting that is not the default."""
        for name, default in _defaults(type(self)):
            given = getattr(self, name)
            if given is not default:
                force_setattr(self, name, _checked(given, fields_of(type(self))[name], name))

    @classmethod
    def read(cls, tree: Mapping[str, Any], *, prefix: str = "") -> Self:
        """Return the group with the settings in a tree; ``prefix`` is the group's own name."""
        defaults = dict(_defaults(cls))
        given: dict[str, Any] = {}
        for key, value in tree.items():
            if key not in defaults:
                raise _unknown(cls, key, value, prefix=prefix)
            default, name = defaults[key], f"{prefix}{key}"
            if isinstance(default, Section) and isinstance(value, Mapping):
                given[key] = type(default).read(value, prefix=f"{name}.")
            elif type(value) is not type(default) or value != default:
                given[key] = _checked(value, fields_of(cls)[key], name)
        return cls(**given)


def _defaults(section: type[Section]) -> Iterator[tuple[str, Any]]:
    """Yield each setting's name and default; every setting has one."""
    return zip(section.__struct_fields__, section.__struct_defaults__, strict=True)


def is_section(kind: object) -> TypeGuard[type[Section]]:
    """Say whether the type of a setting is a group of settings."""
    return isinstance(kind, type) and issubclass(kind, Section)


def meant(field: FieldInfo) -> Meta:
    """Return what the annotation of a setting says: its description, its limits."""
    return cast(Meta, get_args(field.type)[1])


def _checked(value: object, field: FieldInfo, name: str) -> object:
    """Return the value of a setting as its type has it; numbers may be given as text."""
    kind, reason = field.type, ""
    try:
        read = checked(value, kind, strict=False)
        if _is_finite(read):
            return read
        reason = "input should be a finite number"
    except ValidationError:
        reason = f"input should be {_expected(value, kind)}"
    except ValueError as error:
        reason = str(error)
    raise ConfigError(f"{name} = {value!r} is not allowed: {reason}.")


def _is_finite(value: object) -> bool:
    """Say whether a value is no infinite number or NaN, and has none in it."""
    if isinstance(value, tuple):
        return all(_is_finite(each) for each in value)
    return not isinstance(value, float) or math.isfinite(value)


def _expected(value: object, kind: Any) -> str:
    """Return what is expected instead of a value."""
    if is_section(kind):
        return "a section"
    bare, meta = get_args(kind)
    try:
        convert(value, bare, strict=False)
    except ValidationError:
        *some, last = [repr(each) for part in choices(bare) for each in part] or [""]
        if some:
            return f"{', '.join(some)} or {last}"
        return _TYPES.get(get_origin(bare) or bare, "another value")
    limits = [(words, getattr(meta, limit)) for limit, (_, words) in LIMITS.items()]
    ranges = [f"{words} {limit}" for words, limit in limits if limit is not None]
    return " and ".join(ranges) or f"a list of {meta.min_length} or more"


def _unknown(section: type[Section], key: str, value: object, *, prefix: str) -> ConfigError:
    """Return the error about a name that is no setting's; it has the nearest one."""
    import difflib

    known = fields_of(section)
    names = list(known)
    if isinstance(value, Mapping):  # a section was meant
        names = [name for name in names if is_section(known[name].type)] or names
    near = difflib.get_close_matches(key, names, n=1, cutoff=0.0)
    return ConfigError(
        f"there is no setting {prefix + key!r}; the nearest is {prefix + near[0]!r}."
    )
