"""Outcomes and models as text, for people and for scripts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from tablemap.model import TableModel
    from tablemap.runs.running import Outcome


def stderr_console() -> Console:
    """Return a console for people, without colour where stderr is no terminal."""
    from rich.console import Console

    return Console(stderr=True, highlight=False)


def outcome_line(outcome: Outcome) -> dict[str, object]:
    """Return the contract's JSON line of one recording."""
    run = outcome.run
    first, *others = outcome.recording.places
    return {
        "recording": first,
        **({"together": others} if others else {}),
        "run": str(run.path) if run else None,
        "status": outcome.status,
        "error": outcome.error,
        "model": str(run.path / "table.json") if run and outcome.model else None,
    }


def outcome_rows(outcomes: list[Outcome]) -> Iterator[tuple[str, ...]]:
    """Return a table of outcomes, its header first."""
    from tablemap.archive.index import figures_of

    yield ("recording", "status", "shape", "size", "height", "verdict", "run")
    for outcome in outcomes:
        model, run = outcome.model, str(outcome.run.path) if outcome.run else ""
        figures = figures_of(model) if model else {}
        shape, verdict = (model.surface.shape, model.verdict.level) if model else ("", "")
        size, height = size_text(shape, figures), metres_text(figures.get("height"))
        yield (outcome.recording.name, outcome.status, shape, size, height, verdict, run)


def size_text(shape: str | None, figures: dict[str, float]) -> str:
    """Return the lengths of a shape as text, metres; nothing without a shape."""
    from tablemap.model.shapes import shape_named

    lengths = shape_named(shape).lengths if shape else ()
    return " x ".join(metres_text(figures.get(name)) for name in lengths)


def metres_text(value: float | None) -> str:
    """Return a length to the millimetre, or nothing."""
    return "" if value is None else f"{value:.3f}"


def aligned(rows: Iterable[Sequence[str]]) -> str:
    """Return rows of text as columns; the last is as long as it is."""
    lines = [tuple(row) for row in rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join(text.ljust(width) for text, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )


def print_model(model: TableModel, run: Path, *, console: Console) -> None:
    """Print a model's summary and how to open its run."""
    from rich.table import Table

    from tablemap.model.summary import summary_rows

    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    for name, text in summary_rows(model):
        table.add_row(name, text)
    console.print(table)
    console.print(f"\nrun      {run}", soft_wrap=True)
    console.print(f"open it  tablemap view {run}", soft_wrap=True)
