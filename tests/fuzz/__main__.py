"""Feed bytes of others to the readers of containers, schemas, messages and documents.

``python -m tests.fuzz CORPUS -max_total_time=600`` (atheris, libFuzzer's options). The corpus is
begun with small recordings and hostile files. The first byte of an input says which reader gets
the rest. Errors of the project's own family are right answers; everything else is a finding.
"""

from __future__ import annotations

import contextlib
import io
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["tablemap", "rosbags"]):
    from tablemap.archive.manifest import Manifest
    from tablemap.archive.packing import unpack
    from tablemap.config import LimitsConfig, load_config
    from tablemap.errors import TablemapError
    from tablemap.model import TableModel
    from tablemap.recording import inspect, open_recording
    from tablemap.recording.bags.folder import files_of
    from tablemap.recording.decoding import Decoder
    from tablemap.recording.extrinsics import read_extrinsics
    from tablemap.recording.kinds import TRANSFORMS
    from tablemap.recording.mcap.container import Container
    from tablemap.recording.messages import DecodingError
    from tablemap.recording.raw import Channel, RawMessage

from tests.making import hostile, protobuf
from tests.making import messages as w
from tests.making.models import rectangle_model

LIMITS = LimitsConfig(
    chunk_mib=8,
    record_mib=8,
    unpacked_mib=64,
    expansion=20,
    messages=50_000,
    chunk_messages=20_000,
    message_parts=20_000,
    pixels=1_000_000,
    idle_seconds=5.0,
)
MOST_SEED_BYTES = 200_000
ROOM = Path(tempfile.mkdtemp(prefix="tablemap-fuzz-"))
ENCODINGS = (
    ("ros1", "ros1msg", "sensor_msgs/Image"),
    ("cdr", "ros2msg", "sensor_msgs/msg/Image"),
    ("cdr", "ros2idl", "sensor_msgs/msg/Image"),
    ("protobuf", "protobuf", "foxglove.RawImage"),
    ("json", "jsonschema", "foxglove.RawImage"),
)


def container(data: bytes) -> None:
    """Read all messages of an MCAP."""
    found = Container(io.BytesIO(data), limits=LIMITS)
    for _ in found.messages(found.channels):
        pass


def schema(data: bytes) -> None:
    """Make a decoder of a schema, and give it the rest as a message."""
    encoding, schema_encoding, name = ENCODINGS[data[0] % len(ENCODINGS)]
    definition, _, message = data[1:].partition(b"\0\0\0\0\0\0\0\0")
    channel = Channel(1, "/it", encoding, name, schema_encoding, definition, {})
    Decoder(channel, LIMITS).decode(RawMessage(1, 1, memoryview(message)))


CHANNELS: list[Channel] = []


def message(data: bytes) -> None:
    """Decode a message of one of the ordinary schemas."""
    channel = CHANNELS[data[0] % len(CHANNELS)]
    decoder = Decoder(channel, LIMITS)
    raw = RawMessage(1, channel.id, memoryview(data[1:]))
    if decoder.kind != TRANSFORMS:
        decoder.header(raw)
    decoder.decode(raw)


def _written(name: str, data: bytes) -> Path:
    file = ROOM / name
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(data)
    return file


def recording(data: bytes) -> None:
    """Look at a file and read all of it, whatever it is."""
    file = _written("it.mcap", data)
    with contextlib.suppress(TablemapError):
        list(inspect(file, limits=LIMITS).tree_lines())
    with open_recording(file, limits=LIMITS) as found:
        for _ in found.depth_frames():
            pass
        for _ in found.scans():
            pass


def model(data: bytes) -> None:
    """Read a table."""
    TableModel.from_json(data.decode()).to_json()


def manifest(data: bytes) -> None:
    """Read a manifest, and what it names."""
    found = Manifest.from_json(data)
    found.recording.input.exists()


def settings(data: bytes) -> None:
    """Read settings."""
    load_config(_written("it.toml", data))


def extrinsics(data: bytes) -> None:
    """Read mountings in TOML or URDF."""
    read_extrinsics(_written("it.urdf", data))


def metadata(data: bytes) -> None:
    """Read what a bag says of its files."""
    folder = _written("bag/metadata.yaml", data).parent
    _written("bag/it_0.mcap", b"x")
    files_of(folder, warnings=[])


def packed(data: bytes) -> None:
    """Unpack a run."""
    unpack(_written("it.tar.zst", data), ROOM / "runs", most_bytes=2**20)


READERS: tuple[Callable[[bytes], None], ...] = (
    container,
    schema,
    message,
    recording,
    model,
    manifest,
    settings,
    extrinsics,
    metadata,
    packed,
)


def one_input(data: bytes) -> None:
    """Give the bytes to their reader; its own errors are right answers."""
    if len(data) < 3:
        return
    allowed = (TablemapError, DecodingError)
    reader = READERS[data[0] % len(READERS)]
    try:
        reader(data[1:])
    except allowed:
        pass
    except ValueError:
        if reader not in (model, manifest):  # no text in UTF-8
            raise


def seeds() -> Iterator[bytes]:
    """Yield the inputs to begin with: small recordings, hostile files and documents."""
    number = {reader: bytes([place]) for place, reader in enumerate(READERS)}
    drives = []
    for version in (1, 2):
        buffer = io.BytesIO()
        w.write_drive(buffer, version=version)
        drives.append(buffer.getvalue())
    for name, make in hostile.CASES.items():
        file = ROOM / f"{name}.mcap"
        make(file)
        if file.stat().st_size < MOST_SEED_BYTES:
            drives.append(file.read_bytes())
        file.unlink()
    for data in drives:
        yield number[container] + data
        yield number[recording] + data
    for place, (found, raw) in enumerate([*_messages(drives[:2]), *protobuf.channels()]):
        CHANNELS.append(found)
        yield number[message] + bytes([place]) + raw
        kinds = [names[:2] for names in ENCODINGS]
        kind = kinds.index((found.message_encoding, found.schema_encoding))
        yield number[schema] + bytes([kind]) + found.schema_data + bytes(8) + raw
    yield number[model] + rectangle_model().to_json().encode()
    yield number[settings] + b"seed = 1\n[topics]\ndepth = '/x'\n"
    yield number[extrinsics] + b"[[transform]]\nparent='a'\nchild='b'\nxyz=[0,0,1]\nrpy=[0,0,0]\n"
    yield number[extrinsics] + (
        b"<robot name='r'><joint type='fixed' name='j'><parent link='a'/><child link='b'/>"
        b"<origin xyz='0 0 1'/></joint></robot>"
    )
    yield (
        number[metadata]
        + b"rosbag2_bagfile_information:\n  relative_file_paths:\n    - it_0.mcap\n"
    )


def _messages(drives: list[bytes]) -> Iterator[tuple[Channel, bytes]]:
    """Yield each channel of the drives with its first message."""
    for data in drives:
        found = Container(io.BytesIO(data))
        for channel_id, channel in found.channels.items():
            first = next(iter(found.messages([channel_id])), None)
            if first is not None:
                yield channel, bytes(first.data)


def main() -> None:
    """Write the seeds into the corpus, and fuzz."""
    folders = [Path(each) for each in sys.argv[1:] if not each.startswith("-")]
    inputs = list(seeds())
    if folders and not folders[0].is_file():
        folders[0].mkdir(parents=True, exist_ok=True)
        for place, data in enumerate(inputs):
            (folders[0] / f"seed{place:03d}").write_bytes(data)
    limits = ["-rss_limit_mb=2048", "-timeout=60", f"-max_len={MOST_SEED_BYTES}"]
    atheris.Setup([sys.argv[0], *limits, *sys.argv[1:]], one_input)
    atheris.Fuzz()


main()
