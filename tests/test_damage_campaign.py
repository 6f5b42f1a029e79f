"""A recording that is cut or has one byte changed anywhere: the same table, or a word about it.

Each damaged copy falls into one class, and the counts are printed:

- same: the same table, and nothing to say
- same with warning: the same table, and the loss is said
- doubted with warning: another table, as where a cut takes half of the views; the loss is said and
  the verdict is not good
- refused in words: no table, and a sentence that names the damage
"""

from __future__ import annotations

import hashlib
import math
import signal
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

import tablemap
from tablemap.errors import LOSSES, TablemapError
from tablemap.model import TableModel
from tablemap.recording import Recording
from tests.making.rewriting import simulate_plain

CUTS, FLIPS = 200, 500
MOST_REFUSED = 0.02
"""Share of the recordings with one changed byte that may be refused."""
SECONDS = 60
SAME_METRES = 0.005
CHUNK_BYTES = 64 * 1024  # as many chunks as a large recording has

Result = tuple[str, str]
"""The class of a copy, and what was said."""


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small recording of an ordinary lap: eight stops, in two dozen chunks."""
    folder = tmp_path_factory.mktemp("campaign")
    whole = simulate_plain(folder, width=160, profile="ros1")
    target = folder / "sound.mcap"
    with whole.open("rb") as source, target.open("wb") as stream:
        writer = Writer(stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        writer.start("ros1", "test")
        channels: dict[int, int] = {}
        for schema, channel, message in make_reader(source).iter_messages():
            assert schema is not None
            if channel.id not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, number
                )
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time
            )
        writer.finish()
    return target


@contextmanager
def alarm(what: str) -> Iterator[None]:
    """Fail where something takes too long."""

    def ring(*_: object) -> None:
        raise TimeoutError(f"{what} takes longer than {SECONDS} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def content(recording: Recording) -> str:
    """Return a digest of all that is read: equal ones give equal tables."""
    digest = hashlib.sha256(repr(recording.names).encode())
    for frame in recording.depth_frames():
        for part in (frame.stamp_ns, frame.k, frame.base_from_camera, frame.depth):
            digest.update(np.asarray(part).tobytes())
    for scan in recording.scans():
        digest.update(np.asarray([scan.stamp_ns]).tobytes() + scan.ranges.tobytes())
    stamps = recording.pose_stamps()
    for poses, known in (recording.fixed_from_bases(stamps), recording.odom_from_bases(stamps)):
        digest.update(stamps.tobytes() + poses.tobytes() + known.tobytes())
    return digest.hexdigest()


def is_same(model: TableModel, other: TableModel) -> bool:
    """Tell whether two models are of one table, legs too, within the sigmas that they state."""
    a, b = model.surface, other.surface
    if a.shape != b.shape or len(model.legs) != len(other.legs):
        return False
    pairs = [
        (a.height, b.height),
        *((a.dimensions[name], b.dimensions[name]) for name in a.dimensions),
    ]
    return all(
        abs(first.value - second.value)
        < max(SAME_METRES, 3 * math.hypot(first.sigma or 0.0, second.sigma or 0.0))
        for first, second in pairs
    )


class Campaign:
    """Judges damaged copies of one recording; copies that are read alike are processed once."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.data = path.read_bytes()
        self.folder = folder
        with tablemap.open_recording(path) as recording:
            self.known = {content(recording): self._model(path)}
        (expected,) = self.known.values()
        assert isinstance(expected, TableModel)
        assert expected.verdict.level == "good"
        self.expected = expected

    def judge(self, data: bytes) -> Result:
        """Return the class of a copy. Raises what is none of ours."""
        path = self.folder / "damaged.mcap"
        path.write_bytes(data)
        with alarm("reading and processing"):
            try:
                with tablemap.open_recording(path) as recording:
                    key = content(recording)
                    said = [each.message for each in recording.warnings if each.code in LOSSES]
            except TablemapError as error:
                return "refused in words", str(error)
            if key not in self.known:
                self.known[key] = self._model(path)
        found = self.known[key]
        if isinstance(found, str):
            return "refused in words", found
        if is_same(found, self.expected):
            return ("same with warning" if said else "same"), " ".join(said)
        if said and found.verdict.level != "good":
            return "doubted with warning", " ".join(said)
        return f"silently another ({found.verdict.level})", " ".join(said)

    def _model(self, path: Path) -> TableModel | str:
        with tablemap.open_recording(path) as recording:
            try:
                return tablemap.process(recording).model
            except TablemapError as error:
                return str(error)


def report(title: str, results: list[Result], capsys: pytest.CaptureFixture[str]) -> Counter[str]:
    """Show how many copies are of each class."""
    counts = Counter(kind for kind, _ in results)
    words = ", ".join(f"{kind} {number}" for kind, number in counts.most_common())
    with capsys.disabled():
        sys.stdout.write(f"\n{title}: {words}\n")
    return counts


CLASSES = {"same", "same with warning", "doubted with warning", "refused in words"}


@pytest.mark.slow
def test_one_changed_byte_hardly_ever_costs_the_table(
    sound: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of 500 at most 2 % are refused, each in words; no table is silently another one."""
    campaign = Campaign(sound, tmp_path)
    rng = np.random.default_rng(15)
    results = []
    for _ in range(FLIPS):
        damaged = bytearray(campaign.data)
        damaged[int(rng.integers(len(damaged)))] ^= int(rng.integers(1, 256))
        results.append(campaign.judge(bytes(damaged)))
    counts = report(f"{FLIPS} recordings with one changed byte", results, capsys)
    assert set(counts) <= CLASSES
    refused = [said for kind, said in results if kind == "refused in words"]
    assert len(refused) <= MOST_REFUSED * FLIPS, refused
    assert all("damaged" in said or "cut" in said for said in refused), refused


@pytest.mark.slow
def test_a_recording_that_is_cut_anywhere_gives_what_it_has(
    sound: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """From its first byte to its last: a table with the loss said, or a sentence."""
    campaign = Campaign(sound, tmp_path)
    ends = (np.linspace(0.001, 0.9999, CUTS) * len(campaign.data)).astype(int)
    results = [campaign.judge(campaign.data[:end]) for end in ends]
    counts = report(f"{CUTS} recordings that are cut", results, capsys)
    assert set(counts) <= CLASSES
    assert "same" not in counts  # the end is always missed
    assert all(said for _, said in results)
