"""Writing of files: each is complete or does not exist, even if the program is killed."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def whole_file(target: Path) -> Iterator[Path]:
    """Give a temporary path to write to; at the end that file is renamed to ``target``.

    The folder is made. An earlier file of that name stays until then; if an error is raised, it
    stays for good. Raises `OSError` if the disk cannot be written.
    """
    with whole_files([target]) as (part,):
        yield part


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
    finally:
        for part in parts:
            with suppress(OSError):
                part.unlink(missing_ok=True)


def write_whole(target: Path, content: str | bytes) -> None:
    """Write a file, whole or not at all; text goes out as UTF-8 with its line ends as they are."""
    with whole_file(target) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)
