"""What a shell completes: names of settings, scenarios, suites, formats and tabs, in any case."""

from __future__ import annotations

from collections.abc import Callable, Iterable

Complete = Callable[[str], list[str]]


def settings(*, below: str = "") -> Complete:
    """Return what completes ``--set``: each setting of a section, or of all, up to its value."""

    def complete(begun: str) -> list[str]:
        from tablemap.config import setting_names

        return _begin(begun, (f"{name}=" for name in setting_names() if name.startswith(below)))

    return complete


def formats(begun: str) -> list[str]:
    """Complete a format of an export."""
    from tablemap.export import all_formats

    return _begin(begun, all_formats())


def scenarios(begun: str) -> list[str]:
    """Complete a scenario."""
    from tablemap.simulation import scenario_names

    return _begin(begun, scenario_names())


def suites(begun: str) -> list[str]:
    """Complete a suite, or a scenario that stands for one."""
    from tablemap.simulation import SUITES, scenario_names

    return _begin(begun, [*SUITES, "all", *scenario_names()])


def tabs(begun: str) -> list[str]:
    """Complete a tab of a review."""
    from tablemap.review.viewer.still import TABS

    return _begin(begun, TABS)


def shapes(begun: str) -> list[str]:
    """Complete a shape."""
    from tablemap.model.shapes import SHAPES

    return _begin(begun, SHAPES)


def statuses(begun: str) -> list[str]:
    """Complete how a run ended."""
    from tablemap.archive.selection import STATUSES

    return _begin(begun, STATUSES)


def verdicts(begun: str) -> list[str]:
    """Complete a verdict."""
    from tablemap.archive.selection import VERDICTS

    return _begin(begun, VERDICTS)


def _begin(begun: str, names: Iterable[str]) -> list[str]:
    """Return the names that begin so in any case, their begin as it was typed: shells want that."""
    return [begun + name[len(begun) :] for name in names if name.lower().startswith(begun.lower())]
