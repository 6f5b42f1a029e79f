"""The index of an MCAP as the summary at its end gives it."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from itertools import pairwise
from typing import BinaryIO

from mcap import records as mcap_records
from mcap.opcode import Opcode

from tablemap.config.limits import MIB
from tablemap.recording.mcap.index import MAGIC, PARSE_ERRORS, Index, Losses, Span, Totals
from tablemap.recording.mcap.records import RECORD_HEADER, DamageError, split, stream_of
from tablemap.recording.raw import LATEST_NS

_FOOTER_BYTES = RECORD_HEADER.size + 20 + len(MAGIC)
_MOST_SUMMARY_BYTES = 64 * MIB  # with a longer summary the file itself is read


def read_summary(file: BinaryIO, losses: Losses, totals: Totals) -> Index | None:
    """Return the index from the summary; None if the summary is not usable."""
    size = file.seek(0, 2)
    file.seek(max(size - _FOOTER_BYTES, 0))
    footer = file.read(_FOOTER_BYTES)
    if len(footer) < _FOOTER_BYTES or not footer.endswith(MAGIC):
        return None  # cut short: reading front to back says where
    opcode, length = RECORD_HEADER.unpack_from(footer)
    start, _, crc = struct.unpack_from("<QQI", footer, RECORD_HEADER.size)
    summary_bytes = size - _FOOTER_BYTES - start
    try:
        if opcode != Opcode.FOOTER or length != 20:
            raise DamageError("has a broken footer")
        if start == 0:
            return None  # written without a summary, which is no loss
        if summary_bytes < 0:
            raise DamageError("is not where the footer says")
        if summary_bytes > _MOST_SUMMARY_BYTES:
            return None
        file.seek(start)
        data = memoryview(file.read(summary_bytes))
        if crc and zlib.crc32(footer[: RECORD_HEADER.size + 16], zlib.crc32(data)) != crc:
            raise DamageError("failed its checksum")
        return _parse_summary(data, start, totals)
    except PARSE_ERRORS as error:
        why = error if isinstance(error, DamageError) else "cannot be parsed"
        losses.say(
            "recording.damaged",
            f"The file's summary {why}; the file was read front to back instead.",
        )
        return None


def _parse_summary(data: memoryview, data_end: int, totals: Totals) -> Index | None:
    """Return the index of a summary; its chunks must end before a byte of the file."""
    index = Index(totals)
    statistics: mcap_records.Statistics | None = None
    mentioned: set[int] = set()
    unpacked = 0
    for opcode, begin, end in split(data):
        content = data[begin:end]
        index.take_definition(opcode, content)
        if opcode == Opcode.STATISTICS:
            statistics = mcap_records.Statistics.read(stream_of(content))
        elif opcode == Opcode.CHUNK_INDEX:
            chunk = mcap_records.ChunkIndex.read(stream_of(content))
            held = frozenset(chunk.message_index_offsets)
            mentioned |= held
            unpacked += chunk.uncompressed_size
            index.spans.append(
                Span(
                    chunk.chunk_start_offset,
                    chunk.chunk_length,
                    min(chunk.message_start_time, LATEST_NS),
                    min(chunk.message_end_time, LATEST_NS),
                    held or None,
                    chunk.uncompressed_size,
                )
            )
    _check_apart(index.spans, data_end)
    if statistics is None or len(index.spans) < max(statistics.chunk_count, 1):
        return None  # unchunked, or written without what would spare the reading
    if not mentioned | set(statistics.channel_message_counts) <= set(index.channels):
        return None
    totals.check_unpacked(unpacked)
    index.counts = dict(statistics.channel_message_counts)
    totals.check_count("messages", sum(index.counts.values()), "messages")
    index.start_ns = min(statistics.message_start_time, LATEST_NS)
    index.end_ns = min(statistics.message_end_time, LATEST_NS)
    return index


def _check_apart(spans: Iterable[Span], data_end: int) -> None:
    """Raise `DamageError` where chunks share bytes, or lie outside of the file's data."""
    places = sorted((span.offset, span.offset + span.length) for span in spans)
    if places and places[-1][1] > data_end:
        raise DamageError("points out of the file's data")
    if any(end > start for (_, end), (start, _) in pairwise(places)):
        raise DamageError("names one part of the file twice")
