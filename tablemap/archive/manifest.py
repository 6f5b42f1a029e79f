"""The manifest of a run: what was run on what, by which versions, and how it ended."""

from __future__ import annotations

import hashlib
import os
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from tablemap.archive.liveness import Writer
from tablemap.inputs import Input
from tablemap.version import __version__
from tablemap.words import shown_path

SCHEMA = "tablemap/manifest/1"
PACKAGES = (
    "numpy",
    "scipy",
    "open3d-cpu",
    "open3d",
    "kiss-icp",
    "rerun-sdk",
    "mcap",
    "rosbags",
    "shapely",
)

Status = Literal["running", "ok", "partial", "failed", "interrupted"]

LEAVE_A_MODEL: tuple[Status, ...] = ("ok", "partial")


class RecordingEntry(BaseModel):
    """The input of a run.

    - ``path``: the recording; the first file of a drive that has several
    - ``size``: bytes of all files
    - ``sha256``: of all files; null until they were read to their end, or if one is not local
    - ``together``: the other files of a drive that has several
    - ``raw``: the paths in hexadecimal, where they are no valid text
    """

    path: str = Field(
        description="the recording, as it was given or found; bytes that are no valid text are "
        "escaped"
    )
    size: int | None = Field(description="bytes of all files; null where one is not local")
    sha256: str | None = Field(
        description="SHA-256 of all files; null until they were read to their end, or where one is "
        "not local"
    )
    together: tuple[str, ...] = Field(
        default=(), description="the other files of a drive that has several"
    )
    raw: tuple[str, ...] = Field(
        default=(),
        description="the bytes of all paths in hexadecimal, where they are no valid text",
    )

    @staticmethod
    def of(recording: Input) -> RecordingEntry:
        """Return the entry of a recording whose bytes have not been read yet."""
        places = recording.resolved().places
        first, *others = map(shown_path, places)
        raw = () if [first, *others] == list(places) else [os.fsencode(p).hex() for p in places]
        return RecordingEntry(
            path=first, size=recording.size(), sha256=None, together=tuple(others), raw=tuple(raw)
        )

    @property
    def input(self) -> Input:
        """All files of the input, as they were read."""
        try:
            places = tuple(os.fsdecode(bytes.fromhex(place)) for place in self.raw)
        except ValueError:
            places = ()
        return Input(places or (self.path, *self.together))


class Manifest(BaseModel):
    """What was run on what, and how it ended."""

    model_config = ConfigDict(extra="ignore", populate_by_name=True)

    schema_name: str = Field(SCHEMA, alias="schema", description="name of this schema")
    run_id: str = Field(
        description="name of the run and of its folder: when it began, in UTC, and eight random "
        "hexadecimal digits",
    )
    recording: RecordingEntry = Field(description="the input")
    method: str = Field(description="tablemap, or report: the baseline")
    tables: Literal["best", "all"] | tuple[float, float] = Field(
        description="which table: best (the one seen best), all, or [x, y] (the one nearest to "
        "this place, metres in the map)",
    )
    seed: int = Field(description="start of the random numbers")
    versions: dict[str, str] = Field(
        description="versions of Python, the system, the packages and tablemap's source, by name"
    )
    started: str = Field(description="date and time in UTC, ISO 8601")
    finished: str | None = Field(
        default=None,
        description="date and time in UTC, ISO 8601; null while it runs",
    )
    timings: dict[str, FiniteFloat] = Field(
        default={}, description="seconds of wall time, by stage"
    )
    writer: Writer | None = Field(
        default=None, description="the process that writes the run; null in older manifests"
    )
    status: Status = Field(
        default="running",
        description="running; ok; partial: a model, with a loss on the way; failed; interrupted",
    )
    error: str | None = Field(
        default=None,
        description="why the run ended early, a sentence; null where it did not",
    )
    rejected: dict[int, str] = Field(
        default={},
        description="with all tables: why a surface beside the chosen table is none, by its number",
    )
    files: dict[str, str] = Field(
        default={},
        description="SHA-256 of each file of the finished run, by its name in the folder, except "
        "the manifest",
    )


@cache
def versions() -> dict[str, str]:
    """Return the versions of everything that may change a result, including this package's source.

    The source's digest distinguishes two states of a working copy with the same version.
    """
    found = {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "tablemap": __version__,
    }
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    digest = hashlib.sha256()
    source = Path(__file__).resolve().parent.parent
    for file in sorted(source.rglob("*.py")):
        digest.update(file.relative_to(source).as_posix().encode() + b"\0" + file.read_bytes())
    return {**found, "tablemap source": digest.hexdigest()[:16]}
