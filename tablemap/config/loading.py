"""Defaults < TOML file < ``--set section.key=value``."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from tablemap.config.tree import Config
from tablemap.errors import ConfigError


def load_config(file: Path | None = None, *, overrides: Sequence[str] = ()) -> Config:
    """Merge defaults, a TOML file and ``section.key=value`` settings into one validated tree.

    A value is read as TOML and, where that fails, as text: ``topics.depth=/camera/depth`` needs no
    quotes. Raises `ConfigError` for what is unknown, with the nearest name, or out of range.
    """
    tree: dict[str, Any] = {}
    if file is not None:
        try:
            tree = tomllib.loads(file.read_text(encoding="utf-8"))
        except OSError as error:
            raise ConfigError(f"the config cannot be read ({error.strerror}): {file}") from error
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ConfigError(f"the config is no TOML ({error}): {file}") from error
    for setting in overrides:
        name, separator, text = setting.partition("=")
        if not separator or not name.strip():
            raise ConfigError(f"expected --set section.key=value, found {setting!r}.")
        *sections, key = name.strip().split(".")
        branch = tree
        for section in sections:
            branch = branch.setdefault(section, {})
            if not isinstance(branch, dict):
                raise ConfigError(f"{section!r} in {name!r} is a value, not a section.")
        branch[key] = _parse_value(text.strip())
    try:
        return Config.model_validate(tree)
    except ValidationError as error:
        raise ConfigError(_explain(error)) from error


def dump_config(config: Config) -> str:
    """Return the whole tree as TOML; `load_config` of it gives the same tree."""
    return tomli_w.dumps(config.model_dump(mode="json", exclude_none=True))


def _parse_value(text: str) -> object:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _explain(error: ValidationError) -> str:
    """Say the first thing that is wrong, with the nearest name for one that is unknown."""
    first = error.errors()[0]
    path = [str(part) for part in first["loc"]]
    name = ".".join(path)
    if first["type"] != "extra_forbidden":
        reason = first["msg"][0].lower() + first["msg"][1:]
        return f"{name} = {first['input']!r} is not allowed: {reason}."
    fields: Mapping[str, FieldInfo] = Config.model_fields
    for part in path[:-1]:
        section = fields[part].annotation
        if not (isinstance(section, type) and issubclass(section, BaseModel)):
            break
        fields = section.model_fields
    near = difflib.get_close_matches(path[-1], list(fields), n=1, cutoff=0.0)
    prefix = "".join(f"{part}." for part in path[:-1])
    return f"there is no setting {name!r}; the nearest is {prefix + near[0]!r}."
