"""The manifest of a run: what was run on what, by which versions, and how it ended."""

import json
import os
import platform
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta, field

from tablemap.archive.liveness import Writer
from tablemap.inputs import Input
from tablemap.model.documents import DocumentPart, parsed
from tablemap.schemas import MOST
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


class RecordingEntry(DocumentPart, frozen=True, kw_only=True):
    """The input of a run.

    - ``path``: the recording; the first file of a drive that has several
    - ``size``: bytes of all files
    - ``sha256``: of all files; null until they were read to their end, or if one is not local
    - ``together``: the other files of a drive that has several
    - ``raw``: the paths in hexadecimal, where they are no valid text
    """

    path: Annotated[
        str,
        Meta(
            description="the recording, as it was given or found; bytes that are no valid text "
            "are escaped",
        ),
    ]
    size: Annotated[int | None, Meta(description="bytes of all files; null where one is not local")]
    sha256: Annotated[
        str | None,
        Meta(
            description="SHA-256 of all files; null until they were read to their end, or where "
            "one is not local",
        ),
    ]
    together: Annotated[
        tuple[str, ...],
        Meta(description="the other files of a drive that has several"),
    ] = ()
    raw: Annotated[
        tuple[str, ...],
        Meta(description="the bytes of all paths in hexadecimal, where they are no valid text"),
    ] = ()

    @staticmethod
    def of(recording: Input) -> "RecordingEntry":
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


class Manifest(DocumentPart, frozen=True, kw_only=True):
    """What was run on what, and how it ended."""

    schema_name: Annotated[
        str,
        Meta(description="name of this schema"),
    ] = field(default=SCHEMA, name="schema")
    run_id: Annotated[
        str,
        Meta(
            description="name of the run and of its folder: when it began, in UTC, and eight "
            "random hexadecimal digits",
        ),
    ]
    recording: Annotated[RecordingEntry, Meta(description="the input")]
    method: Annotated[str, Meta(description="tablemap, or report: the baseline")]
    tables: Annotated[
        Literal["best", "all"] | tuple[float, float],
        Meta(
            description="which table: best (the one seen best), all, or [x, y] (the one nearest "
            "to this place, metres in the map)",
        ),
    ]
    seed: Annotated[int, Meta(description="start of the random numbers")]
    versions: Annotated[
        dict[str, str],
        Meta(
            description="versions of Python, the system, the packages and tablemap's source, by "
            "name",
        ),
    ]
    started: Annotated[str, Meta(description="date and time in UTC, ISO 8601")]
    finished: Annotated[
        str | None,
        Meta(description="date and time in UTC, ISO 8601; null while it runs"),
    ] = None
    timings: Annotated[
        dict[str, Annotated[float, Meta(ge=-MOST, le=MOST)]],
        Meta(description="seconds of wall time, by stage"),
    ] = field(default_factory=dict)
    writer: Annotated[
        Writer | None,
        Meta(description="the process that writes the run; null in older manifests"),
    ] = None
    status: Annotated[
        Status,
        Meta(
            description="running; ok; partial: a model, with a loss on the way; failed; "
            "interrupted",
        ),
    ] = "running"
    error: Annotated[
        str | None,
        Meta(description="why the run ended early, a sentence; null where it did not"),
    ] = None
    rejected: Annotated[
        dict[int, str],
        Meta(
            description="with all tables: why a surface beside the chosen table is none, by its "
            "number",
        ),
    ] = field(default_factory=dict)
    files: Annotated[
        dict[str, str],
        Meta(
            description="SHA-256 of each file of the finished run, by its name in the folder, "
            "except the manifest",
        ),
    ] = field(default_factory=dict)

    def to_json(self) -> str:
        """Return the text of ``manifest.json``."""
        return json.dumps(self.fields(), indent=1, ensure_ascii=False) + "\n"

    @staticmethod
    def from_json(text: str | bytes) -> "Manifest":
        """Read ``manifest.json``; unknown fields are ignored.

        Raises `DocumentError` if the text is no manifest.
        """
        return Manifest.read(parsed(text, "manifest"), "manifest")


@cache
def versions() -> dict[str, str]:
    """Return the versions of everything that may change a result, including this package's source.

    The source's digest distinguishes two states of a working copy with the same version.
    """
    # Imported here: who reads a manifest does without them.
    import hashlib
    from importlib.metadata import PackageNotFoundError, version

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
