"""The tree of settings as TOML: without comments for a run, with comments for people."""

from __future__ import annotations

import inspect
import textwrap
from typing import Literal, get_args, get_origin

import tomli_w
from msgspec import to_builtins
from msgspec.structs import FieldInfo

from tablemap.config.section import LIMITS, Section, meant
from tablemap.config.tree import Config
from tablemap.structs import fields_of

_WIDTH = 98  # columns of a comment


def dump_config(config: Config) -> str:
    """Return the whole tree as TOML; `load_config` of it gives the same tree."""
    return tomli_w.dumps(to_builtins(config))


def explain_config(config: Config) -> str:
    """Return the whole tree as TOML; comments say what each setting is, and its range."""
    parts = []
    for name, field in fields_of(Config).items():
        value = getattr(config, name)
        if isinstance(value, Section):
            doc = inspect.cleandoc(type(value).__doc__ or "").partition("\n\n")[0]
            parts += [f"\n{_comment(doc)}[{name}]\n"]
            parts += [
                _explained(key, part, getattr(value, key))
                for key, part in fields_of(type(value)).items()
            ]
        else:
            parts.append(_explained(name, field, value))
    return "".join(parts)


def _explained(name: str, field: FieldInfo, value: object) -> str:
    meaning, allowed = meant(field).description, _allowed(field)
    comment = f"{meaning} ({allowed})" if allowed else f"{meaning}"
    return _comment(comment) + tomli_w.dumps({name: value})


def _allowed(field: FieldInfo) -> str:
    """Return the values that are allowed, as people write them; an empty text if all are."""
    bare, meta = get_args(field.type)
    if get_origin(bare) is Literal:
        return " | ".join(map(str, get_args(bare)))
    limits = {sign: getattr(meta, name) for name, (sign, _) in LIMITS.items()}
    return ", ".join(f"{sign} {limit}" for sign, limit in limits.items() if limit is not None)


def _comment(text: str) -> str:
    lines = textwrap.wrap(text, _WIDTH, break_long_words=False, break_on_hyphens=False)
    return "".join(f"# {line}\n" for line in lines)
