"""What a bag may cost: rosbags believes what a file claims, which a hostile one exploits."""

from __future__ import annotations

import bz2
from contextlib import closing
from functools import partial
from pathlib import Path

import apsw
import lz4.frame
from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader, ReaderError
from rosbags.rosbag1.reader import Chunk, ChunkInfo, IndexData, decompressors
from rosbags.rosbag2.storage_sqlite3 import make_vfs

from tablemap.config import LimitsConfig
from tablemap.config.limits import MIB
from tablemap.remote import is_remote

_INDEX_ENTRY_BYTES = 12
_MOST_STREAMS = 1000  # of bz2 or frames of lz4 in one chunk
_MOST_PROFILE_BYTES = MIB  # of what a database says of its topics' quality of service


class BoundedReader(Reader):
    """A reader of bags of ROS 1 whose index and chunks are no larger than the file allows."""

    def __init__(self, path: Path, limits: LimitsConfig) -> None:
        super().__init__(path)
        self._limits = limits
        self._size = path.stat().st_size
        self._connections = 0
        self._entries = 0
        self._chunks: set[int] = set()
        self._unpacked: set[int] = set()
        self._unpacked_bytes = 0

    @property
    def most_unpacked(self) -> int:
        """The bytes of all messages together."""
        return max(self._limits.unpacked_mib * MIB, self._limits.expansion * self._size)

    def read_connection(self) -> Connection:
        """Read one topic. Raises `ReaderError` where there are too many, or its name is endless."""
        self._connections += 1
        if self._connections > self._limits.channels:
            raise ReaderError(f"it has more topics, {self._limits.over('channels')}")
        found = super().read_connection()
        if len(found.topic) > self._limits.name_bytes:
            raise ReaderError(f"a topic has a longer name, {self._limits.over('name_bytes')}")
        return found

    def read_chunk_info(self) -> ChunkInfo:
        """Read where a chunk is. Raises `ReaderError` where one is named twice."""
        found = super().read_chunk_info()
        if found.pos in self._chunks:
            raise ReaderError("it names one chunk twice")
        self._chunks.add(found.pos)
        return found

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """Read where messages are. Raises `ReaderError` for more than the file has room for."""
        assert self.bio is not None
        begin = self.bio.tell()
        super().read_index_data(pos, indexes)
        self._entries += (self.bio.tell() - begin) // _INDEX_ENTRY_BYTES
        if self._entries > self._limits.messages:
            raise ReaderError(f"it has more messages, {self._limits.over('messages')}")
        if self._entries > self._size // _INDEX_ENTRY_BYTES:
            raise ReaderError("its index names more messages than it has room for")

    def read_chunk(self) -> Chunk:
        """Read the head of a chunk, which is unpacked as far as the limits allow."""
        found = super().read_chunk()
        (name,) = (name for name, each in decompressors.items() if each is found.decompressor)
        return found._replace(decompressor=partial(self._unpack, name, found.datapos))

    def _unpack(self, compression: str, at: int, packed: bytes) -> bytes:
        most = self._limits.chunk_mib * MIB
        data = packed if compression == "none" else _unpack(compression, packed, most + 1)
        if len(data) > most:
            raise ReaderError(f"a chunk unpacks to too much, {self._limits.over('chunk_mib')}")
        if at not in self._unpacked:
            self._unpacked.add(at)
            self._unpacked_bytes += len(data)
        if self._unpacked_bytes > self.most_unpacked:
            raise ReaderError(f"its chunks unpack to too much, {self._limits.over('unpacked_mib')}")
        return data


def _unpack(compression: str, packed: bytes, most: int) -> bytes:
    """Return what comes out, up to ``most`` bytes. Raises `ReaderError` where it is damaged."""
    pieces: list[bytes] = []
    streams = 0
    while packed and most > 0:
        streams += 1
        if streams > _MOST_STREAMS:
            raise ReaderError(f"a chunk is made of more than {_MOST_STREAMS} packed streams")
        unpacker = (
            bz2.BZ2Decompressor() if compression == "bz2" else lz4.frame.LZ4FrameDecompressor()
        )
        while most > 0 and not unpacker.eof:
            piece = unpacker.decompress(packed, max_length=min(most, MIB))
            packed = b""
            pieces.append(piece)
            most -= len(piece)
            if not piece and unpacker.needs_input:
                raise ReaderError("a chunk is cut off")
        packed = unpacker.unused_data or b""
    return b"".join(pieces)


def check_database(path: Path) -> None:
    """Raise `ValueError` for a database of rosbag2 that claims more than it holds.

    Its tables must be tables whose cells are stored, and what it says of its topics short: rosbags
    reads that as YAML, in which a few letters can stand for gigabytes.
    """
    # As rosbags opens it; what serves a remote one is found by its name while it is referenced.
    served = make_vfs(path) if is_remote(path) else None
    with closing(
        apsw.Connection(
            f"file:{path}?immutable=1",
            flags=apsw.SQLITE_OPEN_READONLY | apsw.SQLITE_OPEN_URI,
            vfs=None if served is None else "rpathvfs",
        )
    ) as database:
        database.limit(apsw.SQLITE_LIMIT_LENGTH, 16 * MIB)
        others = database.execute(
            "SELECT name FROM sqlite_master WHERE type = 'view' OR sql LIKE 'CREATE VIRTUAL%'"
        ).fetchone()
        if others is not None:
            raise ValueError("it has tables that are not stored")
        for table in ("topics", "messages"):
            columns = {row[1]: row[6] for row in database.execute(f"PRAGMA table_xinfo({table})")}
            if any(columns.values()):
                raise ValueError(f"its table {table} has columns that are not stored")
            if "offered_qos_profiles" not in columns:
                continue
            ((size, merges),) = database.execute(
                "SELECT total(length(offered_qos_profiles)),"
                " total(instr(offered_qos_profiles, '<<')) FROM topics"
            ).fetchall()
            if not isinstance(size, float) or size > _MOST_PROFILE_BYTES or merges:
                raise ValueError("what it says of its topics is too much")
