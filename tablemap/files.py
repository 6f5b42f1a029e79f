"""Writing files so that each is there whole or not at all, whatever ends the program."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def whole_file(target: Path) -> Iterator[Path]:
    """Hand out the path to write to; what is there at the end becomes ``target``.

    Its folder is made. An earlier file of that name stays until then, and stays for good where
    anything is raised. Raises `OSError` where the disk says no.
    """
    with whole_files([target]) as (part,):
        yield part


@contextmanager
def whole_files(targets: Sequence[Path]) -> Iterator[list[Path]]:
    """Hand out one path to write to for each target; at the end they take their names, in order.

    None does before all have reached the disk: a full one leaves the earlier files as they were.
    """
    # Two programs may write one file at a time: the last one's stays, and it is whole.
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
