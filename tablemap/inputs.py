"""The input of a run: a file, a bag's folder, or several of them from one drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath

from tablemap.errors import RecordingError
from tablemap.files import opened_regular
from tablemap.paths import AnyPath, as_path
from tablemap.remote import is_remote, place_at

SUFFIXES = (".mcap", ".db3", ".bag")
PACKED_SUFFIXES = (".zst", ".zstd")
METADATA = "metadata.yaml"
"""The file in a folder of rosbag2 that lists its files."""


@dataclass(frozen=True)
class Input:
    """The files or folders of one drive's recording, which are read as one.

    As a path it is the first of them. ``places``: paths or URLs as they were given, at least one.
    """

    places: tuple[str, ...]

    @staticmethod
    def of(given: AnyInput) -> Input:
        """Return what a caller gave: a path, several that belong together, or an input itself.

        Raises `TablemapError` for what can be no path, and `RecordingError` for no path at all.
        """
        if isinstance(given, Input):
            return given
        if isinstance(given, Sequence) and not isinstance(given, str | bytes):
            paths: list[AnyPath] = list(given)
        else:
            paths = [given]
        if not paths:
            raise RecordingError("expected a recording, found none.")
        found = [
            place_at(path) if isinstance(path, str) and is_remote(path) else as_path(path)
            for path in paths
        ]
        # A bag is often named by what lies in its folder.
        found = [path.parent if path.name == METADATA else path for path in found]
        return Input(tuple(dict.fromkeys(map(str, found))))

    def __str__(self) -> str:
        more = len(self.places) - 1
        return f"{self.places[0]} and {more} more" if more else self.places[0]

    def __fspath__(self) -> str:
        return self.places[0]

    @property
    def paths(self) -> tuple[Path, ...]:
        """The places as paths."""
        return tuple(map(place_at, self.places))

    @property
    def path(self) -> Path:
        """The first place."""
        return place_at(self.places[0])

    @property
    def is_remote(self) -> bool:
        """Whether a place is not on this machine."""
        return any(map(is_remote, self.places))

    @property
    def name(self) -> str:
        """The first place's own name."""
        return self.path.name or self.path.resolve().name

    @property
    def stem(self) -> str:
        """The name for runs of it: the first place's name without its suffixes."""
        if self.path.is_dir():
            return self.name
        name = PurePath(self.name)
        return PurePath(name.stem).stem if name.suffix in PACKED_SUFFIXES else name.stem

    def resolved(self) -> Input:
        """Return the same input by absolute paths, links followed."""
        return Input(tuple(str(path.resolve()) for path in self.paths))

    def absolute(self) -> Input:
        """Return the same input by absolute paths, links kept: their names are the runs'."""
        return Input(
            tuple(
                place if is_remote(place) else str(Path(place).absolute()) for place in self.places
            )
        )

    def check(self) -> None:
        """Raise `RecordingError` if a place is neither a file nor a folder with recordings."""
        for path in self.paths:
            try:
                is_folder = path.is_dir()
                if is_folder:
                    next(path.iterdir(), None)
                else:
                    path.stat()
            except (FileNotFoundError, NotADirectoryError) as error:
                raise RecordingError(f"there is no such file: {path}") from error
            except OSError as error:
                what = "folder" if path.is_dir() else "file"
                raise RecordingError(
                    f"the {what} cannot be read ({error.strerror}): {path}"
                ) from error
            if is_folder and not any(files_in(path)):
                raise RecordingError(
                    f"expected a recording, found a folder with none inside: {path}"
                )
            if not (is_folder or path.is_file()):
                raise RecordingError(f"expected a recording, found no regular file: {path}")

    def exists(self) -> bool:
        """Tell whether all places exist."""
        try:
            return all(path.exists() for path in self.paths)
        except OSError:
            return False

    def files(self) -> list[Path]:
        """Return the files of all places, a folder's by their names."""
        return [file for path in self.paths for file in (files_in(path) or [path])]

    def size(self) -> int:
        """Return the bytes of all files. Raises `RecordingError` where one cannot be read."""
        try:
            return sum(file.stat().st_size for file in self.files())
        except OSError as error:
            raise RecordingError(f"the file cannot be read ({error.strerror}): {self}") from error

    def sha256(self) -> str | None:
        """Return the SHA-256: a file's own; of several that of the lines of ``sha256sum``.

        None for what is remote, of which only parts are read.
        These have each file's hash, two blanks and its name alone, in the order of the places.
        Raises `RecordingError` where a file cannot be read.
        """
        import hashlib  # here: who only names an input does without it

        if self.is_remote:
            return None
        files = self.files()
        if len(files) == 1 and files[0] == self.path:
            return sha256(files[0])
        lines = (f"{sha256(file)}  {file.name}\n" for file in files)
        return hashlib.sha256("".join(lines).encode()).hexdigest()


AnyInput = AnyPath | Sequence[AnyPath] | Input
"""A recording: a path, or several of one drive."""


def files_in(folder: Path) -> list[Path]:
    """Return a folder's recordings and a bag's metadata file, by name; nothing for a file."""
    try:
        inside = sorted(folder.iterdir()) if folder.is_dir() else []
    except OSError:
        return []
    return [file for file in inside if file.name == METADATA or is_recording(file)]


def is_recording(file: Path) -> bool:
    """Tell by its name whether a file may hold messages."""
    name = file.with_suffix("") if file.suffix in PACKED_SUFFIXES else file
    return name.suffix in SUFFIXES and file.is_file()


def sha256(path: AnyPath) -> str:
    """Return a file's SHA-256, read in pieces. Raises `RecordingError` where it cannot be read."""
    import hashlib

    try:
        with opened_regular(as_path(path)) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        reason = error.strerror or error
        raise RecordingError(f"the file cannot be read ({reason}): {path}") from error
