"""Run folders: what a run leaves behind, and how it is read back."""

from tablemap.archive.folder import RunFolder, load_run
from tablemap.archive.manifest import Manifest

__all__ = ["Manifest", "RunFolder", "load_run"]
