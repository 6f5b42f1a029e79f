"""One run, one folder: ``DIR/<recording-stem>/<run-id>/``.

Every file is written under a temporary name and then renamed, so that a file is always complete.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from msgspec.structs import replace

from tablemap.archive.fetching import fetched_run
from tablemap.archive.liveness import Writer, is_alive
from tablemap.archive.manifest import LEAVE_A_MODEL, Manifest, RecordingEntry, Status, versions
from tablemap.config import Config, load_config
from tablemap.errors import TablemapError
from tablemap.files import is_file, is_folder, is_link, read_text, write_whole
from tablemap.inputs import AnyInput, Input, sha256
from tablemap.model import TableModel
from tablemap.paths import AnyPath, as_path
from tablemap.remote import is_remote
from tablemap.words import safe_name, shortened

if TYPE_CHECKING:
    from tablemap.events import OtherTable

ADDED = ("exports/", "input/")
"""Folders of a run for files that are added after its end."""

MANIFEST, MODEL, TABLES = "manifest.json", "table.json", "tables"
LATEST = "latest"
RESERVE = ".reserve"
RESERVED_BYTES = 64 * 1024
"""What is kept free for the last files of a run: its manifest and its page."""


class RunFolder:
    """A run's folder, during the run and after it.

    It can be used wherever a path is expected. Methods that write raise `TablemapError` if the
    folder cannot be made or written.

    - ``path``: the folder, absolute if `load_run` opened it
    - ``url``: where the run lies on a server; ``path`` is then a copy that goes with the program
    - ``manifest``: the run's input and settings, and how it ended
    """

    def __init__(self, path: Path, manifest: Manifest, *, url: str | None = None) -> None:
        self.path = path
        self.url = url
        self.manifest = manifest
        self._made: tuple[int, int] | None = None
        self._written: dict[str, str] = {}

    def __fspath__(self) -> str:
        return str(self.path)

    def __repr__(self) -> str:
        return f"RunFolder({str(self.path)!r}, {self.manifest.status!r})"

    @property
    def address(self) -> str:
        """Where the run is found again: its place on a server, or its folder."""
        return self.url or str(self.path)

    @staticmethod
    def create(
        output: Path,
        recording: AnyInput,
        *,
        method: str,
        tables: Literal["best", "all"] | tuple[float, float],
        config: Config,
    ) -> RunFolder:
        """Make a new folder that no other run has, its manifest saying ``running``.

        Some room is taken on the disk, so that how the run ends can be written when it is full.
        """
        now = datetime.now(UTC)
        run_id = f"{now:%Y%m%dT%H%M%S}-{os.urandom(4).hex()}"
        recording = Input.of(recording)
        path = output / safe_name(recording.stem) / run_id
        _check_latest(path.parent / LATEST)
        manifest = Manifest(
            run_id=run_id,
            recording=RecordingEntry.of(recording),
            method=method,
            tables=tables,
            seed=config.seed,
            versions=versions(),
            started=now.isoformat(timespec="seconds"),
            writer=Writer.this(),
        )
        folder = RunFolder(path, manifest)
        try:
            path.mkdir(parents=True)
            folder._made = _identity(path)
            folder.update()
            (path / RESERVE).write_bytes(os.urandom(RESERVED_BYTES))
        except BaseException as error:
            shutil.rmtree(path, ignore_errors=True)
            if not isinstance(error, OSError):
                raise
            raise TablemapError(
                f"the run folder cannot be made ({error.strerror}); choose another --output: {path}"
            ) from error
        return folder

    def update(self, **changes: object) -> None:
        """Change the manifest's fields and write it."""
        self.manifest = replace(self.manifest, **changes)
        text = self.manifest.to_json()
        try:
            self.write(MANIFEST, text)
        except TablemapError:
            # Where there is no room for another file, there is that of the one that is there.
            if not self._overwrite(text.encode()):
                raise

    def finish(
        self, status: Status, *, error: str | None = None, streamed: Sequence[str] = ()
    ) -> None:
        """Write how the run ended; ``latest`` names it if it left a model, else it has none.

        ``streamed`` names files that others wrote into the folder, and that belong to the run.
        Raises `TablemapError` where the run is to leave a model and not all that was written is
        there as it was written.
        """
        with suppress(OSError):
            (self.path / RESERVE).unlink(missing_ok=True)
        found = self.hashes()
        if status in LEAVE_A_MODEL:
            self._check_whole(found, streamed)
        else:
            found = {name: digest for name, digest in found.items() if not self._drop(name)}
        finished = datetime.now(UTC).isoformat(timespec="seconds")
        self.update(status=status, error=error, finished=finished, files=found)
        if status in LEAVE_A_MODEL:
            self.become_latest()

    def _check_there(self) -> None:
        """Raise `TablemapError` where the folder is not the one that was made for the run."""
        if self._made is not None and _identity(self.path) != self._made:
            raise TablemapError(
                "the run folder was removed, renamed or replaced while the run wrote it; run it "
                f"again and leave its folder alone: {self.path}"
            )

    def _check_whole(self, found: dict[str, str], streamed: Sequence[str]) -> None:
        self._check_there()
        wrong = [name for name, digest in self._written.items() if found.get(name) != digest]
        wrong += [name for name in streamed if name not in found]
        if wrong:
            raise TablemapError(
                f"files of the run vanished or changed while it went on ({', '.join(wrong)}); run "
                f"it again and leave its folder alone: {self.path}"
            )

    def _drop(self, name: str) -> bool:
        """Remove a file if it is a model, and tell whether it was one."""
        is_model = name == MODEL or name.startswith(f"{TABLES}/")
        if is_model:
            with suppress(OSError):
                (self.path / name).unlink(missing_ok=True)
            with suppress(OSError):
                (self.path / TABLES).rmdir()
        return is_model

    def _overwrite(self, text: bytes) -> bool:
        """Write the manifest into the bytes that it has; tell whether that could be."""
        try:
            self._check_there()
            with (self.path / MANIFEST).open("r+b") as stream:
                stream.write(text)
                stream.truncate()
                stream.flush()
                os.fsync(stream.fileno())
        except (OSError, TablemapError):
            return False
        return True

    def become_latest(self) -> None:
        """Let the recording's ``latest`` point to this run."""
        link = self.path.parent / LATEST
        temporary = self.path.parent / f".latest-{self.path.name}"
        try:
            temporary.unlink(missing_ok=True)
            temporary.symlink_to(self.path.name)
            temporary.replace(link)
        except OSError as problem:
            raise TablemapError(f"{link} cannot be written ({problem.strerror}).") from problem

    def hashes(self) -> dict[str, str]:
        """Return the SHA-256 of each file that the run itself wrote, except the manifest."""
        found = {}
        for file in sorted(self.path.rglob("*")):
            name = file.relative_to(self.path).as_posix()
            hidden = any(part.startswith(".") for part in name.split("/"))
            if name == MANIFEST or hidden or name.startswith(ADDED) or not file.is_file():
                continue
            found[name] = sha256(file)
        return found

    def write(self, name: str, text: str) -> Path:
        """Write a text file of the run, completely or not at all."""
        import hashlib  # here: who only reads runs does without it

        file = self.path / name
        self._check_there()
        try:
            write_whole(file, text)
            if name != MANIFEST:
                self._written[name] = hashlib.sha256(text.encode()).hexdigest()
        except OSError as error:
            raise TablemapError(
                f"a result cannot be written ({error.strerror}); free some space or choose another "
                f"--output: {file}"
            ) from error
        return file

    @property
    def is_dead(self) -> bool:
        """Whether the run is said to go on, and the process that wrote it is gone."""
        return self.manifest.status == "running" and not is_alive(self.path, self.manifest.writer)

    @property
    def model(self) -> TableModel:
        """The run's chosen table. Raises `TablemapError` where the run left none, or goes on."""
        self.check_model()
        return TableModel.load(self.path)

    def check_model(self) -> None:
        """Raise `TablemapError` where the run left no model, or goes on."""
        self.check_ended()
        if not is_file(self.path / MODEL):
            status, error = self.manifest.status, self.manifest.error
            raise TablemapError(
                f"expected a run with a table.json, found one that left no table model ({status}"
                f"{': ' + shortened(error) if error else ''}); choose another run: {self.path}"
            )

    def check_ended(self) -> None:
        """Raise `TablemapError` where the run has not come to an end."""
        if self.manifest.status == "running":
            why = "was killed" if self.is_dead else "goes on"
            raise TablemapError(f"expected a finished run, found one that {why}: {self.path}")

    @property
    def others(self) -> tuple[OtherTable, ...]:
        """The surfaces beside the chosen table: each a model, or why it is none.

        Raises `TablemapError` if a model cannot be read.
        """
        found: dict[int, TableModel | str] = dict(self.manifest.rejected)
        for file in self.table_files[1:]:
            found[int(file.stem)] = TableModel.load(file)
        if not found:
            return ()
        from tablemap.events import OtherTable

        return tuple(OtherTable(number, found[number]) for number in sorted(found))

    @property
    def table_files(self) -> tuple[Path, ...]:
        """The files of the run's models: the chosen table's, then those of ``tables``."""
        others = (file for file in self.path.glob(f"{TABLES}/*.json") if file.stem.isdecimal())
        return (self.path / MODEL, *sorted(others))

    @property
    def config(self) -> Config:
        """Every setting of the run. Raises `ConfigError` if its file is gone or damaged."""
        return load_config(self.path / "config.toml")


def table_name(number: int) -> str:
    """Return the name, within a run, of the model of a table beside the chosen one."""
    return f"{TABLES}/{number:02d}.json"


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


def _check_latest(link: Path) -> None:
    """Raise `TablemapError` where something stands in the way of what names the last run."""
    if link.exists() and not link.is_symlink():
        raise TablemapError(
            "expected a link that names the last run, found a file or folder of that name; move "
            f"it away or choose another --output: {link}"
        )


def load_run(run: AnyPath) -> RunFolder:
    """Open a run folder; in a recording's folder of runs, open the last run that left a model.

    If none of its runs left one, the one that began last is opened. A path of a file in a run
    opens that run; a `RunFolder` is returned as it is; of a run on a
    server a copy is opened. Raises `TablemapError` if there is no run, or its manifest is damaged.
    """
    if isinstance(run, RunFolder):
        return run
    url = None
    if is_remote(run):
        path, url = fetched_run(str(run))
    else:
        path = as_path(run)
    folder = path if is_folder(path) else path.parent
    latest = folder / LATEST
    if not is_file(folder / MANIFEST) and path in (folder, latest) and is_link(latest):
        if not is_folder(latest):
            raise TablemapError(
                f"the run that this link names is gone; give another of its runs: {latest}"
            )
        folder = latest.resolve()
    elif not is_file(folder / MANIFEST) and path == folder:
        begun = sorted(folder.glob(f"*/{MANIFEST}"))  # run IDs begin with their times
        folder = begun[-1].parent if begun else folder
    return RunFolder(folder.resolve(), read_manifest(folder, given=path), url=url)


def of_several(folder: Path, given: Path) -> str | None:
    """Say that a folder has the runs of several recordings, and name one; None if it has not.

    ``given`` is what the user calls the folder.
    """
    inside = sorted(folder.glob(f"*/*/{MANIFEST}")) if is_folder(folder) else []
    if not inside:
        return None
    return (
        "expected one run, found a folder of several recordings' runs; give one of them, such as "
        f"{given / inside[0].parent.parent.name} (`tablemap runs list` has all): {given}"
    )


def read_manifest(folder: Path, *, given: Path) -> Manifest:
    """Read the manifest of a run, which may lie on a server; errors name the ``given`` path.

    Raises `TablemapError` if there is none, or it is damaged.
    """
    file = folder / MANIFEST
    try:
        return Manifest.from_json(read_text(file))
    except (FileNotFoundError, NotADirectoryError) as error:
        raise TablemapError(
            of_several(folder, given)
            or "expected a run folder with a manifest.json, found none; give the path that "
            f"`tablemap process` printed: {given}"
        ) from error
    except OSError as error:
        raise TablemapError(
            f"the run's manifest cannot be read ({error.strerror}): {file}"
        ) from error
    except ValueError as error:
        raise TablemapError(f"the run's manifest is damaged: {file}") from error


def check_writable(run: AnyPath) -> None:
    """Raise `TablemapError` where a run lies on a server: what is written to its copy is lost."""
    url = run.url if isinstance(run, RunFolder) else str(run) if is_remote(run) else None
    if url is not None:
        raise TablemapError(
            "expected a run of this machine to write to, found one on a server; name an output "
            f"folder of this machine, or copy the run to it (aws s3 sync): {url}"
        )


def load_model(model: TableModel | AnyPath) -> TableModel:
    """Return the model of a run or of a ``table.json``; a model is returned as it is.

    Raises `TablemapError` if there is none, or the file is no table model.
    """
    if isinstance(model, TableModel):
        return model
    if names_model(model):
        return TableModel.load(model)
    return load_run(model).model


def names_model(path: AnyPath) -> bool:
    """Tell whether a path is a file with a table model, and not a run."""
    if is_remote(path):
        return False
    file = as_path(path)
    return file.suffix == ".json" and file.name != MANIFEST and not is_folder(file)
