"""Paths as callers may give them."""

from __future__ import annotations

import os
from pathlib import Path

from tablemap.errors import TablemapError

AnyPath = str | os.PathLike[str]
"""A path as text or as an object that stands for one; a `tablemap.RunFolder` is such an object."""


def as_path(given: AnyPath) -> Path:
    """Return the path. Raises `TablemapError` for a value that cannot be one."""
    try:
        path = Path(given)
    except TypeError as error:
        raise TablemapError(
            f"expected a path, found {type(given).__name__}; give a text or a Path: {given!r}"
        ) from error
    if "\0" in str(path):
        raise TablemapError(f"expected a path, found a text with a null character: {given!r}")
    return path
