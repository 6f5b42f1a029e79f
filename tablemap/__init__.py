"""A robot's log of a drive round a table becomes a model of that table.

The public names load lazily, so that importing ``tablemap`` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tablemap.archive import load_run
    from tablemap.config import Config, load_config
    from tablemap.errors import TablemapError
    from tablemap.model import TableModel
    from tablemap.pipeline import process
    from tablemap.recording import open_recording
    from tablemap.running import run

__version__ = "0.1.0"

_HOMES = {
    "Config": "tablemap.config",
    "TableModel": "tablemap.model",
    "TablemapError": "tablemap.errors",
    "load_config": "tablemap.config",
    "load_run": "tablemap.archive",
    "open_recording": "tablemap.recording",
    "process": "tablemap.pipeline",
    "run": "tablemap.running",
}

__all__ = [
    "Config",
    "TableModel",
    "TablemapError",
    "load_config",
    "load_run",
    "open_recording",
    "process",
    "run",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'tablemap' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
