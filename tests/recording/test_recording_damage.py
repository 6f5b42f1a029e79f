"""Whatever is done to a file: what can be read is read, the loss is said, memory is bounded."""

from __future__ import annotations

import io
import resource
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType, IndexType, Writer

from tablemap.config import LimitsConfig
from tablemap.errors import RecordingError
from tablemap.recording import inspect, open_recording
from tablemap.recording.mcap.chunks import Chunk, unpack
from tablemap.recording.mcap.container import Container
from tablemap.recording.mcap.index import MAGIC
from tablemap.recording.mcap.records import DamageError
from tests.making import messages as w


@pytest.fixture(scope="module")
def drive() -> bytes:
    """A whole recording of about a dozen chunks."""
    buffer = io.BytesIO()
    w.write_drive(buffer)
    return buffer.getvalue()


def read_all(data: bytes) -> tuple[int, list[str], Container]:
    """Return the number of messages that come out in order, and the warnings' codes."""
    container = Container(io.BytesIO(data))
    times = [m.log_time_ns for m in container.messages(container.channels)]
    assert times == sorted(times)
    return len(times), [warning.code for warning in container.warnings], container


def chunk_offsets(data: bytes) -> list[int]:
    """Return where the chunks begin."""
    return sorted(span.offset for span in Container(io.BytesIO(data)).spans)


def test_whole_file_has_all_messages_without_warning(drive: bytes) -> None:
    """The yardstick of the others: 121 messages in several chunks."""
    count, codes, container = read_all(drive)
    assert (count, codes) == (121, [])
    assert len(container.spans) > 5
    assert sum(container.counts.values()) == 121


@pytest.mark.parametrize(
    "options",
    [
        {"compression": CompressionType.NONE},
        {"compression": CompressionType.LZ4},
        {"use_chunking": False},
        {"use_chunking": False, "enable_data_crcs": True},
        {"use_statistics": False},
        {"index_types": IndexType.NONE},
        {"index_types": IndexType.CHUNK},
        {"repeat_channels": False, "repeat_schemas": False},
        {"use_summary_offsets": False, "use_statistics": False, "index_types": IndexType.NONE},
    ],
)
def test_every_layout_is_read(options: dict[str, object]) -> None:
    """Chunked or not, with or without indices and statistics: the same messages, no warning."""
    buffer = io.BytesIO()
    w.write_drive(buffer, **options)
    count, codes, container = read_all(buffer.getvalue())
    assert (count, codes) == (121, [])
    assert sum(container.counts.values()) == 121


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.61, 0.9])
def test_truncated_file_gives_what_is_before_the_cut(
    compression: CompressionType, share: float
) -> None:
    """Cut anywhere, whole messages before the cut come out, and the loss is said once."""
    buffer = io.BytesIO()
    w.write_drive(buffer, compression=compression)
    data = buffer.getvalue()
    container = Container(io.BytesIO(data))
    spans = sorted(container.spans, key=lambda span: span.offset)
    cut = int(share * (spans[-1].offset + spans[-1].length))
    before = [span for span in spans if span.offset + span.length <= cut]
    sure = sum(len(container.span_messages(span, container.channels)) for span in before)
    count, codes, cut_container = read_all(data[:cut])
    assert codes == ["recording.truncated"]
    assert sure <= count < 121
    assert sum(cut_container.counts.values()) == count


def test_truncated_last_chunk_is_salvaged() -> None:
    """Of a single uncompressed chunk cut in the middle about half of the messages come out."""
    buffer = io.BytesIO()
    w.write_drive(buffer, compression=CompressionType.NONE, chunk_size=10_000_000)
    data = buffer.getvalue()
    count, codes, _ = read_all(data[: len(data) // 2])
    assert 40 < count < 80
    assert codes == ["recording.truncated"]


def test_only_the_end_is_missing(drive: bytes) -> None:
    """A file that lost its summary, or its last bytes alone, gives every message."""
    for data in (drive[:-3], drive[: len(drive) - 1000]):
        count, codes, _ = read_all(data)
        assert (count, codes) == (121, ["recording.truncated"])


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_flipped_byte_costs_part_of_one_chunk(drive: bytes, share: float) -> None:
    """What of the chunk still makes sense is kept, and known to be of doubtful worth."""
    offsets = chunk_offsets(drive)
    at = int((1 - share) * offsets[4] + share * offsets[5])
    damaged = drive[:at] + bytes([drive[at] ^ 0x10]) + drive[at + 1 :]
    count, codes, container = read_all(damaged)
    assert codes == ["recording.damaged"]
    assert 121 - 30 < count <= 121
    doubtful = sum(raw.damaged for raw in container.messages(container.channels))
    assert 0 < doubtful + 121 - count < 30


@pytest.mark.parametrize("where", ["length", "opcode"])
def test_broken_record_without_summary_is_passed_over(drive: bytes, where: str) -> None:
    """Reading front to back finds the next chunk after a record whose length is garbage."""
    offsets = chunk_offsets(drive)
    at = offsets[3] + (6 if where == "length" else 0)
    damaged = bytearray(drive)
    damaged[at] = 0x55 if where == "length" else 0x00
    damaged[-20] ^= 1  # the summary's checksum
    count, codes, _ = read_all(bytes(damaged))
    assert set(codes) == {"recording.damaged"}
    assert len(codes) == 2
    assert 121 - 40 < count <= 121


def test_random_damage_never_raises_anything_else(drive: bytes) -> None:
    """Over 150 files with random bytes or cuts, only `RecordingError` may end the reading."""
    rng = np.random.default_rng(5)
    readable = 0
    for _ in range(150):
        data = bytearray(drive[: rng.integers(9, len(drive))] if rng.random() < 0.4 else drive)
        for at in rng.integers(8, len(data), size=rng.integers(0, 6)):
            data[at] = rng.integers(256)
        try:
            container = Container(io.BytesIO(bytes(data)))
            readable += sum(1 for _ in container.messages(container.channels)) > 0
        except RecordingError:
            continue
    assert readable > 50


def test_changed_unchunked_file_fails_the_data_checksum() -> None:
    """Without chunks the checksum over all data tells that something was changed."""
    buffer = io.BytesIO()
    w.write_drive(buffer, use_chunking=False, enable_data_crcs=True)
    data = bytearray(buffer.getvalue())
    data[data.index(b"map\0") if b"map\0" in data else 5000] ^= 1
    assert read_all(bytes(data))[1] == ["recording.damaged"]


@pytest.mark.parametrize("name", ["zstd", "lz4"])
@pytest.mark.parametrize("declared", [1000, 400 * 2**20])
def test_zip_bomb_is_refused_by_declared_and_by_real_size(name: str, declared: int) -> None:
    """A few KiB that unpack to 400 MiB are never unpacked, whatever size they declare."""
    pieces = [bytes(2**20)] * 400
    if name == "zstd":
        packer = zstandard.ZstdCompressor(level=1).compressobj()
    else:
        packer = lz4.frame.LZ4FrameCompressor()
    if name == "lz4":
        packed = packer.begin() + b"".join(map(packer.compress, pieces)) + packer.flush()
    else:
        packed = b"".join(map(packer.compress, pieces)) + packer.flush()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    chunk = Chunk(0, 1, declared, 0, name, memoryview(packed))
    if declared > 256 * 2**20:
        with pytest.raises(DamageError, match=r"limits\.chunk_mib = 256"):
            unpack(chunk, LimitsConfig())
    else:
        unpacked = unpack(chunk, LimitsConfig())
        assert unpacked.damage is not None
        assert len(unpacked.data) == declared
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 50 * 1024


def test_bomb_within_a_file_costs_that_chunk_alone(drive: bytes) -> None:
    """A chunk that would unpack to 400 MiB is left out; the rest of the file is read."""
    packed = zstandard.ZstdCompressor(level=1).compress(bytes(400 * 2**20))
    body = struct.pack("<QQQII", 1, 2, 400 * 2**20, 0, 4) + b"zstd" + struct.pack("<Q", len(packed))
    record = struct.pack("<BQ", 6, len(body) + len(packed)) + body + packed
    at = chunk_offsets(drive)[2]
    data = drive[:at] + record + drive[at:-200]
    count, codes, _ = read_all(data)
    assert count == 121
    assert sorted(codes) == ["recording.damaged", "recording.truncated"]


def test_overlapping_chunks_are_merged_in_time() -> None:
    """Two recorders' chunks, each covering the same seconds, come out in one order of time."""
    buffer = io.BytesIO()
    writer = Writer(buffer, chunk_size=2000)
    writer.start()
    channels = [writer.register_channel(f"/{n}", "raw", 0) for n in range(2)]
    for channel in channels:
        for time in range(0, 1000, 2):
            writer.add_message(channel, time + channel, bytes(40), 0)
    writer.finish()
    count, codes, container = read_all(buffer.getvalue())
    assert (count, codes) == (1000, [])
    only = list(container.messages([channels[1]], start_ns=100, end_ns=199))
    assert [m.log_time_ns for m in only] == [t + channels[1] for t in range(98, 200, 2)][:50]
    at = list(container.messages(channels, log_times_ns=np.array([channels[0] + 10, 777_777])))
    assert [m.log_time_ns for m in at] == [channels[0] + 10]


def test_index_spares_reading_of_other_channels(drive: bytes) -> None:
    """The chunks without a wanted channel are not read from the file."""

    class Counting(io.BytesIO):
        total = 0

        def read(self, size: int | None = -1) -> bytes:
            data = super().read(size)
            self.total += len(data)
            return data

    file = Counting(drive)
    container = Container(file)
    before = file.total
    depth = next(c.id for c in container.channels.values() if "rect_raw" in c.topic)
    list(container.messages([depth], log_times_ns=np.array([w.START_NS])))
    assert file.total - before < len(drive) / 4


def test_undecodable_image_is_left_out_with_a_warning(tmp_path: Path) -> None:
    """One PNG that is cut short costs one image."""
    path = tmp_path / "drive.mcap"
    good = bytes(12) + w.png(w.millimetres())

    def depth(recorder: w.RosRecorder, stamp_ns: int) -> None:
        bad = stamp_ns == w.START_NS + 2 * w.SECOND
        data = good[:60] if bad else good
        recorder.compressed(f"{w.PREFIX}/image/compressedDepth", stamp_ns, data, "16UC1")

    w.write_drive(path, depth=depth)
    with open_recording(path) as recording:
        assert len(recording.depth_stamps()) == w.IMAGES
        assert len(list(recording.depth_frames())) == w.IMAGES - 1
        assert [warning.code for warning in recording.warnings] == ["recording.damaged"]


def test_truncated_recording_opens(tmp_path: Path, drive: bytes) -> None:
    """Two thirds of a drive give two thirds of its images, and a warning."""
    path = tmp_path / "cut.mcap"
    path.write_bytes(drive[: len(drive) * 2 // 3])
    with open_recording(path) as recording:
        assert 2 <= len(list(recording.depth_frames())) < w.IMAGES
        assert "recording.truncated" in {warning.code for warning in recording.warnings}


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.txt", b"hello, this is text\n", "found text"),
        ("a.mcap", b"", "an empty one"),
        ("a.bag", b"#ROSBAG V2.0\n" + bytes(50), "rosbag reindex"),
        ("a.db3", b"SQLite format 3\0" + bytes(50), "database of the bag cannot be read"),
        ("b.mcap", bytes(100), "something else"),
        ("only_magic.mcap", MAGIC, "No topic with depth"),
    ],
)
def test_what_is_no_recording_gets_one_sentence(
    tmp_path: Path, name: str, content: bytes, says: str
) -> None:
    """Each says what was expected, what was found, and where."""
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=says) as caught:
        open_recording(path)
    assert "\n" not in str(caught.value)


def test_missing_path_and_empty_folder(tmp_path: Path) -> None:
    """Each is told in a sentence."""
    with pytest.raises(RecordingError, match="no such file"):
        open_recording(tmp_path / "none.mcap")
    with pytest.raises(RecordingError, match="a folder with none inside"):
        inspect(tmp_path)


def test_memory_does_not_grow_with_the_recording(tmp_path: Path) -> None:
    """Streaming 150 MB of images holds a few of them: the process stays below 60 MB more."""
    path = tmp_path / "long.mcap"
    big = np.full((600, 800), 1500, np.uint16)
    recorder = w.RosRecorder(path, chunk_size=2_000_000, compression=CompressionType.LZ4)
    recorder.transforms(w.START_NS, w.STATIC_EDGES, topic="/tf_static")
    k = [700.0, 0, 400, 0, 700.0, 300, 0, 0, 1]
    for tick in range(160):
        stamp_ns = w.START_NS + tick * w.SECOND // 10
        recorder.transforms(stamp_ns, w.drive_edges(stamp_ns))
        recorder.camera_info(f"{w.PREFIX}/camera_info", stamp_ns, k=k, size=(800, 600))
        recorder.image(f"{w.PREFIX}/image_rect_raw", stamp_ns, big, "16UC1")
    recorder.finish()
    script = (
        "import resource, sys; from pathlib import Path\n"
        "from tablemap.recording import open_recording\n"
        "def peak(): return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "r = open_recording(Path(sys.argv[1])); f = r.depth_frames(); next(f); a = peak()\n"
        "n = 1 + sum(1 for _ in f); print(n, peak() - a)"
    )
    ran = subprocess.run(
        [sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=True
    )
    frames, grown_kib = map(int, ran.stdout.split())
    assert frames == 160
    assert grown_kib < 30_000


def test_checksums_are_those_of_the_container(drive: bytes) -> None:
    """The chunks of the yardstick do carry checksums, so that the tests above test them."""
    at = chunk_offsets(drive)[0]
    (crc,) = struct.unpack_from("<I", drive, at + 9 + 24)
    assert crc != 0
    assert zlib.crc32(b"") == 0
