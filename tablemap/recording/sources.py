"""From what the user names to its messages, or a sentence that says why not."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import BinaryIO

from tablemap.errors import ProcessWarning, RecordingError
from tablemap.recording.mcap.container import Container
from tablemap.recording.mcap.index import MAGIC
from tablemap.recording.raw import Source

_OTHER_FORMATS = {
    b"#ROSBAG V": "a ROS 1 bag; convert it with `mcap convert IN.bag OUT.mcap`",
    b"SQLite format 3\0": "a ROS 2 bag in SQLite; convert it with `mcap convert IN.db3 OUT.mcap`",
    b"RRF2": "a Rerun recording, which is a result of processing and no input of it",
    b"\x1f\x8b": "packed with gzip; unpack it first",
    b"\x28\xb5\x2f\xfd": "packed with zstd; unpack it first",
    b"PK\x03\x04": "a zip archive; unpack it first",
}


def open_source(path: Path, *, warnings: list[ProcessWarning]) -> Source:
    """Open what holds a recording's messages; what is lost of it is appended to ``warnings``.

    Raises `RecordingError` where it is no MCAP that can be read.
    """
    file = _open_mcap(Path(path))
    try:
        return Container(file, warnings=warnings)
    except BaseException:
        file.close()
        raise


def _open_mcap(path: Path) -> BinaryIO:
    if path.is_dir():
        inside = sorted(each.name for each in path.glob("*.mcap"))
        hint = f"name the file inside: {', '.join(inside[:3])}" if inside else "it has none inside"
        raise RecordingError(f"Expected an MCAP file and found a folder; {hint}: {path}")
    try:
        file = path.open("rb")
    except FileNotFoundError:
        raise RecordingError(f"There is no such file: {path}") from None
    except OSError as error:
        reason = error.strerror or error
        raise RecordingError(f"The file cannot be opened ({reason}): {path}") from error
    start = file.read(64)
    if start.startswith(MAGIC):
        return file
    file.close()
    if not start:
        raise RecordingError(f"Expected an MCAP file and found an empty one: {path}")
    for signature, what in _OTHER_FORMATS.items():
        if start.startswith(signature):
            raise RecordingError(f"Expected an MCAP file and found {what}: {path}")
    what = "text" if _is_text(start) else "something else"
    raise RecordingError(f"Expected an MCAP file and found {what}: {path}")


def _is_text(start: bytes) -> bool:
    # A multi-byte letter may be cut at the end of what was read.
    return b"\0" not in start and "�" not in start.decode(errors="replace")[:-1]


def sha256(path: Path) -> str:
    """Return a file's SHA-256, read in pieces."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
