"""Under which conditions runs were made: their settings and versions, and what differs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tablemap.archive.folder import RunFolder
from tablemap.config import Config

Apart = dict[str, tuple[object, object]]
"""Values that differ, by name: the first run's and the second's."""


def changed_settings(run: RunFolder) -> Apart:
    """Return the settings that are not the defaults, by dotted name: the default and the run's.

    Raises `ConfigError` if the run's settings cannot be read.
    """
    return _apart(_flat(Config()), _flat(run.config))


def settings_apart(a: RunFolder, b: RunFolder) -> Apart:
    """Return the settings of two runs that differ, by dotted name.

    Raises `ConfigError` if the settings of one cannot be read.
    """
    return _apart(_flat(a.config), _flat(b.config))


def versions_apart(a: RunFolder, b: RunFolder) -> Apart:
    """Return the versions of two runs that differ, by package."""
    return _apart(a.manifest.versions, b.manifest.versions)


def _apart(a: Mapping[str, object], b: Mapping[str, object]) -> Apart:
    names = dict.fromkeys([*a, *b])
    return {name: (a.get(name), b.get(name)) for name in names if a.get(name) != b.get(name)}


def _flat(config: Config) -> dict[str, object]:
    return dict(_named("", config.model_dump(mode="json")))


def _named(prefix: str, tree: Mapping[str, object]) -> Iterator[tuple[str, object]]:
    for name, value in tree.items():
        if isinstance(value, Mapping):
            yield from _named(f"{prefix}{name}.", value)
        else:
            yield prefix + name, value
