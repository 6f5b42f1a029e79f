"""Outcomes and models as text, for people and for scripts."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING

import typer

from tablemap.words import shown, shown_lines

if TYPE_CHECKING:
    from rich.console import Console

    from tablemap.archive import RunFolder
    from tablemap.events import OtherTable
    from tablemap.model import TableModel
    from tablemap.runs.running import Outcome

_NARROWEST = 20
"""Letters that a column of text has on any terminal."""


def say(words: object, *, err: bool = False, nl: bool = True) -> None:
    """Print on stdout, or on stderr; what moves a terminal's cursor stands as an escape."""
    typer.echo(shown_lines(words), err=err, nl=nl)


def complain(words: object, *, kind: str = "tablemap") -> None:
    """Print one sentence on stderr: on a terminal broken between words, else in one line."""
    for line in hung("", f"{kind}: {shown(words)}", wide(sys.stderr)):
        say(line, err=True)


def wide(stream: IO[str]) -> int | None:
    """Return how many letters a terminal's line has; None where the stream is no terminal."""
    return shutil.get_terminal_size().columns if stream.isatty() else None


def hung(start: str, text: str, columns: int | None) -> list[str]:
    """Return the lines of a text beside its start; broken between words to fit ``columns``."""
    if columns is None:
        return [f"{start}{text}".rstrip()]
    least = max(columns - len(start), _NARROWEST)
    lines = textwrap.wrap(text, least, break_long_words=False, break_on_hyphens=False) or [""]
    return [f"{start}{lines[0]}".rstrip(), *(" " * len(start) + line for line in lines[1:])]


def named_rows(rows: Iterable[tuple[str, str]], columns: int | None) -> str:
    """Return names and texts as two columns; the texts broken to fit a terminal's ``columns``."""
    shown_rows = [(shown(name), shown(text)) for name, text in rows]
    width = max((len(name) for name, _ in shown_rows), default=0)
    lines = [hung(f"{name:<{width}}  ", text, columns) for name, text in shown_rows]
    return "\n".join(line for each in lines for line in each)


def stdout_console() -> Console:
    """Return a console for people, without markup; without colour if stdout is no terminal."""
    from rich.console import Console

    return Console(highlight=False, markup=False, emoji=False)


def stderr_console() -> Console:
    """Return a console for people, without markup; without colour if stderr is no terminal."""
    from rich.console import Console

    return Console(stderr=True, highlight=False, markup=False, emoji=False)


def outcome_line(outcome: Outcome, address: Callable[[Path], str] = str) -> dict[str, object]:
    """Return the contract's JSON line of one recording; ``address`` tells where a path is."""
    from tablemap.archive.index import figures_of

    run, model = outcome.run, outcome.model
    first, *others = outcome.recording.places
    return {
        "recording": first,
        **({"together": others} if others else {}),
        "run": address(run.path) if run else None,
        "status": outcome.status,
        "error": outcome.error,
        "model": address(run.path / "table.json") if run and model else None,
        "verdict": model.verdict.level if model else None,
        "reasons": list(model.verdict.reasons) if model else [],
        "figures": figures_of(model) if model else {},
        "others": [other_entry(other, run, address) for other in outcome.others] if run else [],
    }


def other_entry(
    other: OtherTable, run: RunFolder, address: Callable[[Path], str] = str
) -> dict[str, object]:
    """Return a table beside the chosen one for JSON: its model's path, or why there is none."""
    from tablemap.archive.folder import table_name
    from tablemap.archive.index import figures_of

    found = other.outcome
    if isinstance(found, str):
        return {"number": other.number, "model": None, "error": found}
    return {
        "number": other.number,
        "model": address(run.path / table_name(other.number)),
        "error": None,
        "shape": found.surface.shape,
        "verdict": found.verdict.level,
        "reasons": list(found.verdict.reasons),
        "figures": figures_of(found),
    }


class Ends:
    """How recordings ended, in words: the models of thousands would fill the memory.

    - ``rows``: a table of outcomes, its header first
    - ``lines``: the tables beside the chosen ones, then why models are not good
    - ``code``: the exit code
    """

    def __init__(self, *, strict: bool, address: Callable[[Path], str] = str) -> None:
        self.rows = [("recording", "status", "shape", "size", "height", "verdict", "run")]
        self._strict, self._address = strict, address
        self._others: list[str] = []
        self._doubts: list[str] = []
        self._codes: set[int] = set()

    def add(self, outcome: Outcome) -> None:
        """Take how one more recording ended."""
        from tablemap.archive.index import figures_of
        from tablemap.model.summary import doubts

        model, name = outcome.model, outcome.recording.name
        run = self._address(outcome.run.path) if outcome.run else ""
        figures = figures_of(model) if model else {}
        shape, verdict = (model.surface.shape, model.verdict.level) if model else ("", "")
        size, height = size_text(shape, figures), metres_text(figures.get("height"))
        self.rows.append((name, outcome.status, shape, size, height, verdict, run))
        self._others += (f"{name}, {other}: {text}" for other, text in other_rows(outcome.others))
        if model and verdict != "good":
            self._doubts.append(f"{name} is {verdict} because: {' '.join(doubts(model))}")
        self._codes.add(_code(outcome, strict=self._strict))

    @property
    def lines(self) -> list[str]:
        """What is said below the table."""
        return self._others + self._doubts

    @property
    def code(self) -> int:
        """See `exit_code`."""
        return _worst(self._codes)


def exit_code(outcomes: Iterable[Outcome], *, strict: bool) -> int:
    """Return 1 where a recording failed, else 4 where one is doubtful and that counts.

    Else 3 where one was read only in part, and 0 where all is well.
    """
    return _worst(_code(outcome, strict=strict) for outcome in outcomes)


def _code(outcome: Outcome, *, strict: bool) -> int:
    if outcome.status == "failed":
        return 1
    if strict and outcome.model and outcome.model.verdict.level != "good":
        return 4
    return 3 if outcome.status == "partial" else 0


def _worst(codes: Iterable[int]) -> int:
    found = set(codes)
    return next((code for code in (1, 4, 3) if code in found), 0)


def size_text(shape: str | None, figures: dict[str, float]) -> str:
    """Return the lengths of a shape as text, metres; nothing without a shape."""
    from tablemap.model.shapes import shape_named

    lengths = shape_named(shape).lengths if shape else ()
    return " x ".join(metres_text(figures.get(name)) for name in lengths)


def metres_text(value: float | None) -> str:
    """Return a length to the millimetre, or nothing."""
    return "" if value is None else f"{value:.3f}"


def aligned(rows: Iterable[Sequence[str]]) -> str:
    """Return rows of text as columns; the last column is not padded."""
    lines = [tuple(map(shown, row)) for row in rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join(text.ljust(width) for text, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )


def other_rows(others: Iterable[OtherTable]) -> Iterator[tuple[str, str]]:
    """Return a row for each table beside the chosen one: what it is, or why it is none."""
    from tablemap.model.summary import line

    for other in others:
        found = other.outcome
        said = f"none: {found}" if isinstance(found, str) else line(found)
        yield (f"table {other.number:02d}", said)


def print_model(
    model: TableModel, run: Path | str, *, console: Console, others: Iterable[OtherTable] = ()
) -> None:
    """Print a model's summary and notes, how to open its run, and at the end why it is doubted."""
    from tablemap.model.summary import doubts, notes, summary_rows

    rows = [
        *summary_rows(model),
        *other_rows(others),
        *(("note", note) for note in notes(model)),
    ]
    columns = console.width if console.is_terminal else None
    console.print(named_rows(rows, columns), soft_wrap=True)
    console.print()
    print_left(run, console=console)
    if model.verdict.level != "good":
        console.print(f"\n{model.verdict.level} because:")
        for doubt in doubts(model):
            console.print("\n".join(hung("  ", shown(doubt), columns)), soft_wrap=True)


def print_left(run: Path | str, *, console: Console) -> None:
    """Print which folder a run left, and how to look at one that is on this machine."""
    console.print(f"run      {shown(run)}", soft_wrap=True)
    if isinstance(run, Path):
        console.print(f"open it  tablemap view {shown(run)}", soft_wrap=True)
