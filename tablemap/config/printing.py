"""The tree of settings as TOML: without comments for a run, with comments for people."""

from __future__ import annotations

import inspect
import textwrap
from typing import Literal, get_args, get_origin

import tomli_w
from pydantic.fields import FieldInfo

from tablemap.config.section import Section
from tablemap.config.tree import Config

_WIDTH = 98  # columns of a comment


def dump_config(config: Config) -> str:
    """Return the whole tree as TOML; `load_config` of it gives the same tree."""
    return tomli_w.dumps(config.model_dump(mode="json", exclude_none=True))


def explain_config(config: Config) -> str:
    """Return the whole tree as TOML; comments say what each setting is, and its range."""
    parts = []
    for name, field in Config.model_fields.items():
        value = getattr(config, name)
        if isinstance(value, Section):
            doc = inspect.cleandoc(type(value).__doc__ or "").partition("\n\n")[0]
            parts += [f"\n{_comment(doc)}[{name}]\n"]
            parts += [
                _explained(key, part, getattr(value, key))
                for key, part in type(value).model_fields.items()
            ]
        else:
            parts.append(_explained(name, field, value))
    return "".join(parts)


def _explained(name: str, field: FieldInfo, value: object) -> str:
    allowed = _allowed(field)
    comment = f"{field.description} ({allowed})" if allowed else f"{field.description}"
    plain = list(value) if isinstance(value, tuple) else value
    return _comment(comment) + tomli_w.dumps({name: plain})


def _allowed(field: FieldInfo) -> str:
    """Return the values that are allowed, as people write them; an empty text if all are."""
    if get_origin(field.annotation) is Literal:
        return " | ".join(map(str, get_args(field.annotation)))
    limits = []
    for limit in field.metadata:
        for name, sign in (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<=")):
            if hasattr(limit, name):
                limits.append(f"{sign} {getattr(limit, name)}")
    return ", ".join(limits)


def _comment(text: str) -> str:
    lines = textwrap.wrap(text, _WIDTH, break_long_words=False, break_on_hyphens=False)
    return "".join(f"# {line}\n" for line in lines)
