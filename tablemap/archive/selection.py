"""Selection and order of the runs in a list."""

from __future__ import annotations

import difflib
import math
import operator
import re
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from fnmatch import fnmatchcase

from tablemap.archive.index import RunRow
from tablemap.errors import ConfigError
from tablemap.model.shapes import SHAPES
from tablemap.words import known_name

WORDS = ("recording", "run", "started", "status", "method", "shape", "verdict")
"""The columns of a row besides its figures."""
STATUSES = ("running", "ok", "partial", "failed", "interrupted", "dead", "damaged")
"""Those of a manifest and, of a run that no manifest calls so, ``dead`` and ``damaged``."""
VERDICTS = ("good", "doubtful", "failed")
"""Written out, as the statuses are, for a list needs neither manifests nor models."""
OPERATORS: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
    "=": operator.eq,
}


@dataclass(frozen=True)
class Selection:
    """The criteria for runs in a list; a run must match every given one.

    - ``recording``: a pattern such as ``kitchen*``
    - ``shape``, ``status``, ``verdict``: the wanted ones, any if empty
    - ``since``, ``until``: ISO dates or times in UTC; a date is the whole day
    - ``where``: comparisons of figures such as ``height<0.7``; a run without the figure fails
    - ``sort``: one of `WORDS` or a figure, reversed by a leading ``-``; runs without it come last
    """

    recording: str = "*"
    shape: Sequence[str] = ()
    status: Sequence[str] = ()
    verdict: Sequence[str] = ()
    since: str | None = None
    until: str | None = None
    where: Sequence[str] = ()
    sort: str = "started"

    def of(self, rows: Iterable[RunRow]) -> list[RunRow]:
        """Return the matching rows, sorted.

        Raises `ConfigError` for a date or condition that cannot be read, or an unknown shape,
        status, verdict or figure.
        """
        shapes = _known("shape", self.shape, SHAPES)
        statuses = known_statuses(self.status)
        verdicts = _known("verdict", self.verdict, VERDICTS)
        rows = list(rows)
        by_figure = self.where or self.sort.removeprefix("-") not in WORDS
        names = {name for row in rows for name in row.figures} if by_figure else set()
        conditions = [_condition(text, names) for text in self.where]
        since = _time(self.since, end=False) if self.since else None
        until = _time(self.until, end=True) if self.until else None
        kept = [
            row
            for row in rows
            if fnmatchcase(row.recording, self.recording)
            and (not shapes or row.shape in shapes)
            and (not statuses or row.status in statuses)
            and (not verdicts or row.verdict in verdicts)
            and ((since is None and until is None) or _within(row, since, until))
            and all(condition(row) for condition in conditions)
        ]
        return _sorted(kept, self.sort, names)


def known_statuses(names: Collection[str]) -> set[str]:
    """Return statuses, given in any case. Raises `ConfigError` for one that is not known."""
    return _known("status", names, STATUSES)


def started(row: RunRow) -> datetime | None:
    """Return when a run began; None if its manifest does not say."""
    try:
        begun = datetime.fromisoformat(row.started)
    except ValueError:
        return None
    return begun if begun.tzinfo else begun.replace(tzinfo=UTC)


def _within(row: RunRow, since: datetime | None, until: datetime | None) -> bool:
    begun = started(row)
    if begun is None:
        return False
    return (since is None or begun >= since) and (until is None or begun < until)


def _time(text: str, *, end: bool) -> datetime:
    try:
        when = datetime.fromisoformat(text)
        if when.tzinfo is None:
            when = when.replace(tzinfo=UTC)
        is_date = re.fullmatch(r"[\d-]+|\d{4}-?W\d\d.*", text) is not None
        return when + timedelta(days=1) if end and is_date else when
    except (ValueError, OverflowError) as error:
        raise ConfigError(
            f"expected a date such as 2026-05-31, or 2026-05-31T14:00; found {text!r}."
        ) from error


def _condition(text: str, names: set[str]) -> Callable[[RunRow], bool]:
    found = re.fullmatch(r"\s*(\w+)\s*(<=|>=|!=|<|>|=)\s*(\S+)\s*", text)
    try:
        name, sign, limit = found[1], OPERATORS[found[2]], float(found[3])  # type: ignore[index]
        if math.isnan(limit):
            raise ValueError("nothing compares with it")
    except (TypeError, ValueError) as error:
        raise ConfigError(f"expected a condition such as height<0.7, found {text!r}.") from error
    _check_name(name, names)
    return lambda row: name in row.figures and sign(row.figures[name], limit)


def _known(what: str, names: Collection[str], known: Collection[str]) -> set[str]:
    """Return names, given in any case. Raises `ConfigError` for one that is not known."""
    found = {known_name(name, known) for name in names}
    for name in found - set(known):
        raise ConfigError(f"expected a {what} of {', '.join(known)}; found {name!r}.")
    return found


def _check_name(name: str, names: set[str]) -> None:
    """Raise `ConfigError` for a figure that no run has, unless no run has any figures."""
    if names and name not in names:
        near = difflib.get_close_matches(name, sorted(names), n=1, cutoff=0.0)
        raise ConfigError(f"no run has a figure {name!r}; the nearest is {near[0]!r}.")


def _sorted(rows: list[RunRow], key: str, names: set[str]) -> list[RunRow]:
    name = key.removeprefix("-")
    value: Callable[[RunRow], str | float | None]
    if name in WORDS:
        value = operator.attrgetter(name)
    else:
        _check_name(name, names | set(WORDS) if names else names)

        def value(row: RunRow) -> float | None:
            return row.figures.get(name)

    with_it = [row for row in rows if value(row) not in (None, "")]
    without = [row for row in rows if value(row) in (None, "")]
    with_it.sort(key=lambda row: (value(row), row.path), reverse=key.startswith("-"))
    return with_it + without
