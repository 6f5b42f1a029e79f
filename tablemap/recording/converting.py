"""Conversion of a recording to an MCAP with only the needed messages; it gives the same table.

Warnings about the original (files that were cut short, a choice between two cameras) are written as
a message, so that the copy gives them, too.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

from tablemap.config import LimitsConfig, TopicsConfig
from tablemap.errors import ProcessWarning, RecordingError
from tablemap.files import whole_file
from tablemap.inputs import AnyInput, Input
from tablemap.recording.carried import SCHEMA, TOPIC, carried_warnings
from tablemap.recording.kinds import COMPRESSED, IMAGE, POINTS
from tablemap.recording.packing import unpacked_message
from tablemap.recording.raw import Channel, RawMessage, Source
from tablemap.recording.roles import find_roles, missing_roles
from tablemap.recording.sources import open_source
from tablemap.recording.topics import Topic, list_topics
from tablemap.recording.window import windowed
from tablemap.version import __version__

_CHUNK_BYTES = 2**20
_SCHEMA = {
    "type": "object",
    "properties": {
        "version": {"type": "string"},
        "source": {"type": "array", "items": {"type": "string"}},
        "warnings": {"type": "array", "items": {"type": "object"}},
    },
}


@dataclass(frozen=True)
class Conversion:
    """The result: number of messages by topic, size of the file, and warnings."""

    path: Path
    topics: dict[str, int]
    size_bytes: int
    warnings: tuple[ProcessWarning, ...]


def convert(
    recording: AnyInput,
    output: Path,
    *,
    topics: TopicsConfig | None = None,
    limits: LimitsConfig | None = None,
    colour: bool = True,
    progress: Callable[[float], None] = lambda _: None,
) -> Conversion:
    """Write the messages that processing needs as an MCAP: chunks in zstd, indexed, with CRCs.

    They are the chosen depth images, their colour images unless left out, and all calibrations,
    scans and poses. ``progress`` is called with the finished share of the time. ``output`` appears
    only when complete. Raises `RecordingError` if the recording cannot be processed, or ``output``
    is a part of it or cannot be written.
    """
    given = Input.of(recording)
    config, limits = topics or TopicsConfig(), limits or LimitsConfig()
    files = [] if given.is_remote else given.files()
    if output.exists() and any(output.samefile(file) for file in files if file.exists()):
        raise RecordingError(f"expected another file to write to than the recording: {output}")
    warnings: list[ProcessWarning] = []
    with closing(open_source(given, warnings=warnings, limits=limits)) as whole:
        source = windowed(whole, config.start, config.end)
        known = list_topics(source, limits)
        names = sorted({channel.topic for channel in source.channels.values()})
        roles, choices = find_roles(known, config, all_names=names)
        if missing := missing_roles(source, roles, known):
            raise RecordingError(missing[0])
        kept = [topic for topic in known if topic.kind not in (IMAGE, COMPRESSED, POINTS)]
        kept += [role for role in (roles.depth, roles.colour if colour else None) if role]
        warnings += [each for each in (*choices, *carried_warnings(source)) if each not in warnings]
        try:
            with whole_file(output) as part:
                counts = _write(
                    source, kept, part, given=given, limits=limits, warnings=warnings, show=progress
                )
        except OSError as error:
            raise RecordingError(
                f"the recording cannot be written ({error.strerror}); free some space or choose "
                f"another --output: {output}"
            ) from error
    return Conversion(output, counts, output.stat().st_size, tuple(warnings))


def _write(
    source: Source,
    topics: Iterable[Topic],
    path: Path,
    *,
    given: Input,
    limits: LimitsConfig,
    warnings: list[ProcessWarning],
    show: Callable[[float], None],
) -> dict[str, int]:
    """Write the topics' messages, then the warnings; return the number of messages by topic."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD)
        writer.start(source.profile, f"tablemap {__version__}")
        channels = [channel for topic in topics for channel in topic.channels]
        numbers = {channel.id: _register(writer, channel) for channel in channels}
        counts = dict.fromkeys((channel.topic for channel in channels), 0)
        duration = max(source.end_ns - source.start_ns, 1)
        for message in source.messages(numbers):
            time_ns = message.log_time_ns
            writer.add_message(
                numbers[message.channel_id], time_ns, _unpacked(message, limits), time_ns
            )
            counts[source.channels[message.channel_id].topic] += 1
            show((time_ns - source.start_ns) / duration)
        # Everything has been read by now, so that all damage is known.
        _write_said(writer, given, warnings, source.start_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    return counts


def _register(writer: Writer, channel: Channel) -> int:
    """Add a channel with its schema; the schema is complete even if the original's was empty."""
    name, text = channel.schema_name, channel.schema_data
    encoding = channel.schema_encoding
    if channel.message_encoding == "ros1":
        name = name.replace("/msg/", "/")
    elif channel.message_encoding == "cdr" and not text.strip():
        full = name if "/msg/" in name else name.replace("/", "/msg/")
        definition, _ = get_typestore(Stores.LATEST).generate_msgdef(full, ros_version=2)
        encoding, text = "ros2msg", definition.encode()
    number = writer.register_schema(name, encoding, text) if name else 0
    return writer.register_channel(
        channel.topic, channel.message_encoding, number, channel.metadata
    )


def _unpacked(message: RawMessage, limits: LimitsConfig) -> bytes:
    try:
        return bytes(unpacked_message(message.data, limits))
    except ValueError:
        return bytes(message.data)  # reading says so, as of the original


def _said(warning: ProcessWarning) -> dict[str, str | int | None]:
    return {
        "code": warning.code,
        "stage": warning.stage,
        "message": warning.message,
        "stamp_ns": warning.stamp_ns,
    }


def _write_said(writer: Writer, given: Input, warnings: list[ProcessWarning], time_ns: int) -> None:
    schema = writer.register_schema(SCHEMA, "jsonschema", json.dumps(_SCHEMA).encode())
    channel = writer.register_channel(TOPIC, "json", schema)
    said = {
        "version": __version__,
        "source": [path.name for path in given.paths],
        "warnings": [_said(warning) for warning in warnings],
    }
    writer.add_message(channel, time_ns, json.dumps(said).encode(), time_ns)
