"""The table of figures that benchmarks print, in the form that the README has."""

from __future__ import annotations

from collections.abc import Iterator
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

    def add(self, what: str, took: str, beside: str = "", *, times: float | None = None) -> None:
        """Take a line; both figures with their units."""
        ratio = "" if times is None else f"{times:.0f}" if times > 9.95 else f"{times:.2f}"
        self.rows.append(Row(what, took, beside, ratio))

    def markdown(self) -> Iterator[str]:
        """Return the table's lines."""
        for row in [Row("what", "took", "beside", "times"), *self.rows]:
            yield f"| {' | '.join(row)} |"
            if row.what == "what":
                yield "|---|---|---|---|"
