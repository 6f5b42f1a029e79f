"""A topic is all of its channels: one for each publisher, and for each version of a schema."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tablemap.recording import Recording, inspect, open_recording
from tests.making.rewriting import (
    DIALECTS,
    SECOND,
    Dialect,
    Entry,
    reframed,
    restamped,
    rewrite,
)


def read(recording: Recording) -> tuple[list[int], list[int], list[np.ndarray], np.ndarray]:
    """Return what the stages get: stamps of images and scans, mean depths, and poses."""
    frames = list(recording.depth_frames())
    poses, known = recording.fixed_from_bases(recording.pose_stamps())
    assert known.all()
    means = [np.nanmean(frame.depth) for frame in frames]
    return [f.stamp_ns for f in frames], [s.stamp_ns for s in recording.scans()], means, poses


@pytest.mark.parametrize("dialect", DIALECTS)
def test_publishers_of_one_topic_are_read_as_one(
    tmp_path: Path, plain_recording: Path, dialect: Dialect
) -> None:
    """A node that is started again half way logs on channels of its own: nothing is left out."""
    with open_recording(plain_recording) as recording:
        whole = read(recording)
        middle = (recording.start_ns + recording.end_ns) // 2

    def restarted(entry: Entry) -> Iterable[Entry]:
        yield replace(entry, publisher="/first" if entry.log_ns < middle else "/second")

    path = rewrite(plain_recording, tmp_path / "r.mcap", restarted, dialect=dialect)
    with open_recording(path) as recording:
        again = read(recording)
        assert not recording.warnings
    for before, after in zip(whole, again, strict=True):
        assert np.allclose(before, after, atol=1e-12)
    shown = {topic.name: topic for topic in inspect(path).topics}
    depth = next(topic for topic in shown.values() if topic.role == "depth")
    assert depth.count == len(whole[0])
    assert "2 channels" in depth.detail


@pytest.mark.parametrize("kind", ["depth", "scan"])
def test_another_sensor_on_the_same_topic_is_left_out(
    tmp_path: Path, plain_recording: Path, kind: str
) -> None:
    """Two lasers, or two cameras, that share a topic are told by their frames; one is used."""

    def doubled(entry: Entry) -> Iterable[Entry]:
        yield entry
        if kind in entry.topic and entry.type in ("CompressedImage", "LaserScan"):
            other = restamped(reframed(entry, lambda name: f"second_{name}"), SECOND // 50)
            yield replace(other, log_ns=entry.log_ns + SECOND // 50)

    with open_recording(rewrite(plain_recording, tmp_path / "r.mcap", doubled)) as recording:
        stamps, scans, _, _ = read(recording)
        with open_recording(plain_recording) as plain:
            assert (stamps, scans) == read(plain)[:2]
        (warning,) = recording.warnings
        assert warning.code == "recording.topic_choice"
        assert "second_" in warning.message
