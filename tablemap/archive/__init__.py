"""Run folders: what a run leaves behind, and how it is read back."""

from tablemap.archive.folder import Manifest, RunFolder, load_run

__all__ = ["Manifest", "RunFolder", "load_run"]
