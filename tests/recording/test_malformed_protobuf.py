"""Foxglove's protobuf with wrong bytes or a wrong description: a reading, or a sentence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from google.protobuf.descriptor_pb2 import DescriptorProto, FileDescriptorProto, FileDescriptorSet
from google.protobuf.descriptor_pb2 import FieldDescriptorProto as Field
from hypothesis import given, settings
from hypothesis import strategies as st

from tablemap.config import LimitsConfig
from tablemap.recording.decoding import Decoder
from tablemap.recording.messages import DecodingError
from tablemap.recording.raw import Channel, RawMessage
from tests.making import hostile
from tests.making import messages as w
from tests.making.bounds import check_bounded, said
from tests.making.protobuf import MESSAGES, channels

many = settings(deadline=None, derandomize=True, database=None, max_examples=300)


def told(schema: bytes, data: bytes, name: str = "foxglove.RawImage") -> str:
    """Return what is said of a message, empty where it is read."""
    try:
        channel = Channel(1, "/it", "protobuf", name, "protobuf", schema, {})
        Decoder(channel).decode(RawMessage(1, 1, memoryview(data)))
    except DecodingError as error:
        assert "\n" not in str(error)
        assert len(str(error)) < 300
        return str(error)
    return ""


def test_every_message_is_sound_at_first() -> None:
    """Else the following would show nothing."""
    assert [
        told(channel.schema_data, data, channel.schema_name) for channel, data in channels()
    ] == [""] * len(MESSAGES)


@many
@given(
    place=st.integers(0, len(MESSAGES) - 1),
    at=st.floats(0, 1),
    piece=st.one_of(st.binary(max_size=12), st.sampled_from([b"\x0b", b"\xff" * 9 + b"\x01"])),
    replaced=st.integers(0, 12),
    end=st.one_of(st.none(), st.integers(0, 300)),
)
def test_messages_with_any_bytes_are_decoded_or_refused(
    place: int, at: float, piece: bytes, replaced: int, end: int | None
) -> None:
    """Tags, lengths, groups and numbers, at any place; or cut."""
    channel, data = channels()[place]
    start = int(at * min(len(data), 300))  # what comes later is pixels
    damaged = (data[:start] + piece + data[start + replaced :])[:end]
    told(channel.schema_data, damaged, channel.schema_name)


@many
@given(
    place=st.integers(0, len(MESSAGES) - 1),
    changes=st.lists(st.tuples(st.floats(0, 0.999), st.integers(0, 255)), max_size=4),
    end=st.one_of(st.just(1.0), st.floats(0, 1)),
)
def test_descriptions_with_any_bytes_are_read_or_refused(
    place: int, changes: list[tuple[float, int]], end: float
) -> None:
    """Names, types, numbers and dependencies; the messages stay as they are."""
    channel, data = channels()[place]
    damaged = bytearray(channel.schema_data[: int(end * len(channel.schema_data))])
    for at, value in changes:
        if damaged:
            damaged[int(at * len(damaged))] = value
    told(bytes(damaged), data, channel.schema_name)


def _number(value: int) -> bytes:
    parts = []
    while value > 0x7F:
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*parts, value])


def _nested(levels: int) -> bytes:
    data = b""
    for _ in range(levels):
        data = b"\x0a" + _number(len(data)) + data
    return data


def described(*types: DescriptorProto, package: str = "foxglove") -> bytes:
    """Return the description of types in one file."""
    file = FileDescriptorProto(name="a.proto", package=package, syntax="proto2")
    file.message_type.extend(types)
    return bytes(FileDescriptorSet(file=[file]).SerializeToString())


def within(name: str, *, kind: Any = Field.TYPE_MESSAGE) -> DescriptorProto:
    """Return a type that holds itself."""
    found = DescriptorProto(name=name)
    found.field.add(
        name="x", number=1, label=Field.LABEL_OPTIONAL, type=kind, type_name=f".foxglove.{name}"
    )
    return found


WIRES: dict[str, bytes] = {
    "a length beyond the message": b"\x0a" + _number(10**6) + b"x",
    "a length of 2^31 - 1": b"\x0a" + _number(2**31 - 1) + b"x",
    "a length of 2^63": b"\x0a" + _number(2**63) + b"x",
    "a number of eleven bytes": b"\x08" + b"\x80" * 11 + b"\x01",
    "a field of number zero": b"\x02\x01x",
    "a group without end": b"\x0b",
    "an end without group": b"\x0c",
    "groups in groups": b"\x0b" * 200_000,
    "unknown groups in groups": b"\xfb\x07" * 200_000,
    "messages in messages": _nested(3000),
    "no such kind": b"\x0e\x01",
}


@pytest.mark.parametrize("name", WIRES)
@pytest.mark.parametrize("kind", [Field.TYPE_MESSAGE, Field.TYPE_GROUP], ids=["message", "group"])
def test_bytes_that_are_no_message_are_refused(name: str, kind: Any) -> None:
    """Whether the first field is a message or a group; nothing is read beyond its end."""
    schema = described(within("RawImage", kind=kind))
    assert told(schema, WIRES[name]).startswith("cannot be decoded")


def _files(*files: tuple[str, list[str]]) -> bytes:
    found = FileDescriptorSet()
    for name, needed in files:
        found.file.add(name=name, package="foxglove", dependency=needed)
    found.file[0].message_type.add(name="RawImage")
    return bytes(found.SerializeToString())


def _with_fields(count: int) -> bytes:
    found = DescriptorProto(name="RawImage")
    for number in range(count):
        found.field.add(
            name=f"f{number}",
            number=number + 1 + 1000 * (number >= 18_999),  # these are reserved
            label=Field.LABEL_OPTIONAL,
            type=Field.TYPE_INT32,
        )
    return described(found)


def _of_long_names(length: int, count: int) -> bytes:
    types = [DescriptorProto(name=f"R{n}") for n in range(count)]
    return described(DescriptorProto(name="RawImage"), *types, package="a." * (length // 2) + "b")


def _chain(length: int) -> bytes:
    types = [DescriptorProto(name="RawImage" if n == 0 else f"m{n}") for n in range(length)]
    for number, each in enumerate(types[:-1]):
        each.field.add(
            name="x",
            number=1,
            label=Field.LABEL_OPTIONAL,
            type=Field.TYPE_MESSAGE,
            type_name=f".foxglove.m{number + 1}",
        )
    return described(*types)


DESCRIPTIONS: dict[str, tuple[Callable[[], bytes], str]] = {
    "nothing": (lambda: b"", "missing that schema"),
    "two files that need each other": (
        lambda: _files(("a", ["b"]), ("b", ["a"])),
        "has not been loaded",
    ),
    "a file that needs itself": (lambda: _files(("a", ["a"])), "has not been loaded"),
    "a file that needs another": (lambda: _files(("a", ["nowhere"])), "'nowhere'"),
    "four thousand files in a row": (
        lambda: _files(*((str(n), [str(n + 1)]) for n in range(4000))),
        "has not been loaded",
    ),
    "one file twice": (lambda: _files(("a", []), ("a", [])), "2 file descriptors"),
    "three hundred thousand fields": (lambda: _with_fields(300_000), "limits.schema_kib"),
    "three thousand types in types": (lambda: _chain(3000), "recursion"),
    "a name of a hundred thousand letters": (
        lambda: described(DescriptorProto(name="x" * 100_000)),
        "limits.name_bytes",
    ),
    "seven thousand types of long names": (
        lambda: _of_long_names(60_000, 7000),
        "limits.name_bytes",
    ),
}


@pytest.mark.parametrize("name", DESCRIPTIONS)
def test_descriptions_of_no_messages_are_refused(name: str) -> None:
    """In a sentence that says what is wrong."""
    make, words = DESCRIPTIONS[name]
    answer = told(make(), b"")
    assert answer.startswith("has a schema that")
    assert words in answer


def test_many_fields_are_described_in_a_schema_of_the_allowed_size() -> None:
    """Of which a message that has none of those that an image needs is refused."""
    assert "cannot be decoded" in told(_with_fields(5000), b"")


@pytest.mark.parametrize("number_type", ["double", "int32"])
def test_numbers_in_a_packed_list_are_counted_before_they_are_read(number_type: str) -> None:
    """A byte may stand for a number, and a number takes thirty in Python. The list counts too."""
    kind = {"double": Field.TYPE_DOUBLE, "int32": Field.TYPE_INT32}[number_type]
    found = DescriptorProto(name="LaserScan")
    found.field.add(name="ranges", number=1, label=Field.LABEL_REPEATED, type=kind)
    limits = LimitsConfig(message_parts=1000)
    channel = Channel(1, "/it", "protobuf", "foxglove.LaserScan", "protobuf", described(found), {})
    decoder = Decoder(channel, limits)
    for count, is_over in ((1000, True), (999, False)):
        data = bytes(8 * count if number_type == "double" else count)
        message = b"\x0a" + _number(len(data)) + data
        with pytest.raises(DecodingError) as raised:
            decoder.decode(RawMessage(1, 1, memoryview(message)))
        assert (limits.over("message_parts") in str(raised.value)) == is_over


def recording_of(path: Path, channel: Channel, data: bytes) -> None:
    """Write a sound drive, and beside it a topic of this kind."""

    def calibration(recorder: w.RosRecorder, stamp_ns: int) -> None:
        recorder.camera_info(f"{w.PREFIX}/camera_info", stamp_ns)
        writer = recorder.writer
        if "/it" not in recorder.channels:
            schema = writer.register_schema(channel.schema_name, "protobuf", channel.schema_data)
            recorder.channels["/it"] = writer.register_channel("/it", "protobuf", schema)
        writer.add_message(recorder.channels["/it"], stamp_ns, data, stamp_ns)

    w.write_drive(path, calibration=calibration)


@pytest.mark.parametrize("place", range(len(MESSAGES)))
def test_a_topic_of_malformed_messages_spoils_no_other(tmp_path: Path, place: int) -> None:
    """It is named with what is wrong; nothing is said of the drive's own topics."""
    channel, data = channels()[place]
    for case in (
        (channel, data[:40] + b"\xff" * 12),
        (replace(channel, schema_data=b"\x0a"), data),
    ):
        path = tmp_path / "drive.mcap"
        recording_of(path, *case)
        words = said(path, LimitsConfig())
        assert "cannot be" in words
        assert w.PREFIX not in words


LARGE: dict[str, tuple[int, Callable[[], bytes]]] = {
    "a scan of 25 million numbers": (
        4,
        lambda: b"\x22" + _number(8 * 25_000_000) + bytes(8 * 25_000_000),
    ),
    "a hundred million transforms of nothing": (7, lambda: b"\x0a\x00" * 100_000_000),
    "two hundred million groups": (0, lambda: b"\x0b" * 200_000_000),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LARGE)
def test_large_messages_cost_a_gigabyte_and_ten_seconds_at_most(tmp_path: Path, name: str) -> None:
    """Whatever they claim."""
    place, make = LARGE[name]
    path = tmp_path / "large.mcap"
    channel, _ = channels()[place]
    hostile.one_topic(
        path, channel.schema_name, "protobuf", channel.schema_data, "protobuf", make()
    )
    check_bounded(path)
