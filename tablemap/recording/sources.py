"""Opening of the user's input as a source of messages, or an error in one sentence."""

from __future__ import annotations

from contextlib import ExitStack, closing
from pathlib import Path
from tempfile import TemporaryDirectory

from tablemap.config import LimitsConfig
from tablemap.errors import ProcessWarning, RecordingError
from tablemap.files import opened_regular
from tablemap.inputs import AnyInput, Input
from tablemap.recording.mcap.container import Container
from tablemap.recording.mcap.index import MAGIC
from tablemap.recording.packing import ZSTD_MAGIC, unpack_file
from tablemap.recording.raw import Source
from tablemap.recording.several import Several

_BAG = b"#ROSBAG V"
_DATABASE = b"SQLite format 3\0"
_OTHER_FORMATS = {
    b"RRF2": "a Rerun recording, which is a result of processing, not an input",
    b"\x1f\x8b": "packed with gzip; unpack it first",
    b"PK\x03\x04": "a zip archive; unpack it first",
    b"version https://git-lfs": "a Git LFS pointer, not the file; fetch it with git lfs pull",
}


def open_source(
    given: AnyInput, *, warnings: list[ProcessWarning], limits: LimitsConfig | None = None
) -> Source:
    """Open the source of a recording's messages; losses are appended to ``warnings``.

    Raises `RecordingError` if it cannot be read.
    """
    limits = limits or LimitsConfig()
    with ExitStack() as opened:
        try:
            sources = [
                opened.enter_context(closing(_open_place(path, warnings, limits)))
                for path in Input.of(given).paths
            ]
        except OSError as error:
            raise RecordingError(
                f"The recording cannot be read ({error.strerror or error}): {given}"
            ) from error
        opened.pop_all()
    return sources[0] if len(sources) == 1 else Several(sources)


def _open_place(path: Path, warnings: list[ProcessWarning], limits: LimitsConfig) -> Source:
    """Open an MCAP, a bag of ROS 1, a database or a folder of rosbag2; each may be packed."""
    if path.is_dir():
        return _open_folder(path, warnings, limits)
    start = _first_bytes(path)
    if start.startswith(MAGIC):
        return _container(path, warnings, limits)
    if start.startswith((_BAG, _DATABASE)):
        from tablemap.recording.bags.bag import Bag

        return Bag(path, ros1=start.startswith(_BAG), warnings=warnings, limits=limits)
    if start.startswith(ZSTD_MAGIC):
        # An open file stays readable after its folder is removed.
        with TemporaryDirectory(prefix="tablemap-") as folder:
            return _open_place(unpack_file(path, Path(folder), limits), warnings, limits)
    expected = "Expected a recording (an MCAP or a bag) and found"
    if not start:
        raise RecordingError(f"{expected} an empty one: {path}")
    for signature, what in _OTHER_FORMATS.items():
        if start.startswith(signature):
            raise RecordingError(f"{expected} {what}: {path}")
    what = "text" if _is_text(start) else "something else"
    raise RecordingError(f"{expected} {what}: {path}")


def _open_folder(folder: Path, warnings: list[ProcessWarning], limits: LimitsConfig) -> Source:
    """Open the files of a bag's folder as one; leave out unreadable files, with a warning."""
    from tablemap.recording.bags.folder import files_of

    sources: list[Source] = []
    errors: list[RecordingError] = []
    with ExitStack() as opened:
        for file in files_of(folder, warnings=warnings):
            try:
                source = _open_place(file, warnings, limits)
                sources.append(opened.enter_context(closing(source)))
            except RecordingError as error:
                errors.append(error)
        if not sources:
            raise errors[0]
        opened.pop_all()
    warnings += [
        ProcessWarning("recording.damaged", "recording", f"A file of the bag was left out: {each}")
        for each in errors
    ]
    return sources[0] if len(sources) == 1 else Several(sources)


def _container(path: Path, warnings: list[ProcessWarning], limits: LimitsConfig) -> Container:
    file = path.open("rb")
    try:
        return Container(file, warnings=warnings, limits=limits)
    except BaseException:
        file.close()
        raise


def _first_bytes(path: Path) -> bytes:
    try:
        with opened_regular(path) as file:
            return file.read(64)
    except FileNotFoundError:
        raise RecordingError(f"there is no such file: {path}") from None
    except OSError as error:
        reason = error.strerror or error
        raise RecordingError(f"The file cannot be opened ({reason}): {path}") from error


def _is_text(start: bytes) -> bool:
    # A multi-byte letter may be cut at the end of what was read.
    return b"\0" not in start and "�" not in start.decode(errors="replace")[:-1]
