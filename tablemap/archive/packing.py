"""Packing of a run into one portable file (a tar in zstd), and unpacking."""

from __future__ import annotations

import io
import os
import secrets
import shutil
import tarfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import BinaryIO

import zstandard

from tablemap.archive.folder import RunFolder, load_run
from tablemap.archive.manifest import LEAVE_A_MODEL
from tablemap.archive.verification import INPUT, check_files, confirmed_input
from tablemap.errors import TablemapError
from tablemap.files import opened_regular, whole_file
from tablemap.inputs import files_in
from tablemap.paths import AnyPath, as_path
from tablemap.words import shortened, shown

SUFFIX = ".tar.zst"
MANIFEST = "manifest.json"
"""This file is packed last: a packed run that has it is complete."""
LEVEL = 6
PIECE = 1 << 20

MOST_BYTES = 64 * 10**9
"""What a packed run may unpack to."""
MOST_FILES = 1000
MOST_LEVELS = 16
MOST_HEADER_BYTES = 64 * 1024
"""What may stand between two files: names, times and padding."""
LAST_SECOND = 2**40
"""Times of change after this one no file system holds."""


def pack(run: AnyPath, target: AnyPath | None = None, *, with_input: bool = False) -> Path:
    """Write a finished run, and its recording if asked, into one file; equal runs give equal bytes.

    ``target`` (by default RECORDING-RUN.tar.zst in the working folder) appears only when complete,
    and replaces a file of that name. Raises `TablemapError` if the run is unfinished or was
    changed, or if the file cannot be written.
    """
    run = load_run(run)
    target = as_path(target or f"{run.path.parent.name}-{run.path.name}{SUFFIX}")
    if not target.name:
        raise TablemapError(f"expected the name of a file to pack into, found a folder: {target}")
    if run.manifest.status == "running":
        raise TablemapError(f"expected a finished run, found one that is running: {run.path}")
    _refuse_damage(run)
    root = PurePosixPath(run.path.parent.name) / run.path.name
    files = {
        file.relative_to(run.path).as_posix(): file
        for file in run.path.rglob("*")
        if file.is_file() and not file.is_symlink() and not file.name.startswith(".")
    }
    files = {name: file for name, file in files.items() if not name.startswith(f"{INPUT}/")}
    if with_input:
        for place in confirmed_input(run).paths:
            if place.is_dir():
                files |= {f"{INPUT}/{place.name}/{each.name}": each for each in files_in(place)}
            else:
                files[f"{INPUT}/{place.name}"] = place
    try:
        with whole_file(target) as part, part.open("wb") as stream:
            compressor = zstandard.ZstdCompressor(LEVEL, write_checksum=True)
            with (
                compressor.stream_writer(stream, closefd=False) as packed,
                tarfile.open(fileobj=packed, mode="w|", format=tarfile.PAX_FORMAT) as tar,
            ):
                for name in sorted(files, key=lambda name: (name == MANIFEST, name)):
                    _add(tar, files[name], str(root / name))
    except OSError as error:
        raise TablemapError(f"the run cannot be packed ({error.strerror}): {target}") from error
    return target


def unpack(file: AnyPath, output: AnyPath = "runs", *, most_bytes: int = MOST_BYTES) -> RunFolder:
    """Unpack a run to ``output/<recording>/<run>``; it is checked before it gets that name.

    No more is unpacked than the members' headers declare, and than ``most_bytes`` together. Raises
    `TablemapError` if the file is cut off, damaged, or no packed run, if a member would lie outside
    the run, has an impossible header or does not fit, or if the run is there already.
    """
    file, output = as_path(file), as_path(output)
    room = output / f".unpacking-{secrets.token_hex(4)}"
    try:
        room.mkdir(parents=True)
        with _opened(file) as packed:
            stream = _Bounded(packed)
            with tarfile.open(fileobj=stream, mode="r|", bufsize=tarfile.RECORDSIZE) as tar:
                left = most_bytes
                for count, member in enumerate(tar):
                    if count >= MOST_FILES:
                        raise TablemapError(
                            f"expected at most {MOST_FILES} files of one run, found more; nothing "
                            f"was unpacked: {file}"
                        )
                    _check_member(member, file)
                    left -= member.size
                    if left < 0:
                        raise TablemapError(
                            f"expected a run of at most {most_bytes / 1e9:g} GB, found a larger "
                            "one; nothing was unpacked; if you trust it, raise the limit "
                            f"(--limit GB): {file}"
                        )
                    stream.allow(member.size)
                    _extract(tar, member, room, file)
                    stream.allow(0)
            # The checksum at the frame's end is checked when all before it was read.
            while stream.read():
                pass
        return _settle(room, output, file)
    except (
        tarfile.TarError,
        zstandard.ZstdError,
        EOFError,
        ValueError,  # from malformed numbers in headers
        OverflowError,
        RecursionError,  # from headers of headers
    ) as error:
        raise TablemapError(
            f"the packed run is cut off, damaged or none ({shown(error)}); nothing was unpacked: "
            f"{file}"
        ) from error
    except OSError as error:
        reason = error.strerror or error
        raise TablemapError(f"the run cannot be unpacked ({reason}): {file}") from error
    finally:
        shutil.rmtree(room, ignore_errors=True)


def _refuse_damage(run: RunFolder) -> None:
    wrong = [check for check in check_files(run) if not check.passed]
    if wrong:
        names = ", ".join(f"{check.name} is {check.outcome}" for check in wrong)
        raise TablemapError(f"the run is not what was written ({names}): {run.path}")


def _add(tar: tarfile.TarFile, file: Path, name: str) -> None:
    with file.open("rb") as content:
        entry = tarfile.TarInfo(name)
        entry.size = os.fstat(content.fileno()).st_size
        entry.mtime = int(os.fstat(content.fileno()).st_mtime)
        entry.mode = 0o644
        tar.addfile(entry, content)


@contextmanager
def _opened(file: Path) -> Iterator[BinaryIO]:
    with (
        opened_regular(file) as packed,
        zstandard.ZstdDecompressor().stream_reader(packed) as stream,
    ):
        yield stream


class _Bounded(io.RawIOBase):
    """A stream that gives no more bytes than were allowed, so that nothing unpacks without end.

    The reader of tars takes headers whole into memory, whatever size they declare.
    """

    def __init__(self, stream: BinaryIO) -> None:
        super().__init__()
        self._stream = stream
        self.allow(0)

    def allow(self, size: int) -> None:
        """Allow content of ``size`` bytes, and the headers round it."""
        # The reader of tars reads whole records, of which it holds one at most.
        self._left = size + MOST_HEADER_BYTES + 2 * tarfile.RECORDSIZE

    def read(self, size: int = PIECE, /) -> bytes:
        """Return up to ``size`` bytes. Raises `tarfile.ReadError` for more than was allowed."""
        data = self._stream.read(size)
        self._left -= len(data)
        if self._left < 0:
            raise tarfile.ReadError(
                f"headers or padding of more than {MOST_HEADER_BYTES // 1024} KiB"
            )
        return data


def _check_member(member: tarfile.TarInfo, file: Path) -> None:
    """Raise `TablemapError` for what is no plain file within one run."""
    name = PurePosixPath(member.name)
    inside = 2 < len(name.parts) <= MOST_LEVELS and not any(p.startswith(".") for p in name.parts)
    is_file = member.isfile() and not member.issparse() and member.size >= 0
    if not is_file or name.is_absolute() or set("\\\0") & set(member.name) or not inside:
        raise TablemapError(
            f"expected files of one run, found {_short(member.name)}; nothing was unpacked: {file}"
        )
    if not 0 <= member.mtime < LAST_SECOND:  # neither is one that is no number
        raise TablemapError(
            f"expected a time of change, found {member.mtime} for {_short(member.name)}; nothing "
            f"was unpacked: {file}"
        )


def _short(name: str) -> str:
    return repr(shortened(shown(name)))


def _extract(tar: tarfile.TarFile, member: tarfile.TarInfo, room: Path, file: Path) -> None:
    if member.size > shutil.disk_usage(room).free:
        raise TablemapError(
            f"{_short(member.name)} needs {member.size / 1e6:.0f} MB, more than the disk has free: "
            f"{file}"
        )
    content = tar.extractfile(member)
    target = room.joinpath(*PurePosixPath(member.name).parts)
    target.parent.mkdir(parents=True, exist_ok=True)
    with target.open("xb") as stream:
        if content is not None:
            shutil.copyfileobj(content, stream, PIECE)
        stream.flush()
        os.fsync(stream.fileno())
    os.utime(target, (member.mtime, member.mtime))


def _settle(room: Path, output: Path, file: Path) -> RunFolder:
    """Check the run that was unpacked into ``room``, and move it to its place."""
    found = list(room.glob("*/*"))
    if len(found) != 1:
        raise TablemapError(f"expected one packed run, found {len(found)}: {file}")
    if not (found[0] / MANIFEST).is_file():
        raise EOFError("its last file, the manifest, is not there")
    run = load_run(found[0])
    recording, name = found[0].parent.name, found[0].name
    if run.manifest.run_id != name:
        raise TablemapError(
            f"expected the run {run.manifest.run_id}, found it under another name, {name}: {file}"
        )
    _refuse_damage(run)
    target = output / recording / name
    if target.exists():
        raise TablemapError(f"the run is there already; nothing was unpacked: {target}")
    target.parent.mkdir(exist_ok=True)
    found[0].rename(target)
    settled = load_run(target)
    if settled.manifest.status in LEAVE_A_MODEL and _is_newest(settled):
        settled.become_latest()
    return settled


def _is_newest(run: RunFolder) -> bool:
    try:
        latest = load_run(run.path.parent / "latest")
    except TablemapError:
        return True
    return (latest.manifest.finished or "") < (run.manifest.finished or "")
