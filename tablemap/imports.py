"""Modules that are imported once they are needed, and libraries without what nobody needs."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections import defaultdict
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any, NamedTuple


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


def without_scipy_notes() -> None:
    """Let this program's SciPy leave its documentation as it is written.

    SciPy takes apart the texts of hundreds of functions when it is imported, to add notes to them:
    a third of the time of its import. For programs alone: they show no documentation of SciPy.
    """
    if _NOTES not in sys.modules and not any(
        isinstance(one, _NotesFinder) for one in sys.meta_path
    ):
        sys.meta_path.insert(0, _NotesFinder())


_NOTES = "scipy._lib._docscrape"


class _NotesFinder:
    """Puts a small module in the place of the one by which SciPy takes its texts apart."""

    def find_spec(self, fullname: str, *_: object) -> ModuleSpec | None:
        return ModuleSpec(fullname, self) if fullname == _NOTES else None  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        module = ModuleType(spec.name)
        vars(module).update(
            FunctionDoc=_NoNotes, Parameter=_NoteParameter, __getattr__=self._from_scipy
        )
        return module

    def exec_module(self, module: ModuleType) -> None:
        pass

    def _from_scipy(self, name: str) -> object:
        """Return something else of SciPy's own module, which is then imported after all."""
        if name.startswith("__"):
            raise AttributeError(f"module {_NOTES!r} has no attribute {name!r}")
        if self in sys.meta_path:
            sys.meta_path.remove(self)
            sys.modules.pop(_NOTES, None)
        return getattr(import_module(_NOTES), name)


class _NoteParameter(NamedTuple):
    """A parameter in such a text."""

    name: str
    type: str
    desc: list[str]


class _NoNotes(defaultdict[str, list[str]]):
    """The sections of a text, all empty."""

    def __init__(self, *_: object, **__: object) -> None:
        super().__init__(list)

    def __str__(self) -> str:
        return "\n"


def without_pydantic_plugins() -> None:
    """Let this program's pydantic, which KISS-ICP is set by, look for no plugins.

    For its first model it would read what every installed package offers.
    """
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")


def collect_rarely() -> None:
    """Let this program's process hardly look for objects that hold each other.

    A run makes few of them. Python looks after every 700 new objects, most of which are there to
    stay: modules, and what a run has found. It looks at all of them again when the program ends.
    """
    gc.set_threshold(1_000_000)
    atexit.register(gc.freeze)


def keep_memory() -> None:
    """Let this program's process keep the memory of arrays that are gone, for those to come.

    The GNU C library hands the memory of a large array back to the system as soon as the array is
    gone. For the next one the system clears it page by page, and a run makes thousands.
    """
    # Imported here: commands that answer at once do without it.
    import ctypes

    try:
        set_option = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # another C library
        return
    set_option(_TRIM_THRESHOLD, 512 << 20)
    set_option(_MMAP_THRESHOLD, 32 << 20)


_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""Options of ``mallopt``, whose values are bytes: see mallopt(3)."""


class _HidesPandas:
    """Lets ``import pandas`` end as it does where pandas is not installed."""

    def find_spec(self, fullname: str, *_: object) -> None:
        if fullname == "pandas":
            raise ModuleNotFoundError(f"No module named {fullname!r}", name=fullname)
