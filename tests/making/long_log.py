"""Logs of many minutes out of a short one: the drive is driven to and fro."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from tablemap.simulation import load_scenario, simulate, write

SECOND = 1_000_000_000
PAUSE_NS = SECOND // 20
"""Between two laps: the period of the poses."""

LAP = """
description = "Stops of seconds in a drive of minutes, the depth camera running"

[table]
shape = "rectangle"
length = 1.187
width = 0.806
height = 0.743

[clutter]
count = 6

[robot]
stops = {stops}
stop_seconds = 3.6
continuous_rate = 5.0
moving_scan_rate = 20.0
standing_scan_rate = 20.0
"""


def simulate_lap(folder: Path, *, stops: int) -> Path:
    """Write a log of ROS 1: depth at 5 Hz, laser and TF at 20 Hz, stops of 3.6 s."""
    scenario = folder / "lap.toml"
    scenario.write_text(LAP.format(stops=stops), encoding="utf-8")
    path = folder / "lap.mcap"
    write(simulate(load_scenario(str(scenario)), seed=0), path)
    return path


def to_and_fro(lap: Path, target: Path, *, minutes: float) -> Path:
    """Log a lap of ROS 1 for so long, every second time backwards; return ``target``.

    So the robot never jumps. Stamps in the messages and of the log go on.
    """
    entries = list(_read(lap))
    start, end = (pick(entry.stamp_ns for entry in entries) for pick in (min, max))
    length = end - start + PAUSE_NS
    with lap.open("rb") as source, target.open("wb") as stream:
        summary = make_reader(source).get_summary()
        assert summary is not None
        writer = Writer(stream, chunk_size=512 * 1024, compression=CompressionType.ZSTD)
        writer.start(profile="ros1", library="to and fro")
        channels = {}
        for number, channel in summary.channels.items():
            schema = summary.schemas[channel.schema_id]
            known = writer.register_schema(schema.name, schema.encoding, schema.data)
            channels[number] = writer.register_channel(
                channel.topic, channel.message_encoding, known, channel.metadata
            )
        last = start + round(60 * minutes * SECOND)
        for number, begun in enumerate(range(start, last, length)):
            back = number % 2 == 1

            def moved(stamp_ns: int, back: bool = back, begun: int = begun) -> int:
                return begun + (end - stamp_ns if back else stamp_ns - start)

            for entry in reversed(entries) if back else entries:
                if entry.is_static and number:
                    continue
                stamp_ns = moved(entry.stamp_ns)
                if stamp_ns > last:
                    continue
                data = entry.data if entry.is_static else restamped(entry, moved)
                log_ns = stamp_ns + entry.log_ns - entry.stamp_ns
                writer.add_message(channels[entry.channel], log_ns, data, stamp_ns)
        writer.finish()
    return target


class _Logged(NamedTuple):
    """A message: ``stamp_ns`` is when it was published, which is its header's stamp."""

    channel: int
    is_static: bool
    is_transforms: bool
    log_ns: int
    stamp_ns: int
    data: bytes


def _read(path: Path) -> Iterator[_Logged]:
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            yield _Logged(
                channel.id,
                channel.topic == "/tf_static",
                schema.name == "tf2_msgs/TFMessage",
                message.log_time,
                message.publish_time,
                message.data,
            )


def restamped(entry: _Logged, moved: Callable[[int], int]) -> bytes:
    """Return a serialised message of ROS 1, the stamps of its headers changed by ``moved``."""
    data = bytearray(entry.data)
    if not entry.is_transforms:
        _restamp(data, 4, moved)  # after the sequence number
        return bytes(data)
    (count,) = struct.unpack_from("<I", data)
    at = 4
    for _ in range(count):
        _restamp(data, at + 4, moved)
        at += 12
        for _ in range(2):  # the frames' names
            at += 4 + struct.unpack_from("<I", data, at)[0]
        at += 7 * 8
    return bytes(data)


def _restamp(data: bytearray, at: int, moved: Callable[[int], int]) -> None:
    seconds, nanoseconds = struct.unpack_from("<II", data, at)
    struct.pack_into("<II", data, at, *divmod(moved(seconds * SECOND + nanoseconds), SECOND))
