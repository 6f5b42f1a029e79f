"""Paths as callers may give them."""

from __future__ import annotations

import os
from pathlib import Path

from tablemap.errors import TablemapError
from tablemap.remote import is_remote, place_at

AnyPath = str | os.PathLike[str]
"""A path as text or as an object that stands for one; a `tablemap.RunFolder` is such an object."""


def as_path(given: AnyPath) -> Path:
    """Return the path. Raises `TablemapError` for a value that cannot be one of this machine."""
    if is_remote(given):
        raise TablemapError(
            "expected a path of this machine, found a place on a server; copy what is there to "
            f"this machine, or what was written here to the server (aws s3 sync): {given}"
        )
    try:
        path = Path(given)
    except TypeError as error:
        raise TablemapError(
            f"expected a path, found {type(given).__name__}; give a text or a Path: {given!r}"
        ) from error
    if "\0" in str(path):
        raise TablemapError(f"expected a path, found a text with a null character: {given!r}")
    return path


def as_place(given: AnyPath) -> Path:
    """Return what reads a path of this machine or a place on a server.

    Raises `TablemapError` for a value that can be neither.
    """
    return place_at(str(given)) if is_remote(given) else as_path(given)
