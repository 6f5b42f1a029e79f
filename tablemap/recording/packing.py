"""Unpacking of files and messages that rosbag2 packed with zstd.

A few kilobytes can unpack to gigabytes, so the unpacked size is limited.
"""

from __future__ import annotations

from pathlib import Path

import zstandard

from tablemap.config import LimitsConfig
from tablemap.config.limits import MIB
from tablemap.errors import RecordingError

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"

_ALLOWANCE = 64 * MIB
_PIECE_BYTES = 4 * 2**20
_MESSAGE_PIECE_BYTES = 256 * 2**10


def unpack_file(path: Path, folder: Path, limits: LimitsConfig) -> Path:
    """Unpack a file into a folder, without the suffix of packed files, and return its path.

    Raises `RecordingError` if it is damaged, unpacks to too much, or the disk has no room.
    """
    unpacked = folder / path.stem
    left = most = limits.expansion * path.stat().st_size + _ALLOWANCE
    try:
        with (
            path.open("rb") as packed,
            unpacked.open("wb") as file,
            zstandard.ZstdDecompressor().stream_reader(
                packed, read_size=_PIECE_BYTES, read_across_frames=True
            ) as reader,
        ):
            while piece := reader.read(_PIECE_BYTES):
                left -= len(piece)
                if left < 0:
                    raise RecordingError(
                        f"The file unpacks to more than {most / MIB:.0f} MiB, "
                        f"{limits.over('expansion')}; raise the limit if it is sound: {path}"
                    )
                file.write(piece)
    except zstandard.ZstdError as error:
        raise RecordingError(f"The file cannot be unpacked ({error}): {path}") from error
    except OSError as error:
        raise RecordingError(
            f"The file cannot be unpacked into {folder.parent} ({error.strerror}); free some "
            f"space, or name another place in TMPDIR: {path}"
        ) from error
    return unpacked


def unpacked_message(data: memoryview, limits: LimitsConfig) -> memoryview:
    """Return a message's bytes, unpacked if rosbag2 packed them.

    An unpacked message of ROS 2 begins with a zero byte, so that the two cannot be confused. Raises
    `ValueError` if the bytes cannot be unpacked, or unpack to too much.
    """
    if data[:4] != ZSTD_MAGIC:
        return data
    pieces, left = [], limits.record_mib * MIB
    try:
        with zstandard.ZstdDecompressor().stream_reader(data) as reader:
            while piece := reader.read(_MESSAGE_PIECE_BYTES):
                left -= len(piece)
                if left < 0:
                    raise ValueError(f"it unpacks to too much, {limits.over('record_mib')}")
                pieces.append(piece)
    except zstandard.ZstdError as error:
        raise ValueError(f"it cannot be unpacked: {error}") from error
    return memoryview(b"".join(pieces))
