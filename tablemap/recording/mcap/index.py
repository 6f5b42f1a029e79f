"""The index of an MCAP's messages: its parts, what counts them, and what collects the losses."""

from __future__ import annotations

import struct
from collections.abc import Collection
from dataclasses import dataclass, field

from mcap import records as mcap_records
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from tablemap.config import LimitsConfig
from tablemap.config.limits import MIB
from tablemap.errors import ProcessWarning, RecordingError
from tablemap.recording.mcap.records import DamageError, stream_of
from tablemap.words import counted

MAGIC = b"\x89MCAP0\r\n"
PARSE_ERRORS = (McapError, struct.error, ValueError, DamageError)


@dataclass(frozen=True)
class Span:
    """Bytes of the file with messages: a chunk record, or a run of bare messages.

    - ``offset``, ``length``: its place in the file, bytes
    - ``start_ns``, ``end_ns``: log times of its first and its last message
    - ``channels``: those of its messages; None if it may contain any
    - ``unpacked``: about the number of bytes of its records in memory
    - ``whole``: False if the file ends within it
    """

    offset: int
    length: int
    start_ns: int
    end_ns: int
    channels: frozenset[int] | None
    unpacked: int
    is_chunk: bool = True
    whole: bool = True


class Totals:
    """Counts the sizes of a recording, and raises an error above the limits."""

    def __init__(self, limits: LimitsConfig, file_bytes: int) -> None:
        self.limits = limits
        self._allowed = max(limits.unpacked_mib * MIB, limits.expansion * file_bytes)
        self._file_bytes = file_bytes
        self._unpacked: dict[int, int] = {}
        self._sum = 0

    def unpacked(self, offset: int, size: int) -> None:
        """Count a chunk's bytes, only once for each chunk; raises `RecordingError`."""
        self._sum += size - self._unpacked.get(offset, 0)
        self._unpacked[offset] = size
        self.check_unpacked(self._sum)

    def check_unpacked(self, size: int) -> None:
        """Raise `RecordingError` if these are more bytes than the file may unpack to."""
        if size > self._allowed:
            raise RecordingError(
                f"The recording would unpack to {size / MIB:.0f} MiB or more from a file of "
                f"{self._file_bytes / MIB:.1f} MiB, {self.limits.over('unpacked_mib')} and "
                f"{self.limits.over('expansion')}; raise the limits if it is sound."
            )

    def check_count(self, name: str, count: int, what: str) -> None:
        """Raise `RecordingError` if there are more than a limit allows."""
        if count > getattr(self.limits, name):
            raise RecordingError(
                f"The recording has {count} {what} or more, {self.limits.over(name)}; raise the "
                "limit if it is sound."
            )


@dataclass
class Index:
    """The definitions, the messages a channel, the spans, and the log times of first and last."""

    totals: Totals
    schemas: dict[int, mcap_records.Schema] = field(default_factory=dict)
    channels: dict[int, mcap_records.Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    spans: list[Span] = field(default_factory=list)
    start_ns: int = 0
    end_ns: int = 0
    _doubtful: set[tuple[int, int]] = field(default_factory=set)
    _kept_bytes: int = 0

    def take_definition(self, opcode: int, content: memoryview, *, doubtful: bool = False) -> None:
        """Keep a schema or channel record, the first of its ID; ignore others.

        A ``doubtful`` record, from a damaged chunk, is replaced by one that is not.
        """
        if opcode == Opcode.SCHEMA:
            schema = mcap_records.Schema.read(stream_of(content))
            self._check_name(schema.name)
            if self._is_first(opcode, schema.id, self.schemas, doubtful=doubtful):
                self.schemas[schema.id] = schema
                self._kept_bytes += len(content)
        elif opcode == Opcode.CHANNEL:
            channel = mcap_records.Channel.read(stream_of(content))
            self._check_name(channel.topic)
            if self._is_first(opcode, channel.id, self.channels, doubtful=doubtful):
                self.channels[channel.id] = channel
                self._kept_bytes += len(content)
                self.totals.check_count("channels", len(self.channels), "channels")
        if self._kept_bytes > self.totals.limits.record_mib * MIB:
            words = self.totals.limits.over("record_mib")
            raise RecordingError(f"The recording's schemas and channels are {words}.")

    def _check_name(self, name: str) -> None:
        if len(name) > self.totals.limits.name_bytes:
            over = self.totals.limits.over("name_bytes")
            raise DamageError(f"has a name of {len(name)} letters, {over}")

    def _is_first(self, opcode: int, id: int, known: Collection[int], *, doubtful: bool) -> bool:
        if id in known and (doubtful or (opcode, id) not in self._doubtful):
            return False
        (self._doubtful.add if doubtful else self._doubtful.discard)((opcode, id))
        return True


class Losses:
    """Collects the losses: each damaged place once."""

    def __init__(self, warnings: list[ProcessWarning]) -> None:
        self.warnings = warnings
        self._offsets: set[int] = set()

    def damaged(self, offset: int, error: DamageError, *, partly: bool = False) -> None:
        """Warn that the part at ``offset`` was left out, all of it or only invalid records."""
        if offset not in self._offsets:
            self._offsets.add(offset)
            left = "its invalid records were left out" if partly else "it was left out"
            self.say(
                "recording.damaged",
                f"A part of the file that begins at byte {offset} is damaged; {left}: it {error}.",
            )

    def say(self, code: str, message: str) -> None:
        """Append a warning."""
        self.warnings.append(ProcessWarning(code, "recording", message))


def no_time(count: int) -> DamageError:
    """Return the words for messages that were left out."""
    return DamageError(f"has {counted(count, 'message')} without a header or a time")
