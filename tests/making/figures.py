"""The table of figures that benchmarks print, in the form that the README has."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple


class Row(NamedTuple):
    """A line of the table: a figure, what it is compared with, and how many times that it is."""

    what: str
    took: str
    beside: str
    times: str


class Figures:
    """The lines of the table, in the order of the benchmarks, and what later ones build on.

    - ``seconds``: processor time of a recording, by what it is
    """

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.seconds: dict[str, float] = {}

    def add(self, what: str, took: str, beside: str, *times: float) -> None:
        """Take a line: figures with their units, and the ratios of the first to the second."""
        self.rows.append(Row(what, took, beside, joined(map(_ratio, times))))

    def markdown(self) -> Iterator[str]:
        """Return the table's lines."""
        for row in [Row("what", "took", "beside", "times"), *self.rows]:
            yield f"| {' | '.join(row)} |"
            if row.what == "what":
                yield "|---|---|---|---|"


def joined(values: Iterable[object]) -> str:
    """Return several values as one cell."""
    return "; ".join(map(str, values))


def _ratio(times: float) -> str:
    return f"{times:.0f}" if times > 9.95 else f"{times:.1f}" if times > 1.95 else f"{times:.2f}"
