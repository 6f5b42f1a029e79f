"""A robot's log of a drive round a table becomes a model of that table.

The public names load lazily, so that importing ``tablemap`` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from tablemap.version import __version__

if TYPE_CHECKING:
    from tablemap.archive import load_run
    from tablemap.archive.comparison import compare
    from tablemap.archive.index import list_runs
    from tablemap.config import Config, load_config
    from tablemap.errors import TablemapError
    from tablemap.export import export_model, export_run
    from tablemap.model import TableModel
    from tablemap.pipeline import process
    from tablemap.recording import inspect, open_recording
    from tablemap.runs.running import reprocess, run
    from tablemap.runs.verification import verify

_HOMES = {
    "Config": "tablemap.config",
    "TableModel": "tablemap.model",
    "TablemapError": "tablemap.errors",
    "compare": "tablemap.archive.comparison",
    "export_model": "tablemap.export",
    "export_run": "tablemap.export",
    "inspect": "tablemap.recording",
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


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'tablemap' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
