"""The recordings to process, the way to process each, and the runs that exist already."""

from __future__ import annotations

import glob
from collections.abc import Callable, Collection, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path

from tablemap.archive.folder import RunFolder, read_manifest
from tablemap.archive.manifest import LEAVE_A_MODEL, versions
from tablemap.config import Config, dump_config
from tablemap.errors import ConfigError, TablemapError
from tablemap.events import StageStarted
from tablemap.files import is_file, read_text
from tablemap.inputs import AnyInput, Input
from tablemap.paths import AnyPath, as_path
from tablemap.remote import is_remote
from tablemap.runs.running import Follow, Outcome, run
from tablemap.words import safe_name

TRIES = 2
"""How often a recording is started if its workers die."""

Progress = Callable[[Input, StageStarted], None]


@dataclass(frozen=True)
class Job:
    """The way to process recordings: arguments of `tablemap.runs.running.run`."""

    output: Path
    config: Config
    follow: Follow = nullcontext

    def __call__(self, recording: AnyInput, progress: Callable[[object], None]) -> Outcome:
        """Process one recording."""
        return run(
            recording,
            output=self.output,
            config=self.config,
            progress=progress,
            follow=self.follow,
        )


def expand(arguments: Sequence[AnyPath], *, together: bool = False) -> list[Input]:
    """Return the named recordings, each once: paths, globs and ``@list.txt``.

    A list has one path or glob a line, relative to the working folder. Blank lines and lines that
    begin with ``#`` are ignored. A glob without a match is taken as a path, as in a shell. With
    ``together`` all recordings belong to one drive. Raises `ConfigError` if a list cannot be
    read, or has none.
    """
    names: list[str] = []
    for argument in map(_text, arguments):
        if not argument.startswith("@") or Path(argument).exists():
            names.append(argument)
            continue
        try:
            lines = read_text(Path(argument[1:])).splitlines()
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", None) or error
            raise ConfigError(
                f"the list of recordings cannot be read ({reason}): {argument[1:]}"
            ) from error
        listed = [line.strip() for line in lines if line.strip() and not line.startswith("#")]
        if not listed:
            raise ConfigError(f"expected a recording a line, found none: {argument[1:]}")
        names += listed
    paths: dict[str, None] = {}
    for name in names:
        taken = is_remote(name) or Path(name).exists()
        matches = [] if taken else sorted(_glob(name))
        # As a path spells them: ./a.mcap is a.mcap.
        paths.update(dict.fromkeys([name] if is_remote(name) else map(_spelled, matches or [name])))
    return [Input.of(list(paths))] if together else [Input.of(path) for path in paths]


def done_already(recording: AnyInput, job: Job) -> RunFolder | None:
    """Return the newest run with a model from the same bytes, the same config and versions.

    The recording is read (for its SHA-256) only if everything else is the same.
    """
    recording = Input.of(recording)
    if recording.is_remote or not recording.exists():
        return None
    digest = None
    for held in runs_of(recording, job.output):
        manifest = held.manifest
        if (
            manifest.status not in LEAVE_A_MODEL
            or _comparable(manifest.versions) != _comparable(versions())
            or manifest.recording.size != recording.size()
            or not is_file(held.path / "table.json")
            or not _has_text(held.path / "config.toml", dump_config(job.config))
        ):
            continue
        digest = digest or recording.sha256()
        if manifest.recording.sha256 == digest:
            return held
    return None


def runs_of(recording: AnyInput, output: Path) -> list[RunFolder]:
    """Return the runs of recordings of that name, newest first."""
    found = []
    for path in sorted(
        (output / safe_name(Input.of(recording).stem)).glob("*/manifest.json"), reverse=True
    ):
        if not path.parent.is_symlink():
            with suppress(TablemapError):  # an unreadable run cannot be the right one
                manifest = read_manifest(path.parent, given=path.parent)
                found.append(RunFolder(path.parent, manifest))
    return found


def mark_lost(
    recording: Input, output: Path, error: str, *, known: Collection[str]
) -> list[RunFolder]:
    """Mark the runs that dead workers left behind, and return them, newest first.

    ``known`` are the IDs of runs that existed before the first worker began.
    """
    lost = []
    for left in runs_of(recording, output):
        manifest = left.manifest
        if manifest.run_id in known or manifest.recording.input != recording.resolved():
            continue
        if manifest.status == "running":
            # Another program may process it too, here; of another machine nothing can be told.
            if not left.is_dead and (manifest.writer is None or manifest.writer.is_here):
                continue
            with suppress(TablemapError):
                left.finish("interrupted", error=error)
        if left.manifest.status in ("running", "interrupted"):
            lost.append(left)
    return lost


def _text(given: AnyPath) -> str:
    return given if isinstance(given, str) and is_remote(given) else str(as_path(given))


def _spelled(name: str) -> str:
    return str(Path(name))


def _glob(pattern: str) -> list[str]:
    return glob.glob(pattern, recursive=True)  # noqa: PTH207 - Path's takes no absolute pattern


def _has_text(file: Path, text: str) -> bool:
    try:
        return read_text(file) == text
    except (OSError, UnicodeDecodeError):
        return False


def _comparable(found: dict[str, str]) -> dict[str, str]:
    """Return versions without the platform: an update of the system needs no new run."""
    return {name: version for name, version in found.items() if name != "platform"}
