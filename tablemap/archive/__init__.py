"""Run folders: what a run leaves behind, and how it is read back."""

from typing import TYPE_CHECKING

from tablemap.imports import on_demand

if TYPE_CHECKING:
    from tablemap.archive.folder import RunFolder, load_run
    from tablemap.archive.manifest import Manifest

__all__ = ["Manifest", "RunFolder", "load_run"]

_HOMES = {
    "Manifest": "tablemap.archive.manifest",
    "RunFolder": "tablemap.archive.folder",
    "load_run": "tablemap.archive.folder",
}

__getattr__ = on_demand(__name__, _HOMES)
