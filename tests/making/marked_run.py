"""The made-up run with doubts that are somewhere, or with mended pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from msgspec import structs

from tablemap.errors import ProcessWarning
from tablemap.events import OfTable, OtherTable
from tablemap.model import TableModel, WarningEntry
from tablemap.stages.calibration import Calibration
from tablemap.stages.legs import Legs
from tablemap.stages.snapshots import Snapshot, Snapshots
from tablemap.stages.surface import Surface


def doubted(
    run: list[object], *said: ProcessWarning, kept: tuple[ProcessWarning, ...] | None = None
) -> list[object]:
    """A run whose stages give these warnings, and whose models have those that are ``kept``."""
    entries = tuple(
        WarningEntry(code=w.code, stage=w.stage, message=w.message, stamp_ns=None)
        for w in (said if kept is None else kept)
    )

    def changed(one: object) -> object:
        if isinstance(one, Legs):
            return replace(one, warnings=tuple(w for w in said if w.stage == "legs"))
        if isinstance(one, Surface):
            return replace(one, warnings=tuple(w for w in said if w.stage == "surface"))
        if isinstance(one, TableModel):
            return structs.replace(one, warnings=entries)
        if isinstance(one, OfTable):
            return OfTable(one.number, changed(one.result))
        if isinstance(one, OtherTable) and isinstance(one.outcome, TableModel):
            return OtherTable(one.number, structs.replace(one.outcome, warnings=entries))
        return one

    return [changed(one) for one in run]


def mended(run: list[object], *, view: int) -> list[object]:
    """A run in whose view every tenth row of pixels was mended."""

    def marked(shots: tuple[Snapshot, ...]) -> tuple[Snapshot, ...]:
        rows = np.zeros(shots[0].depth.shape, dtype=bool)
        rows[::10] = True
        return tuple(replace(s, mended=rows if s.index == view else None) for s in shots)

    def changed(one: object) -> object:
        if isinstance(one, Snapshots):
            return replace(one, snapshots=marked(one.snapshots))
        if isinstance(one, Calibration):
            return replace(one, snapshots=marked(one.snapshots), recorded=marked(one.recorded))
        return one

    return [changed(one) for one in run]
