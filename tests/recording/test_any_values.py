"""Whatever values messages hold and whatever records a container: a reading, or a sentence."""

from __future__ import annotations

import io
import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode

from tablemap.archive.manifest import Manifest
from tablemap.config import LimitsConfig
from tablemap.errors import RecordingError, TablemapError
from tablemap.model import TableModel
from tablemap.model.documents import DocumentError
from tablemap.recording import inspect, open_recording
from tablemap.recording.decoding import Decoder
from tablemap.recording.mcap.container import Container
from tablemap.recording.messages import DecodingError
from tablemap.recording.raw import Channel, RawMessage
from tests.making import hostile
from tests.making import messages as w
from tests.making.models import rectangle_model

repeatable = settings(
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
few, some, many = (settings(repeatable, max_examples=n) for n in (25, 100, 300))

BIG = 1e308
doubles = st.one_of(st.floats(), st.sampled_from([0.0, -0.0, 1e-320, BIG, -BIG, 1.0]))
singles = st.floats(width=32)
names = st.one_of(
    st.sampled_from(["map", "odom", "base_footprint", "base_link", w.CAMERA, w.LASER, ""]),
    st.text(st.characters(codec="utf-8"), max_size=8),
)
edges = st.tuples(
    names, names, st.tuples(*[doubles] * 3), st.one_of(st.just(w.LEVEL), st.tuples(*[doubles] * 4))
)
calibrations = st.fixed_dictionaries(
    {},
    optional={
        "k": st.lists(doubles, min_size=9, max_size=9),
        "p": st.lists(doubles, min_size=12, max_size=12),
        "d": st.lists(doubles, max_size=14).map(tuple),
        "size": st.tuples(st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1)),
        "frame": names,
        "model": st.sampled_from(["plumb_bob", "rational_polynomial", "equidistant", "", "x"]),
    },
)
angles = ("angle_min", "angle_max", "angle_increment")
scans = st.fixed_dictionaries(
    {},
    optional={
        **dict.fromkeys(
            (*angles, "time_increment", "scan_time", "range_min", "range_max"), singles
        ),
        "ranges": st.lists(singles, max_size=40).map(lambda own: np.array(own, np.float32)),
        "frame": names,
    },
)


@few
@given(
    calibration=calibrations,
    scan=scans,
    more=st.lists(edges, max_size=4),
    stamp=st.sampled_from([0, 1, w.START_NS, 2**31 * w.SECOND - 1]),
    static=st.booleans(),
)
def test_messages_of_any_values_are_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory,
    calibration: dict[str, Any],
    scan: dict[str, Any],
    more: list[Any],
    stamp: int,
    static: bool,
) -> None:
    """Calibrations, scans and transforms with numbers, names and stamps of any kind."""
    path = tmp_path_factory.mktemp("any") / "drive.mcap"

    def calibrate(recorder: w.RosRecorder, stamp_ns: int) -> None:
        recorder.camera_info(f"{w.PREFIX}/camera_info", stamp_ns, **calibration)
        recorder.transforms(stamp, more, topic="/tf_static" if static else "/tf")

    w.write_drive(path, calibration=calibrate, scan_fields=scan)
    try:
        inspect(path).tree_lines()
        with open_recording(path) as recording:
            for frame in recording.depth_frames():
                assert np.all(np.isfinite(frame.k))
                assert np.all(np.isfinite(frame.base_from_camera))
            for each in recording.scans():
                assert np.all(np.isfinite(each.angles))
            poses, known = recording.fixed_from_bases(recording.pose_stamps())
            assert np.all(np.isfinite(poses[known]))
    except RecordingError as error:
        assert str(error).endswith((".", "FILE")) or ":" in str(error)


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_numbers_that_signal_or_overflow_are_read_without_a_word(tmp_path: Path) -> None:
    """NaNs that signal, in depth and ranges, and quaternions beyond all bounds."""
    signal = np.array([0x7FA00000], np.uint32).view(np.float32)
    depth = w.plane()
    depth[:4, :4] = signal
    ranges = np.linspace(1, 2, 31).astype(np.float32)
    ranges[:3] = signal

    def image(recorder: w.RosRecorder, stamp_ns: int) -> None:
        recorder.image(f"{w.PREFIX}/image_rect_raw", stamp_ns, depth, "32FC1")
        recorder.transforms(stamp_ns, [("map", "odom", (0.0, 0.0, 0.0), (BIG, BIG, BIG, BIG))])

    path = tmp_path / "drive.mcap"
    w.write_drive(path, depth=image, scan_fields={"ranges": ranges})
    with open_recording(path) as recording:
        for frame in recording.depth_frames():
            assert np.isnan(frame.depth.astype(np.float64)[:4, :4]).all()
        for scan in recording.scans():
            assert np.isnan(scan.ranges.astype(np.float64)[:3]).all()
        assert [each.code for each in recording.warnings] == ["recording.damaged"]


times = st.sampled_from([0, 1, 5, 10**9, 2**63 - 1, 2**63, 2**64 - 1])
numbers = st.integers(0, 3)
records = st.one_of(
    st.builds(
        hostile.schema,
        numbers,
        st.sampled_from(["sensor_msgs/Image", "x", ""]),
        st.sampled_from(["ros1msg", "protobuf", ""]),
        st.binary(max_size=40),
    ),
    st.builds(
        hostile.channel,
        numbers,
        numbers,
        st.sampled_from(["/a", "/b", ""]),
        st.sampled_from(["ros1", "cdr", "raw"]),
    ),
    st.builds(hostile.message, numbers, times, st.binary(max_size=60)),
    st.builds(hostile.record, st.sampled_from([int(each) for each in Opcode]), st.binary()),
    st.binary(max_size=30),
)
chunks = st.builds(
    lambda own, compression, start, end, declared: hostile.chunk(
        b"".join(own),
        compression=compression,
        start_ns=start,
        end_ns=end,
        packed=b"".join(own) if compression in ("", "x") else None,
        declared=declared,
    ),
    st.lists(records, max_size=8),
    st.sampled_from(["zstd", "zstd", "lz4", "", "x"]),
    times,
    times,
    st.one_of(st.none(), st.sampled_from([0, 1, 10**6, 2**63])),
)


@many
@given(st.lists(st.one_of(records, chunks), max_size=8), st.booleans(), st.integers(0, 60))
def test_containers_of_any_records_are_read_or_refused(
    parts: list[bytes], has_end: bool, cut: int
) -> None:
    """In any order, with any claims, with or without an end; messages come out in time."""
    data = hostile.file_of(*parts) if has_end else hostile.header() + b"".join(parts)
    data = data[: len(data) - cut]
    try:
        container = Container(io.BytesIO(data), limits=LimitsConfig(chunk_mib=1))
        found = [each.log_time_ns for each in container.messages(container.channels)]
        assert found == sorted(found)
        assert len(found) <= sum(container.counts.values())
    except RecordingError as error:
        assert str(error)


@cache
def ordinary() -> tuple[tuple[Channel, bytes], ...]:
    """Return each channel of the drive, in ROS 1 and 2, with its first message."""
    found = []
    for version in (1, 2):
        buffer = io.BytesIO()
        w.write_drive(buffer, version=version)
        container = Container(io.BytesIO(buffer.getvalue()))
        for number, channel in container.channels.items():
            first = next(iter(container.messages([number])))
            found.append((channel, bytes(first.data)))
    return tuple(found)


@many
@given(
    place=st.integers(0, 11),
    changes=st.lists(st.tuples(st.integers(0, 400), st.integers(0, 255)), max_size=6),
    end=st.one_of(st.none(), st.integers(0, 400)),
)
def test_messages_with_any_bytes_changed_are_decoded_or_refused(
    place: int, changes: list[tuple[int, int]], end: int | None
) -> None:
    """Lengths, names and numbers alike."""
    channel, data = ordinary()[place % len(ordinary())]
    damaged = bytearray(data[:end])
    for at, value in changes:
        if at < len(damaged):
            damaged[at] = value
    try:
        Decoder(channel).decode(RawMessage(1, channel.id, memoryview(damaged)))
    except DecodingError as error:
        assert str(error)


values = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), doubles, st.text(max_size=5)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=6,
)
MODEL = json.loads(rectangle_model().to_json())
MANIFEST = {
    "schema": "tablemap/manifest/1",
    "run_id": "a",
    "recording": {"path": "a.mcap", "size": 1, "sha256": None},
    "method": "tablemap",
    "tables": "best",
    "seed": 0,
    "versions": {},
    "started": "2026-05-01T12:00:00+00:00",
}


@some
@given(st.sampled_from(sorted(MODEL)), values)
def test_tables_of_any_values_are_read_or_refused(key: str, value: object) -> None:
    """What is read can be written again."""
    try:
        model = TableModel.from_json(json.dumps(MODEL | {key: value}))
    except TablemapError as error:
        assert "table model" in str(error)
    else:
        json.loads(model.to_json(), parse_constant=pytest.fail)


@some
@given(st.sampled_from(sorted(MANIFEST)), values)
def test_manifests_of_any_values_are_read_or_refused(key: str, value: object) -> None:
    """And their recordings are there or not."""
    try:
        manifest = Manifest.from_json(json.dumps(MANIFEST | {key: value}))
    except DocumentError:
        return
    manifest.recording.input.exists()
    manifest.to_json()
