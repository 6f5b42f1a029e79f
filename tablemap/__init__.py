"""A robot's log of a drive round a table becomes a model of that table.

Paths may be ``str`` or ``os.PathLike``; a run may be given as its path or as a `RunFolder`. What is
wrong is a `TablemapError`. Lengths are metres, angles radians, times integer nanoseconds; frames
follow REP 103 and 105. The public names load lazily, so that importing ``tablemap`` costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tablemap.imports import on_demand
from tablemap.version import __version__

if TYPE_CHECKING:
    from tablemap.archive import RunFolder, load_run
    from tablemap.archive.comparison import compare
    from tablemap.archive.index import list_runs
    from tablemap.config import Config, load_config
    from tablemap.errors import TablemapError
    from tablemap.export import export_model, export_run
    from tablemap.model import TableModel
    from tablemap.pipeline import process
    from tablemap.readiness import inspect
    from tablemap.recording import Recording, open_recording
    from tablemap.runs.running import Outcome, reprocess, run
    from tablemap.runs.verification import verify

_HOMES = {
    "Config": "tablemap.config",
    "Outcome": "tablemap.runs.running",
    "Recording": "tablemap.recording",
    "RunFolder": "tablemap.archive",
    "TableModel": "tablemap.model",
    "TablemapError": "tablemap.errors",
    "compare": "tablemap.archive.comparison",
    "export_model": "tablemap.export",
    "export_run": "tablemap.export",
    "inspect": "tablemap.readiness",
    "list_runs": "tablemap.archive.index",
    "load_config": "tablemap.config",
    "load_run": "tablemap.archive",
    "open_recording": "tablemap.recording",
    "process": "tablemap.pipeline",
    "reprocess": "tablemap.runs.running",
    "run": "tablemap.runs.running",
    "verify": "tablemap.runs.verification",
}

__all__ = [
    "Config",
    "Outcome",
    "Recording",
    "RunFolder",
    "TableModel",
    "TablemapError",
    "__version__",
    "compare",
    "export_model",
    "export_run",
    "inspect",
    "list_runs",
    "load_config",
    "load_run",
    "open_recording",
    "process",
    "reprocess",
    "run",
    "verify",
]


__getattr__ = on_demand(__name__, _HOMES)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
