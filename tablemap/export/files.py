"""Writing a set of files: all of them whole, or none."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from tablemap.errors import TablemapError


def write_files(folder: Path, files: Mapping[str, bytes]) -> tuple[Path, ...]:
    """Write the files by their names under ``folder``, replacing what bears their names.

    All are written under temporary names first, so that a full disk leaves the earlier ones.
    Raises `TablemapError` where one cannot be written.
    """
    targets = {folder / name: content for name, content in files.items()}
    temporaries = {target: target.with_name(f".{target.name}.part") for target in targets}
    try:
        for target, content in targets.items():
            target.parent.mkdir(parents=True, exist_ok=True)
            with temporaries[target].open("wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
        for target, temporary in temporaries.items():
            temporary.replace(target)
    except OSError as error:
        raise TablemapError(
            f"an export cannot be written ({error.strerror}); free some space or choose another "
            f"--output: {error.filename or folder}"
        ) from error
    finally:
        for temporary in temporaries.values():
            if temporary.parent.is_dir():
                temporary.unlink(missing_ok=True)
    return tuple(targets)
