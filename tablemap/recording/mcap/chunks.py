"""The records inside an MCAP: unpacked within bounds, checked, and split into messages.

The layout is that of the MCAP specification (mcap.dev/spec). A few kilobytes can claim to unpack to
gigabytes, so both the size that a chunk declares and the size that really comes out are bounded.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream

from tablemap.recording.raw import RawMessage

MAX_CHUNK_BYTES = 256 * 2**20
"""The most that one chunk may unpack to. Recorders write chunks of 1 to 8 MiB."""

MAX_RECORD_BYTES = 256 * 2**20
"""The most that any other record is read into memory for."""

RECORD_HEADER = struct.Struct("<BQ")
_CHUNK_HEADER = struct.Struct("<QQQII")  # start, end, declared size, CRC, length of compression
_MESSAGE_HEADER = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_PIECE_BYTES = 4 * 2**20


class DamageError(Exception):
    """Bytes that are not what the container says they are; the text completes "it ..."."""


@dataclass(frozen=True)
class Chunk:
    """A chunk's header, and its contents as they lie in the file."""

    start_ns: int
    end_ns: int
    declared_bytes: int
    crc: int
    compression: str
    packed: memoryview


def parse_chunk(content: memoryview, *, whole: bool = True) -> Chunk:
    """Take a chunk record's content apart, of which the end may be missing if it is not `whole`."""
    try:
        start_ns, end_ns, declared, crc, name_bytes = _CHUNK_HEADER.unpack_from(content)
        at = _CHUNK_HEADER.size
        compression = bytes(content[at : at + name_bytes]).decode()
        (packed_bytes,) = struct.unpack_from("<Q", content, at + name_bytes)
    except (struct.error, UnicodeDecodeError):
        raise DamageError("has a broken header") from None
    packed = content[at + name_bytes + 8 :]
    if whole and packed_bytes != len(packed):
        raise DamageError("declares another length than it has")
    return Chunk(start_ns, end_ns, declared, crc, compression, packed[:packed_bytes])


def unpack(chunk: Chunk, *, whole: bool = True) -> memoryview:
    """Return a chunk's records, checked; of a chunk that is not `whole` what can be unpacked.

    Raises `DamageError` where sizes exceed their bounds, or size or checksum are not as declared.
    """
    if chunk.declared_bytes > MAX_CHUNK_BYTES:
        raise DamageError(
            f"would unpack to {chunk.declared_bytes / 2**20:.0f} MiB, which is over the bound of "
            f"{MAX_CHUNK_BYTES // 2**20} MiB"
        )
    data = memoryview(_decompress(chunk, whole=whole))
    if not whole:
        return data
    if len(data) != chunk.declared_bytes:
        raise DamageError("does not unpack to the size that it declares")
    if chunk.crc and zlib.crc32(data) != chunk.crc:
        raise DamageError("failed its checksum")
    return data


def _decompress(chunk: Chunk, *, whole: bool) -> bytes | memoryview:
    if chunk.compression in ("", "none"):
        return chunk.packed
    bound = chunk.declared_bytes + 1  # one more than declared tells that there is more
    if chunk.compression == "zstd":
        pieces = _zstd_pieces(chunk.packed, bound)
    elif chunk.compression == "lz4":
        pieces = _lz4_pieces(chunk.packed, bound)
    else:
        raise DamageError(f"is compressed with {chunk.compression[:20]!r}, not with zstd or lz4")
    unpacked: list[bytes] = []
    try:
        unpacked.extend(pieces)
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError):
        if whole:
            raise DamageError("cannot be unpacked") from None
        # What came out before the cut is worth having.
        unpacked = list(_readable_pieces(chunk, bound))
    return unpacked[0] if len(unpacked) == 1 else b"".join(unpacked)


def _readable_pieces(chunk: Chunk, bound: int) -> Iterator[bytes]:
    """Yield what unpacks of a chunk that was cut short."""
    pieces = (_zstd_pieces if chunk.compression == "zstd" else _lz4_pieces)(chunk.packed, bound)
    while True:
        try:
            yield next(pieces)
        except (StopIteration, zstandard.ZstdError, RuntimeError, EOFError, MemoryError):
            return


def _zstd_pieces(packed: memoryview, bound: int) -> Iterator[bytes]:
    with zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True) as reader:
        while bound > 0 and (piece := reader.read(min(bound, _PIECE_BYTES))):
            bound -= len(piece)
            yield piece


def _lz4_pieces(packed: memoryview, bound: int) -> Iterator[bytes]:
    remaining: bytes | memoryview | None = packed
    decompressor = lz4.frame.LZ4FrameDecompressor()
    while bound > 0 and remaining is not None:
        piece = decompressor.decompress(remaining, max_length=min(bound, _PIECE_BYTES))
        bound -= len(piece)
        if piece:
            yield piece
        if decompressor.eof:
            remaining = decompressor.unused_data
            decompressor = lz4.frame.LZ4FrameDecompressor()
        elif decompressor.needs_input:
            return
        else:
            remaining = b""


def split(data: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Yield the opcode and content of each whole record.

    Raises `DamageError` after the last one if bytes are left over.
    """
    at, end = 0, len(data)
    while at < end:
        if end - at < RECORD_HEADER.size:
            raise DamageError("ends within a record")
        opcode, length = RECORD_HEADER.unpack_from(data, at)
        at += RECORD_HEADER.size
        if length > end - at:
            raise DamageError("ends within a record")
        yield opcode, data[at : at + length]
        at += length


def parse_message(content: memoryview) -> RawMessage:
    """Take a message record's content apart."""
    if len(content) < _MESSAGE_HEADER.size:
        raise DamageError("has a message without a header")
    channel_id, _, log_time_ns, _ = _MESSAGE_HEADER.unpack_from(content)
    return RawMessage(log_time_ns, channel_id, content[_MESSAGE_HEADER.size :])


def stream_of(content: memoryview) -> ReadDataStream:
    """Wrap a record's content for the parsers of `mcap.records`."""
    return ReadDataStream(BytesIO(content))
