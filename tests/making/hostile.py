"""Files that claim more than they are: each small on the disk, each meant to eat the machine.

All are made anew from a drive that is otherwise sound, or from bare records.
"""

from __future__ import annotations

import io
import json
import struct
import zlib
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import zstandard
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorSet
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

from tests.making import messages as w

MAGIC = b"\x89MCAP0\r\n"
TICK_NS = w.SECOND // 10
HUGE = 256 * 2**20
DEPTH = f"{w.PREFIX}/image_rect_raw"
INFO = f"{w.PREFIX}/camera_info"

Make = Callable[[Path], None]
CASES: dict[str, Make] = {}


def case(make: Make) -> Make:
    """Register a maker by its name."""
    CASES[make.__name__] = make
    return make


# Bare records.


def record(opcode: int, content: bytes) -> bytes:
    """Return a record of an MCAP."""
    return struct.pack("<BQ", opcode, len(content)) + content


def text(value: str | bytes) -> bytes:
    """Return a string with its length."""
    value = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(value)) + value


def header() -> bytes:
    """Return how a file begins."""
    return MAGIC + record(Opcode.HEADER, text("ros1") + text("test"))


def schema(number: int, name: str, encoding: str, data: bytes) -> bytes:
    """Return a schema record."""
    return record(
        Opcode.SCHEMA, struct.pack("<H", number) + text(name) + text(encoding) + text(data)
    )


def channel(number: int, schema_id: int, topic: str, encoding: str) -> bytes:
    """Return a channel record."""
    head = struct.pack("<HH", number, schema_id)
    return record(Opcode.CHANNEL, head + text(topic) + text(encoding) + text(b""))


def message(channel_id: int, time_ns: int, data: bytes) -> bytes:
    """Return a message record."""
    return record(Opcode.MESSAGE, struct.pack("<HIQQ", channel_id, 0, time_ns, time_ns) + data)


def chunk(
    data: bytes,
    *,
    compression: str = "zstd",
    start_ns: int = 0,
    end_ns: int = 10**10,
    packed: bytes | None = None,
    declared: int | None = None,
) -> bytes:
    """Return a chunk record of records, which may lie about how it is packed."""
    if packed is None:
        packed = zstandard.ZstdCompressor(level=1).compress(data)
    head = struct.pack(
        "<QQQI", start_ns, end_ns, len(data) if declared is None else declared, zlib.crc32(data)
    )
    content = head + text(compression) + struct.pack("<Q", len(packed)) + packed
    return record(Opcode.CHUNK, content)


def end() -> bytes:
    """Return how a file without a summary ends."""
    footer = record(Opcode.FOOTER, struct.pack("<QQI", 0, 0, 0))
    return record(Opcode.DATA_END, bytes(4)) + footer + MAGIC


def file_of(*records: bytes) -> bytes:
    """Return a file of records, without a summary."""
    return header() + b"".join(records) + end()


def one_topic(
    path: Path, name: str, schema_encoding: str, data: bytes, encoding: str, content: bytes
) -> None:
    """Write a file of one message of a schema."""
    path.write_bytes(
        file_of(
            chunk(
                schema(1, name, schema_encoding, data)
                + channel(1, 1, "/it", encoding)
                + message(1, 1, content)
            )
        )
    )


def zeros(size: int) -> bytes:
    """Return so many zeros, packed with zstd."""
    packer = zstandard.ZstdCompressor(level=1).compressobj(size=size)
    piece = bytes(2**20)
    return b"".join(packer.compress(piece) for _ in range(size >> 20)) + packer.flush()


# Schemas.


@case
def schema_of_an_endless_array(path: Path) -> None:
    """A line of code for each of a hundred million texts."""
    one_topic(path, "sensor_msgs/Image", "ros1msg", b"string[100000000] x", "ros1", b"")


@case
def schema_of_arrays_in_arrays(path: Path) -> None:
    """Ten types, each of which holds three hundred of the next."""
    parts = [b"a/T0[300] x"]
    parts += [b"MSG: a/T%d\na/T%d[300] x" % (n, n + 1) for n in range(10)]
    parts += [b"MSG: a/T10\nuint8 x"]
    data = (b"\n" + b"=" * 80 + b"\n").join(parts)
    one_topic(path, "sensor_msgs/Image", "ros1msg", data, "ros1", b"")


@case
def schema_that_holds_itself(path: Path) -> None:
    """A type within itself."""
    data = b"a/T x\n" + b"=" * 80 + b"\nMSG: a/T\na/T x\n"
    one_topic(path, "sensor_msgs/Image", "ros1msg", data, "ros1", b"")


@case
def schema_of_brackets(path: Path) -> None:
    """Each pair multiplies the time of the IDL's parser by a hundred."""
    data = b"module sensor_msgs { module msg { struct Image { uint8 x[((((((1))))))]; }; }; };"
    one_topic(path, "sensor_msgs/msg/Image", "ros2idl", data, "cdr", b"")


@case
def schema_of_a_long_shift(path: Path) -> None:
    """A number of a hundred thousand million bits."""
    data = b"module sensor_msgs { module msg { struct Image { uint8 x[1<<100000000000]; }; }; };"
    one_topic(path, "sensor_msgs/msg/Image", "ros2idl", data, "cdr", b"")


@case
def schema_of_sequences_in_sequences(path: Path) -> None:
    """The parser tries each twice."""
    nested = b"sequence<" * 40 + b"uint8" + b">" * 40
    data = b"module sensor_msgs { module msg { struct Image { " + nested + b" x; }; }; };"
    one_topic(path, "sensor_msgs/msg/Image", "ros2idl", data, "cdr", b"")


@case
def schema_of_a_million_lines(path: Path) -> None:
    """Sixteen megabytes of fields."""
    data = b"".join(b"uint8 f%d\n" % n for n in range(1_000_000))
    one_topic(path, "sensor_msgs/Image", "ros1msg", data, "ros1", b"")


@case
def schemas_by_the_thousand(path: Path) -> None:
    """A type of its own for each topic."""
    records = []
    for n in range(1, 4000):
        fields = b"".join(b"uint8 f%d_%d\n" % (n, k) for k in range(100))
        records.append(schema(n, "sensor_msgs/Image", "ros1msg", fields))
        records.append(channel(n, n, f"/t{n}", "ros1") + message(n, n, b"x"))
    path.write_bytes(file_of(chunk(b"".join(records))))


# Messages that are more than they look.


@case
def list_of_nothing(path: Path) -> None:
    """Four bytes that stand for 2^32 - 1 empty messages."""
    data = b"a/Nothing[] x\n" + b"=" * 80 + b"\nMSG: a/Nothing\n"
    one_topic(path, "sensor_msgs/Image", "ros1msg", data, "ros1", b"\xff" * 4)


def ros_list(path: Path, count: int) -> None:
    """Write a message that is a list of so many messages of one byte each."""
    data = b"a/Little[] x\n" + b"=" * 80 + b"\nMSG: a/Little\nuint8 x\n"
    content = struct.pack("<I", count) + bytes(count)
    one_topic(path, "sensor_msgs/Image", "ros1msg", data, "ros1", content)


def protobuf_list(path: Path, count: int) -> None:
    """Write a message that is a list of so many empty messages, two bytes each."""
    name = "foxglove.FrameTransforms"
    one_topic(path, name, "protobuf", _protobuf_schema(), "protobuf", b"\x0a\x00" * count)


def json_list(path: Path, count: int) -> None:
    """Write a message that is a list of so many numbers."""
    content = b'{"a":[' + b"1," * count + b"1]}"
    one_topic(path, "foxglove.RawImage", "jsonschema", b"{}", "json", content)


@case
def list_of_little(path: Path) -> None:
    """Two hundred million messages of one byte each."""
    ros_list(path, 200 * 2**20)


def _protobuf_schema() -> bytes:
    """Return foxglove.FrameTransforms, of transforms that have nothing in them."""
    files = FileDescriptorSet()
    file = files.file.add(name="a.proto", package="foxglove", syntax="proto3")
    file.message_type.add(name="FrameTransform")
    holder = file.message_type.add(name="FrameTransforms")
    holder.field.add(
        name="transforms",
        number=1,
        label=FieldDescriptorProto.LABEL_REPEATED,
        type=FieldDescriptorProto.TYPE_MESSAGE,
        type_name=".foxglove.FrameTransform",
    )
    return bytes(files.SerializeToString())


@case
def protobuf_of_nothing(path: Path) -> None:
    """A hundred million empty messages, two bytes each."""
    protobuf_list(path, 100_000_000)


@case
def json_of_brackets(path: Path) -> None:
    """Lists within lists, two hundred million deep."""
    one_topic(path, "foxglove.RawImage", "jsonschema", b"{}", "json", b"[" * (200 * 2**20))


@case
def json_of_numbers(path: Path) -> None:
    """A hundred million numbers."""
    json_list(path, 100_000_000)


# Containers.


@case
def millions_of_empty_messages(path: Path) -> None:
    """8.65 million messages of no bytes in one small chunk."""
    one = channel(1, 0, "/it", "raw")
    path.write_bytes(file_of(chunk(one + message(1, 1, b"") * 8_650_000)))


@case
def chunks_that_are_bombs(path: Path) -> None:
    """Two hundred chunks that unpack to 250 MB of zeros each."""
    size = 250 * 2**20
    bomb = chunk(b"", packed=zeros(size), declared=size)
    path.write_bytes(file_of(*[bomb] * 200))


@case
def chunks_that_overlap(path: Path) -> None:
    """Ten chunks of 250 MB, all of one second, with one message each."""
    body = zstandard.ZstdCompressor(level=1).compress
    records = [chunk(channel(1, 0, "/it", "raw"))]
    for n in range(10):
        data = message(1, n, bytes(250 * 2**20))
        records.append(chunk(data, packed=body(data)))
    path.write_bytes(file_of(*records))


@case
def one_chunk_named_often(path: Path) -> None:
    """A summary that lists one chunk of the drive ten thousand times."""
    one_tick = io.BytesIO()
    writer = Writer(one_tick)
    writer.start()
    number = writer.register_channel("/it", "raw", 0)
    writer.add_message(number, 1, bytes(100), 1)
    writer.finish()
    data = one_tick.getvalue()
    (start,) = struct.unpack("<Q", data[-28:-20])
    summary, records, at = data[start:-37], b"", 0
    while at < len(summary):
        opcode, length = struct.unpack_from("<BQ", summary, at)
        whole = summary[at : at + 9 + length]
        records += whole * (10_000 if opcode == Opcode.CHUNK_INDEX else 1)
        at += 9 + length
    footer = record(Opcode.FOOTER, struct.pack("<QQI", start, 0, 0))
    path.write_bytes(data[:start] + records + footer + MAGIC)


@case
def frames_of_lz4_without_end(path: Path) -> None:
    """Millions of lz4 frames that hold nothing."""
    packed = lz4.frame.compress(b"") * 5_000_000
    path.write_bytes(file_of(chunk(b"", compression="lz4", packed=packed, declared=1000)))


@case
def channels_by_the_ten_thousand(path: Path) -> None:
    """65,000 topics with images."""
    records = [schema(1, "sensor_msgs/Image", "ros1msg", b"uint8 x")]
    records += [channel(n, 1, f"/t{n}", "ros1") for n in range(1, 65_000)]
    path.write_bytes(file_of(chunk(b"".join(records))))


@case
def times_after_the_end_of_time(path: Path) -> None:
    """Log times that no signed number of 64 bits holds."""
    records = channel(1, 0, "/it", "raw") + message(1, 2**64 - 1, b"x") + message(1, 2**63, b"x")
    path.write_bytes(file_of(chunk(records, end_ns=2**64 - 1), records))


@case
def names_of_many_megabytes(path: Path) -> None:
    """A topic's name of a hundred megabytes."""
    name = "/" + "x" * (100 * 2**20)
    records = schema(1, "sensor_msgs/Image", "ros1msg", b"uint8 x") + channel(1, 1, name, "ros1")
    path.write_bytes(file_of(chunk(records + message(1, 1, b"x"))))


@case
def packed_file_that_is_a_bomb(path: Path) -> None:
    """A file of a few hundred kilobytes that zstd unpacks to eight gigabytes."""
    path.write_bytes(zeros(8 * 2**30))


@case
def attachment_without_end(path: Path) -> None:
    """A record that claims to be longer than any disk."""
    path.write_bytes(header() + struct.pack("<BQ", Opcode.ATTACHMENT, 2**63) + bytes(1000))


@case
def chunk_that_ends_beyond_all_files(path: Path) -> None:
    """A chunk and its packed bytes claim to be longer than any place that can be sought."""
    head = struct.pack("<QQQI", 0, 1, 10, 0) + text("zstd") + struct.pack("<Q", 2**64 - 90)
    path.write_bytes(header() + struct.pack("<BQ", Opcode.CHUNK, 2**63) + head + bytes(100))


# A drive with one thing in it that is not as it should be.


def _drive(path: Path, **parts: Any) -> None:
    w.write_drive(path, version=1, **parts)


def _raw(recorder: w.RosRecorder, topic: str, name: str, data: bytes, stamp_ns: int) -> None:
    """Write bytes under the schema that a topic of this type has in the drive."""
    known = {schema.name: schema.id for schema in recorder.writer._Writer__schemas.values()}
    if topic not in recorder.channels:
        recorder.channels[topic] = recorder.writer.register_channel(topic, "ros1", known[name])
    recorder.writer.add_message(recorder.channels[topic], stamp_ns, data, stamp_ns)


@case
def picture_larger_than_its_camera(path: Path) -> None:
    """A PNG of 7000 x 7000 pixels in a hundred kilobytes."""
    huge = bytes(12) + w.png(np.zeros((7000, 7000), np.uint16))

    def depth(recorder: w.RosRecorder, stamp_ns: int) -> None:
        recorder.compressed(f"{w.PREFIX}/image/compressedDepth", stamp_ns, huge, "16UC1")

    _drive(path, depth=depth)


@case
def rvl_of_zeros(path: Path) -> None:
    """Two hundred megabytes of runs that hold nothing, for 640 x 480 pixels."""
    data = bytes(12) + struct.pack("<II", 640, 480) + bytes(200 * 2**20)
    done = []

    def depth(recorder: w.RosRecorder, stamp_ns: int) -> None:
        if not done:
            form = "16UC1; compressedDepth rvl"
            recorder.compressed(f"{w.PREFIX}/image/compressedDepth", stamp_ns, data, form)
            done.append(stamp_ns)

    _drive(path, depth=depth)


@case
def depth_of_no_measure(path: Path) -> None:
    """Pixels of 3e38 metres."""

    def depth(recorder: w.RosRecorder, stamp_ns: int) -> None:
        values = np.full((w.HEIGHT, w.WIDTH), 3e38, np.float32)
        recorder.image(DEPTH, stamp_ns, values, "32FC1")

    _drive(path, depth=depth)


@case
def scan_of_three_million_beams(path: Path) -> None:
    """Twelve megabytes a scan."""

    def calibration(recorder: w.RosRecorder, stamp_ns: int) -> None:
        recorder.camera_info(INFO, stamp_ns)
        recorder.scan("/other_scan", stamp_ns, beams=3_000_000)

    _drive(path, calibration=calibration)


@case
def tree_of_diamonds(path: Path) -> None:
    """24 levels of frames with two parents each: 2^24 ways to the last."""

    def calibration(recorder: w.RosRecorder, stamp_ns: int) -> None:
        recorder.camera_info(INFO, stamp_ns)
        edges = []
        for level in range(24):
            for parent in "ab":
                edges += [
                    (f"{parent}{level}", f"{child}{level + 1}", (0.0, 0.0, 1.0), w.LEVEL)
                    for child in "ab"
                ]
        recorder.transforms(stamp_ns, edges)

    _drive(path, calibration=calibration)


@case
def chain_of_thousands(path: Path) -> None:
    """Five thousand frames between the map and the camera."""

    def calibration(recorder: w.RosRecorder, stamp_ns: int) -> None:
        recorder.camera_info(INFO, stamp_ns, frame="f5000")
        names = ["base_link", *(f"f{n}" for n in range(5001))]
        pairs = pairwise(names)
        recorder.transforms(stamp_ns, [(a, b, (0.0, 0.0, 0.001), w.LEVEL) for a, b in pairs])

    def depth(recorder: w.RosRecorder, stamp_ns: int) -> None:
        recorder.image(DEPTH, stamp_ns, w.millimetres(), "16UC1", frame="f5000")

    _drive(path, calibration=calibration, depth=depth)


@case
def frames_by_the_hundred_thousand(path: Path) -> None:
    """A new frame in every transform."""
    count = [0]

    def calibration(recorder: w.RosRecorder, stamp_ns: int) -> None:
        recorder.camera_info(INFO, stamp_ns)
        names = range(count[0], count[0] + 20_000)
        edges = [("base_link", f"f{n}", (0.0, 0.0, 1.0), w.LEVEL) for n in names]
        count[0] += 20_000
        recorder.transforms(stamp_ns, edges)

    _drive(path, calibration=calibration)


@case
def messages_that_are_bombs(path: Path) -> None:
    """ROS 2 messages, each packed with zstd, each 200 MB of zeros."""
    bomb = zeros(200 * 2**20)
    buffer = io.BytesIO()
    writer = Writer(buffer, compression=CompressionType.NONE)
    writer.start("ros2", "test")
    number = writer.register_schema("sensor_msgs/msg/Image", "ros2msg", b"")
    topic = writer.register_channel("/it", "cdr", number)
    for n in range(200):
        writer.add_message(topic, n, bomb, n)
    writer.finish()
    path.write_bytes(buffer.getvalue())


@case
def json_of_impossible_times(path: Path) -> None:
    """A stamp of four thousand digits."""
    document = {"timestamp": {"sec": 10**4000, "nsec": 0}, "frame_id": "a", "width": 1}
    content = json.dumps(document).encode()
    one_topic(path, "foxglove.RawImage", "jsonschema", b"{}", "json", content)
