"""Depth on several image transports: what keeps the values is read, a JPEG is not depth."""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tablemap.errors import RecordingError
from tablemap.recording import inspect, open_recording
from tests.making.messages import ROS2
from tests.making.rewriting import DIALECTS, Dialect, Entry, depth_of, rewrite


def as_jpeg(entry: Entry) -> Entry:
    """Return a depth image as the transport for pictures sends it: eight bits, with losses."""
    grey = (depth_of(entry) // 16).clip(0, 255).astype(np.uint8)
    stream = io.BytesIO()
    Image.fromarray(grey).save(stream, "JPEG")
    message = ROS2.types["sensor_msgs/msg/CompressedImage"](
        header=entry.message.header,
        format="16UC1; jpeg compressed mono8",
        data=np.frombuffer(stream.getvalue(), np.uint8),
    )
    topic = entry.topic.removesuffix("/compressedDepth")
    return replace(entry, topic=f"{topic}/compressed", message=message)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_jpeg_beside_a_lossless_transport(
    tmp_path: Path, plain_recording: Path, dialect: Dialect
) -> None:
    """The lossless one is read, and nothing is to be said, for the JPEG is no depth."""

    def both(entry: Entry) -> Iterable[Entry]:
        return [as_jpeg(entry), entry] if entry.is_depth else [entry]

    path = rewrite(plain_recording, tmp_path / "r.mcap", both, dialect=dialect)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        assert recording.warnings == []
        for ours, theirs in zip(recording.depth_frames(), plain.depth_frames(), strict=True):
            assert np.array_equal(ours.depth, theirs.depth, equal_nan=True)
    assert not inspect(path).missing


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_jpeg_alone(tmp_path: Path, plain_recording: Path, dialect: Dialect) -> None:
    """It is refused by its name, with what to record in its place."""

    def alone(entry: Entry) -> Iterable[Entry]:
        return [as_jpeg(entry) if entry.is_depth else entry]

    path = rewrite(plain_recording, tmp_path / "r.mcap", alone, dialect=dialect)
    with pytest.raises(RecordingError, match=r"/compressed has JPEG images.*compressedDepth"):
        open_recording(path)
    assert any("JPEG" in sentence for sentence in inspect(path).missing)
