"""Modules that are imported once they are needed, and libraries without what nobody needs."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any


def on_demand(package: str, homes: Mapping[str, str]) -> Callable[[str], object]:
    """Return a package's ``__getattr__``: it imports each public name's module when it is used."""

    def get(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(homes[name]), name)

    return get


_DRAWING = "open3d.visualization"


@cache
def open3d() -> Any:
    """Return Open3D; its drawing is imported when somebody asks for it.

    The drawing imports dash, plotly, IPython and requests: twice the time of all the rest.
    """
    if "open3d" in sys.modules:
        return sys.modules["open3d"]
    # `import open3d` finds this empty module in the place of its drawing.
    sys.modules[_DRAWING] = ModuleType(_DRAWING)
    try:
        library = import_module("open3d")
    finally:
        del sys.modules[_DRAWING]
    library.__getattr__ = _drawing  # type: ignore[method-assign]
    return library


def _drawing(name: str) -> ModuleType:
    if name == "visualization":
        return import_module(_DRAWING)
    raise AttributeError(f"module 'open3d' has no attribute {name!r}")


def hide_pandas() -> None:
    """Let this program's process do without pandas.

    pyarrow, which Rerun logs by, imports pandas if it is there, to recognise its tables. None of
    ours comes in one. For programs alone: whoever calls the library may use both.
    """
    if not any(isinstance(finder, _HidesPandas) for finder in sys.meta_path):
        sys.meta_path.insert(0, _HidesPandas())


def without_pydantic_plugins() -> None:
    """Let this program's pydantic look for no plugins.

    For its first model it would read what every installed package offers.
    """
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")


def collect_rarely() -> None:
    """Let this program's process look less often for objects that hold each other.

    A run makes few of them. Python looks after every 700 new objects, most of which are there to
    stay: modules, and what a run has found.
    """
    gc.set_threshold(10_000)


class _HidesPandas:
    """Lets ``import pandas`` end as it does where pandas is not installed."""

    def find_spec(self, fullname: str, *_: object) -> None:
        if fullname == "pandas":
            raise ModuleNotFoundError(f"No module named {fullname!r}", name=fullname)
