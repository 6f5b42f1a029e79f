"""Under which conditions runs were made: their settings and versions, and what differs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from msgspec import to_builtins

from tablemap.archive.folder import RunFolder
from tablemap.config import Config

Apart = dict[str, tuple[object, ...]]
"""Values that differ, by name: one of each run, in their order."""


def changed_settings(run: RunFolder) -> Apart:
    """Return the settings that are not the defaults, by dotted name: the default and the run's.

    Raises `ConfigError` if the run's settings cannot be read.
    """
    return _apart(_flat(Config()), _flat(run.config))


def settings_apart(*runs: RunFolder) -> Apart:
    """Return the settings of runs that differ, by dotted name.

    Raises `ConfigError` if the settings of one cannot be read.
    """
    return _apart(*(_flat(run.config) for run in runs))


def versions_apart(*runs: RunFolder) -> Apart:
    """Return the versions of runs that differ, by package."""
    return _apart(*(run.manifest.versions for run in runs))


def _apart(*trees: Mapping[str, object]) -> Apart:
    names = dict.fromkeys(name for tree in trees for name in tree)
    values = {name: tuple(tree.get(name) for tree in trees) for name in names}
    return {name: own for name, own in values.items() if any(each != own[0] for each in own)}


def _flat(config: Config) -> dict[str, object]:
    return dict(_named("", to_builtins(config)))


def _named(prefix: str, tree: Mapping[str, object]) -> Iterator[tuple[str, object]]:
    for name, value in tree.items():
        if isinstance(value, Mapping):
            yield from _named(f"{prefix}{name}.", value)
        else:
            yield prefix + name, value
