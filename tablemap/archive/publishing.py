"""Runs that are to be kept on a server: written here first, then put there file by file."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tablemap.archive.folder import load_run
from tablemap.archive.manifest import LEAVE_A_MODEL
from tablemap.errors import TablemapError
from tablemap.remote import RemotePath, is_remote, place_at

MANIFEST = "manifest.json"
"""Put last: a run that has it is whole."""

LATEST = "latest"
"""An object with the name of a recording's last run that left a model, as the link is on a disk."""


class Destination:
    """Where runs go: ``folder`` is where they are written, the same or a stand-in for a server."""

    def __init__(self, folder: Path, remote: RemotePath | None) -> None:
        self.folder = folder
        self._remote = remote
        self._published: set[Path] = set()

    @property
    def is_remote(self) -> bool:
        """Whether runs are put on a server."""
        return self._remote is not None

    def address(self, path: Path) -> str:
        """Return where a file or a run of ``folder`` is to be found in the end."""
        if self._remote is None:
            return str(path)
        return str(self._remote / path.resolve().relative_to(self.folder.resolve()).as_posix())

    def publish(self, run: Path) -> None:
        """Put all files of an ended run on the server, its manifest last.

        Raises `TablemapError` where the server takes one not; the run then stays in ``folder``.
        """
        if self._remote is None:
            return
        files = [file for file in sorted(run.rglob("*")) if file.is_file()]
        files.sort(key=lambda file: file.name == MANIFEST)
        target = self._remote / run.parent.name / run.name
        try:
            for file in files:
                (target / file.relative_to(run).as_posix()).put(file)
            if load_run(run).manifest.status in LEAVE_A_MODEL:
                (target.parent / LATEST).put(f"{run.name}\n".encode())
        except OSError as error:
            raise TablemapError(
                f"the run cannot be uploaded ({error.strerror}) and stays at {run}: {target}"
            ) from error
        self._published.add(run)

    def publish_rest(self) -> bool:
        """Put on the server what an interruption has left; tell whether all is there."""
        runs = [manifest.parent for manifest in sorted(self.folder.glob(f"*/*/{MANIFEST}"))]
        for run in runs:
            if run.name != LATEST and run not in self._published:
                with suppress(TablemapError):
                    self.publish(run)
        return {run for run in runs if run.name != LATEST} <= self._published


@contextmanager
def destination(output: str) -> Iterator[Destination]:
    """Hand out where the runs of ``output`` go, a folder or a place on a server.

    Raises `TablemapError` where the server's library is missing.
    """
    if not is_remote(output):
        yield Destination(Path(output), None)
        return
    place_at(output)
    folder = Path(tempfile.mkdtemp(prefix="tablemap-runs-"))
    found = Destination(folder, RemotePath(output))
    try:
        yield found
    finally:
        if found.publish_rest():  # else it is all that there is of them
            shutil.rmtree(folder, ignore_errors=True)
