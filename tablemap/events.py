"""Events of the stages, for a reviewer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tablemap.model import TableModel

Record = Callable[[object], None]
"""Takes a stage's result, or an event too large or too iterative to be part of one."""


@dataclass(frozen=True)
class StageStarted:
    """Event: a stage begins; ``index`` counts the stages from 0."""

    name: str
    index: int


@dataclass(frozen=True)
class StageFinished:
    """Event: a stage has ended, after ``seconds`` of wall time."""

    name: str
    index: int
    seconds: float


@dataclass(frozen=True)
class RunFailed:
    """Event: the run ends without a model, in ``stage``, because of ``message``."""

    stage: str
    message: str


@dataclass(frozen=True, eq=False)
class OtherTable:
    """Event: a table beside the chosen one, by its number: its model, or why there is none."""

    number: int
    outcome: TableModel | str


@dataclass(frozen=True, eq=False)
class OfTable:
    """Event: a result that is about table ``number`` beside the chosen one."""

    number: int
    result: object


def of_table(number: int, record: Record) -> Record:
    """Return a function that passes results on to ``record`` as those of another table."""

    def record_of_table(result: object) -> None:
        record(OfTable(number, result))

    return record_of_table


def ignore(_: object) -> None:
    """Record nothing."""
