"""A chunk of an MCAP: its header taken apart, its records unpacked within bounds.

The layout is that of the MCAP specification (mcap.dev/spec). A few kilobytes can claim to unpack to
gigabytes, so both the size that a chunk declares and the size that really comes out are bounded.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import lz4.frame
import numpy as np
import zstandard

from tablemap.config import LimitsConfig
from tablemap.config.limits import MIB
from tablemap.recording.mcap.records import DamageError

_CHUNK_HEADER = struct.Struct("<QQQII")  # start, end, declared size, CRC, length of compression
_PIECE_BYTES = 4 * MIB
_MOST_FRAMES = 64  # of lz4 in a chunk: recorders write one
_MAGICS = {b"\x28\xb5\x2f\xfd": "zstd", b"\x04\x22\x4d\x18": "lz4"}


@dataclass(frozen=True)
class Chunk:
    """A chunk's header, and its contents as they lie in the file."""

    start_ns: int
    end_ns: int
    declared_bytes: int
    crc: int
    compression: str
    packed: memoryview


@dataclass(frozen=True)
class Unpacked:
    """A chunk's records, and their damage, None if they are as declared."""

    data: memoryview
    damage: DamageError | None


def parse_chunk(content: memoryview, *, whole: bool = True) -> Chunk:
    """Parse a chunk record's content; its end may be missing if it is not `whole`."""
    try:
        start_ns, end_ns, declared, crc, name_bytes = _CHUNK_HEADER.unpack_from(content)
        at = _CHUNK_HEADER.size
        if name_bytes > len(content):
            raise DamageError("has a broken header")
        name = bytes(content[at : at + name_bytes])
        (packed_bytes,) = struct.unpack_from("<Q", content, at + name_bytes)
    except struct.error:
        raise DamageError("has a broken header") from None
    packed = content[at + name_bytes + 8 :]
    if whole and packed_bytes != len(packed):
        raise DamageError("declares another length than it has")
    packed = packed[:packed_bytes]
    compression = name.decode(errors="replace")
    if compression not in ("", "none", "zstd", "lz4"):  # the contents say it too
        compression = _MAGICS.get(bytes(packed[:4]), compression)
    return Chunk(start_ns, end_ns, declared, crc, compression, packed)


def unpack(chunk: Chunk, limits: LimitsConfig, *, whole: bool = True) -> Unpacked:
    """Return a chunk's records, as far as they can be unpacked, and their damage.

    If the chunk is not `whole`, size and checksum are not checked. Raises `DamageError` if the
    declared size is over its limit, or nothing can be unpacked.
    """
    if chunk.declared_bytes > limits.chunk_mib * MIB:
        raise DamageError(
            f"would unpack to {chunk.declared_bytes / MIB:.0f} MiB, {limits.over('chunk_mib')}"
        )
    damage: DamageError | None = None
    if chunk.compression in ("", "none"):
        data = chunk.packed
    else:
        data, damage = _decompress(chunk)
    if not whole:
        return Unpacked(data[: chunk.declared_bytes], None)
    intact = len(data) == chunk.declared_bytes
    if chunk.crc and zlib.crc32(data) != chunk.crc:
        damage = damage or DamageError("failed its checksum")
    elif damage is None and not intact:
        damage = DamageError("does not unpack to the size that it declares")
    return Unpacked(data[: chunk.declared_bytes], damage)


def _decompress(chunk: Chunk) -> tuple[memoryview, DamageError | None]:
    """Return what comes out, one byte more than declared at most, which tells that there is more.

    The buffer's memory is taken from the system only as it is filled.
    """
    buffer = np.empty(chunk.declared_bytes + 1, np.uint8).data
    if chunk.compression == "zstd":
        pieces = _zstd_pieces(chunk.packed, buffer)
    elif chunk.compression == "lz4":
        pieces = _lz4_pieces(chunk.packed, buffer)
    else:
        raise DamageError(f"is compressed with {chunk.compression[:20]!r}, not with zstd or lz4")
    filled = 0
    try:
        for count in pieces:
            filled += count
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError):
        return buffer[:filled], DamageError("cannot be unpacked")
    except DamageError as error:
        return buffer[:filled], DamageError(str(error))  # without the frames that hold the buffer
    return buffer[:filled], None


def _zstd_pieces(packed: memoryview, buffer: memoryview) -> Iterator[int]:
    """Fill the buffer; yield how many bytes were added."""
    at = 0
    with zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True) as reader:
        while at < len(buffer) and (count := reader.readinto(buffer[at : at + _PIECE_BYTES])):
            at += count
            yield count


def _lz4_pieces(packed: memoryview, buffer: memoryview) -> Iterator[int]:
    """Fill the buffer; yield how many bytes were added."""
    remaining: bytes | memoryview | None = packed
    at = frames = 0
    decompressor = lz4.frame.LZ4FrameDecompressor()
    while at < len(buffer) and remaining is not None:
        most = min(len(buffer) - at, _PIECE_BYTES)
        piece = decompressor.decompress(remaining, max_length=most)
        buffer[at : at + len(piece)] = piece
        at += len(piece)
        yield len(piece)
        if decompressor.eof:
            frames += 1
            if frames > _MOST_FRAMES:
                raise DamageError(f"is made of more than {_MOST_FRAMES} lz4 frames")
            remaining = decompressor.unused_data
            decompressor = lz4.frame.LZ4FrameDecompressor()
        elif decompressor.needs_input:
            return
        else:
            remaining = b""
