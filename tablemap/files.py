"""Files as they should be: those that are written are whole, those that are read are files.

A file that is written is complete or does not exist, even if the program is killed. What is read as
a text must be a regular file of a sane size, for the others never end: pipes and devices.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from io import BufferedReader
from pathlib import Path

MOST_TEXT_BYTES = 8 * 2**20
"""Manifests, models and settings are kilobytes."""

_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}


@contextmanager
def opened_regular(file: Path) -> Iterator[BufferedReader]:
    """Open a file for reading. Raises `OSError` where it is a pipe, a device or a folder."""
    check_regular(file)
    with file.open("rb") as stream:
        yield stream


def check_regular(file: Path) -> None:
    """Raise `OSError` where there is no file, or a pipe, a device or a folder."""
    kind = stat.S_IFMT(file.stat().st_mode)
    if kind != stat.S_IFREG:
        what = _KINDS.get(kind, "something else")
        raise OSError(errno.EINVAL, f"it is {what}, no regular file", str(file))


def read_text(file: Path, *, most_bytes: int = MOST_TEXT_BYTES) -> str:
    """Return the text of a regular file in UTF-8.

    Raises `OSError` if it cannot be read, is no regular file or has more than ``most_bytes``, and
    `UnicodeDecodeError` if it is no text.
    """
    return read_bytes(file, most_bytes=most_bytes).decode("utf-8")


def read_bytes(file: Path, *, most_bytes: int) -> bytes:
    """Return the bytes of a regular file. Raises `OSError` as `read_text` does."""
    with opened_regular(file) as stream:
        data = stream.read(most_bytes + 1)
    if len(data) > most_bytes:
        words = f"it is larger than {most_bytes / 2**20:.0f} MiB"
        raise OSError(errno.EFBIG, words, str(file))
    return data


def is_file(file: Path) -> bool:
    """Tell whether there is a regular file; false also where the path can be none."""
    try:
        return file.is_file()
    except (OSError, ValueError):
        return False


def is_link(path: Path) -> bool:
    """Tell whether there is a symbolic link; false also where the path can be none."""
    try:
        return path.is_symlink()
    except (OSError, ValueError):
        return False


def is_folder(path: Path) -> bool:
    """Tell whether there is a folder; false also where the path can be none."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


@contextmanager
def whole_file(target: Path) -> Iterator[Path]:
    """Give a temporary path to write to; at the end that file is renamed to ``target``.

    The folder is made. An earlier file of that name stays until then; if an error is raised, it
    stays for good. Raises `OSError` if the disk cannot be written.
    """
    with whole_files([target]) as (part,):
        yield part


_FULL = (errno.ENOSPC, errno.EDQUOT)


@contextmanager
def whole_files(targets: Sequence[Path]) -> Iterator[list[Path]]:
    """Give one temporary path for each target; at the end the files are renamed, in order.

    No file is renamed before all have reached the disk: a full disk leaves the earlier files as
    they were.
    """
    # If two programs write one file at the same time, the last one's stays, and it is complete.
    parts = [target.with_name(f".{target.name}.{os.getpid()}.part") for target in targets]
    try:
        for target in targets:
            target.parent.mkdir(parents=True, exist_ok=True)
        yield parts
        for part in parts:
            with part.open("r+b") as stream:
                os.fsync(stream.fileno())
        for part, target in zip(parts, targets, strict=True):
            part.replace(target)
    except OSError as error:  # what failed is the file that was asked for
        named = dict(zip(map(str, parts), targets, strict=True))
        if str(error.filename) in named:
            error.filename = str(named[str(error.filename)])
        elif error.errno in _FULL and error.filename is None:  # a full disk does not say which
            error.filename = str(targets[0])
        raise
    finally:
        for part in parts:
            with suppress(OSError):
                part.unlink(missing_ok=True)


def write_whole(target: Path, content: str | bytes) -> None:
    """Write a file, whole or not at all; text goes out as UTF-8 with its line ends as they are."""
    with whole_file(target) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)
