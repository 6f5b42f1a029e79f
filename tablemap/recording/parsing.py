"""Recorded bytes -> parsed objects: ROS 1, ROS 2 (CDR), Foxglove's protobuf, and its JSON.

The types are built from the schemas in the recording, so that older and newer versions of a message
are read correctly. If a schema's text is empty, the standard message of ROS is assumed.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory
from rosbags.typesys import Stores, get_typestore

from tablemap.config import LimitsConfig
from tablemap.recording.claims import Counted, check_json, check_protobuf
from tablemap.recording.kinds import KINDS, TRANSFORMS, schema_key
from tablemap.recording.messages import DecodingError
from tablemap.recording.raw import Channel
from tablemap.recording.schemas import (
    SchemaError,
    check_descriptors,
    check_types,
    types_of_idl,
    types_of_msg,
)
from tablemap.recording.tf.messages import Reader as DirectReader
from tablemap.recording.tf.messages import direct_reader

_MOST_WORDS = 160  # most characters quoted from another program's error

Parse = Callable[[memoryview], Any]
Peek = Callable[[memoryview], tuple[int, str]]
Parser = tuple[Parse, Peek | None, DirectReader | None]


def parser(channel: Channel, limits: LimitsConfig) -> Parser:
    """Return the parser of bytes, with fast readers for the stamp and for transforms."""
    return _schema_parser(
        channel.message_encoding,
        channel.schema_name,
        channel.schema_encoding,
        channel.schema_data,
        limits,
    )


@lru_cache(maxsize=256)
def _schema_parser(
    encoding: str, name: str, schema_encoding: str, schema_data: bytes, limits: LimitsConfig
) -> Parser:
    """Build the parser of a schema; recordings of one robot share theirs."""
    try:
        if len(schema_data) > limits.schema_kib * 1024:
            over = limits.over("schema_kib")
            raise SchemaError(f"has {len(schema_data) / 1024:.0f} KiB, {over}")
        if encoding in ("ros1", "cdr"):
            return _ros_parser(encoding, name, schema_encoding, schema_data.decode(), limits)
        if encoding == "protobuf":
            check_descriptors(schema_data, limits)
            schema = Schema(1, schema_data, schema_encoding, name)
            decode = DecoderFactory().decoder_for(encoding, schema)
            if decode is not None:
                kind = decode(b"").DESCRIPTOR
                return (lambda data: decode(check_protobuf(data, kind, limits))), None, None
        if encoding == "json":
            return (lambda data: _parse_json(check_json(data, limits))), None, None
    except SchemaError as error:
        raise DecodingError(f"has a schema that {error}") from error
    # A schema may contain anything, and its parser may raise anything.
    except Exception as error:
        raise DecodingError(f"has a schema that cannot be parsed ({brief(error)})") from error
    raise DecodingError(f"is encoded as {encoding!r}, which is not read")


def brief(error: Exception) -> str:
    """Return an error's text in one short line, as some errors quote everything that they read."""
    words = " ".join(str(error).split()) or type(error).__name__
    return words if len(words) <= _MOST_WORDS else f"{words[:_MOST_WORDS]}..."


def _parse_json(text: bytes) -> Any:
    return json.loads(text, object_hook=lambda fields: SimpleNamespace(**fields))


def _ros_parser(
    encoding: str, schema_name: str, schema_encoding: str, text: str, limits: LimitsConfig
) -> Parser:
    name = schema_name if "/msg/" in schema_name else schema_name.replace("/", "/msg/")
    if not text.strip():
        store = get_typestore(Stores.ROS1_NOETIC if encoding == "ros1" else Stores.LATEST)
    else:
        store = get_typestore(Stores.EMPTY)
        is_idl = schema_encoding in ("ros2idl", "omgidl")
        types = types_of_idl(text, limits) if is_idl else types_of_msg(text, name, limits)
        check_types(store.fielddefs | types, name, limits, ros1=encoding == "ros1")
        store.register(types)
    left = [0]  # parts that the message at hand may still have
    made: dict[str, Any] = dict(store.types)
    for listed in check_types(store.fielddefs, name, limits, ros1=encoding == "ros1"):
        made[listed] = Counted(left, made[listed], limits)
    store.types = made
    fields = store.fielddefs[name][1]
    begins_with_header = bool(fields) and fields[0][1][1] == "std_msgs/msg/Header"
    direct: DirectReader | None = None
    if KINDS.get(schema_key(schema_name)) == TRANSFORMS:
        direct = direct_reader(store.fielddefs, name, encoding=encoding)
    deserialize = store.deserialize_cdr if encoding == "cdr" else store.deserialize_ros1
    peek = _peek_cdr if encoding == "cdr" else _peek_ros1

    def parse(data: memoryview) -> Any:
        left[0] = limits.message_parts
        return deserialize(data, name)

    return parse, peek if begins_with_header else None, direct


def _peek_ros1(data: memoryview) -> tuple[int, str]:
    seconds, nanoseconds, length = struct.unpack_from("<III", data, 4)  # after the sequence number
    frame_id = bytes(data[16 : 16 + length]).decode()
    return int(seconds) * 1_000_000_000 + int(nanoseconds), frame_id


def _peek_cdr(data: memoryview) -> tuple[int, str]:
    order = "<" if data[1] == 1 else ">"
    seconds, nanoseconds, length = struct.unpack_from(order + "iII", data, 4)
    frame_id = bytes(data[16 : 16 + max(length - 1, 0)]).decode()
    return int(seconds) * 1_000_000_000 + int(nanoseconds), frame_id
