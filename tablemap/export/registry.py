"""The registry of formats: each module of `tablemap.export.formats` adds its own entry."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING

from tablemap.errors import ConfigError
from tablemap.export import formats
from tablemap.words import known_name

if TYPE_CHECKING:
    from tablemap.config import ExportConfig
    from tablemap.export.solid import Solid


@dataclass(frozen=True)
class Format:
    """A format's entry in the registry.

    - ``name``: for users; the files go to a folder of this name
    - ``description``: the use of the files, in a few words
    - ``files``: their names under that folder. ``{name}`` stands for the table's name, ``*`` for a
      part's: such a file is written only if the part needs it
    - ``world``: the one of ``files`` that places the object in the map, None without one
    - ``write``: returns the content of a table's files by their names; writes nothing
    - ``write_all``: the same of several tables in one set of files, called as the first; None if
      each table has files of its own
    """

    name: str
    description: str
    files: tuple[str, ...]
    world: str | None
    write: Callable[[Solid, ExportConfig], dict[str, bytes]]
    write_all: Callable[[Sequence[Solid], ExportConfig], dict[str, bytes]] | None = None

    @property
    def is_single_file(self) -> bool:
        """Whether the format has one main file, with the format's name as its suffix."""
        return f"{{name}}.{self.name}" in self.files


@cache
def all_formats() -> Mapping[str, Format]:
    """Return every format by its name, in the order of the names."""
    found: dict[str, Format] = {}
    for module in sorted(pkgutil.iter_modules(formats.__path__), key=lambda module: module.name):
        entry: Format = import_module(f"{formats.__name__}.{module.name}").FORMAT
        found[entry.name] = entry
    return MappingProxyType(found)


def check_formats(names: Sequence[str]) -> tuple[Format, ...]:
    """Return the formats of these names, in any case, each once.

    Raises `ConfigError` if one is unknown.
    """
    known = all_formats()
    names = [known_name(name, known) for name in ([names] if isinstance(names, str) else names)]
    for name in names:
        if name not in known:
            raise ConfigError(f"expected a format of {', '.join(known)}; found {name!r}.")
    return tuple(known[name] for name in dict.fromkeys(names))
