"""A recording as raw messages on channels, from an MCAP, a bag or several files."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from tablemap.geometry import Ints

LATEST_NS = 2**63 - 1
"""The last valid time: in the year 2262."""


@dataclass(frozen=True)
class Channel:
    """A topic with its schema; the schema's strings are empty if the channel has none."""

    id: int
    topic: str
    message_encoding: str
    schema_name: str
    schema_encoding: str
    schema_data: bytes
    metadata: dict[str, str]


class RawMessage(NamedTuple):
    """A message as recorded, not decoded; a ``damaged`` one is from data with a wrong checksum."""

    log_time_ns: int
    channel_id: int
    data: memoryview
    damaged: bool = False


class Source(Protocol):
    """An opened recording: its channels, and their messages in log time order.

    Losses become warnings for the caller that opened the source.

    - ``channels``: by their numbers
    - ``counts``: number of messages of each channel
    - ``start_ns``, ``end_ns``: log times of the first and the last message
    """

    profile: str
    library: str
    channels: dict[int, Channel]
    counts: dict[int, int]
    start_ns: int
    end_ns: int

    def messages(
        self,
        channels: Collection[int],
        *,
        start_ns: int | None = None,
        end_ns: int | None = None,
        log_times_ns: Ints | None = None,
    ) -> Iterator[RawMessage]:
        """Yield the channels' messages by log time, in [start, end] or at given log times."""

    def sample(self, channels: Collection[int], *, most: int) -> tuple[Iterator[RawMessage], bool]:
        """Return messages from at most ``most`` places, and whether these are all messages.

        The places are spread evenly over the recording, with its end among them.
        """

    def close(self) -> None:
        """Close the files."""
