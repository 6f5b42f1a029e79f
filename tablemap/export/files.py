"""Writing a set of files: all of them whole, or none."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tablemap.errors import TablemapError
from tablemap.files import whole_files


def write_files(folder: Path, files: Mapping[str, bytes]) -> tuple[Path, ...]:
    """Write the files by their names under ``folder``, replacing files of these names.

    All are first written under temporary names, so that a full disk leaves the earlier files.
    Raises `TablemapError` if a file cannot be written.
    """
    targets = tuple(folder / name for name in files)
    try:
        with whole_files(targets) as parts:
            for part, content in zip(parts, files.values(), strict=True):
                part.write_bytes(content)
    except OSError as error:
        raise TablemapError(
            f"an export cannot be written ({error.strerror}); free some space or choose another "
            f"--output: {error.filename or folder}"
        ) from error
    return targets
