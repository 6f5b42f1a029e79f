"""A sensor's clock that differs from that of TF is mended where the motion shows it, or named."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tablemap.config import TopicsConfig
from tablemap.errors import RecordingError
from tablemap.recording import Recording, inspect, open_recording
from tablemap.recording.clocks import Lags, Way, offset_by_change, offset_of_stops, stands_at
from tablemap.simulation import Scenario, simulate, write
from tablemap.simulation.scenario import CameraSection, Robot, Table
from tests.making.rewriting import DIALECTS, SECOND, Change, Dialect, Entry, restamped, rewrite

CAMERA = ("Image", "CompressedImage", "CameraInfo")


def behind(seconds: float, *types: str) -> Change:
    """Let the clock of what sends some types be so many seconds behind; the log's is right."""

    def change(entry: Entry) -> Iterable[Entry]:
        return [restamped(entry, -round(seconds * SECOND)) if entry.type in types else entry]

    return change


def slower(seconds: float, *types: str) -> Change:
    """Log some types so many seconds later; their stamps are right."""

    def change(entry: Entry) -> Iterable[Entry]:
        late = entry.type in types
        return [replace(entry, log_ns=entry.log_ns + round(seconds * SECOND)) if late else entry]

    return change


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("seconds", [0.35, -7200.0])
def test_the_lasers_clock_is_mended(
    tmp_path: Path, plain_recording: Path, dialect: Dialect, seconds: float
) -> None:
    """What it sees changes when the robot moves: its stamps are moved, to a few hundredths."""
    change = behind(seconds, "LaserScan")
    path = rewrite(plain_recording, tmp_path / "r.mcap", change, dialect=dialect)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        (warning,) = recording.warnings
        assert warning.code == "recording.clock"
        said = re.search(r"laser's clock is ([0-9.]+) s (behind|ahead)", warning.message)
        assert said is not None
        assert float(said[1]) == pytest.approx(abs(seconds), abs=0.05)
        assert said[2] == ("behind" if seconds > 0 else "ahead")
        assert "topics.laser_clock_offset=" in warning.message
        off = (recording.scan_stamps() - plain.scan_stamps()) / SECOND
        assert np.abs(off).max() < 0.05
        stamps = [scan.stamp_ns for scan in recording.scans()]
        assert np.array_equal(stamps, recording.scan_stamps())
    assert warning.code in [each.code for each in inspect(path).warnings]


def behind_with_log(seconds: float, *types: str) -> Change:
    """Let stamps and log times of some types be so many seconds behind, as in a converted log."""

    def change(entry: Entry) -> Iterable[Entry]:
        if entry.type not in types:
            return [entry]
        shift_ns = -round(seconds * SECOND)
        return [replace(restamped(entry, shift_ns), log_ns=entry.log_ns + shift_ns)]

    return change


@pytest.mark.parametrize(("seconds", "is_sure"), [(3.0, True), (-3.0, False), (1.0, True)])
def test_a_lasers_clock_that_the_log_does_not_show(
    tmp_path: Path, plain_recording: Path, seconds: float, is_sure: bool
) -> None:
    """A log whose times are the stamps shows no difference, and the motion alone does.

    Where another offset fits the evenly spaced stops nearly as well, the clock is only named.
    """
    path = rewrite(plain_recording, tmp_path / "r.mcap", behind_with_log(seconds, "LaserScan"))
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        (warning,) = recording.warnings
        assert warning.code == ("recording.clock" if is_sure else "accuracy.clock")
        said = re.search(r"--set topics.laser_clock_offset=(-?[0-9.]+[0-9])", warning.message)
        assert said is not None
        assert float(said[1]) == pytest.approx(seconds, abs=0.15)
        off = (recording.scan_stamps() - plain.scan_stamps()) / SECOND
        assert np.abs(off - (0.0 if is_sure else -seconds)).max() < 0.1


@pytest.mark.parametrize("seconds", [3.0, -3.0])
def test_a_cameras_clock_that_the_log_does_not_show(
    tmp_path: Path, plain_recording: Path, seconds: float
) -> None:
    """The images that were taken between the stops are moved to the stops."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", behind_with_log(seconds, *CAMERA))
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        (warning,) = recording.warnings
        assert warning.code == "recording.clock"
        assert "camera's clock" in warning.message
        off = (recording.depth_stamps() - plain.depth_stamps()) / SECOND
        assert np.abs(off).max() < 1.0
        assert stands_at(recording.depth_stamps(), way_in(recording))


def way_in(recording: Recording) -> Way:
    """Return the way of the wheels, every fiftieth of a second."""
    stamps = np.arange(recording.start_ns, recording.end_ns, SECOND // 50, dtype=np.int64)
    return Way.of(stamps, *recording.odom_from_bases(stamps))


def test_images_between_stops_have_no_offset_where_several_would_do() -> None:
    """Nor do images that come all the time, or from few places."""
    cycle = np.tile(np.concatenate([np.zeros(150), np.full(150, 0.004)]), 12)
    stamps = np.arange(len(cycle), dtype=np.int64) * SECOND // 50
    way = Way(stamps, np.cumsum(cycle), np.ones(len(cycle), bool))
    # Six seconds a cycle, of which three stand; the images come in the middle of the drives.
    driving = (np.arange(3, 9, dtype=np.int64) * 6 * SECOND) + 9 * SECOND // 2
    assert not stands_at(driving, way)
    assert offset_of_stops(driving, way) is None
    assert offset_of_stops(driving[:3], way) is None
    assert offset_of_stops(stamps[::10], way) is None


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_camera_that_takes_images_at_stops(
    tmp_path: Path, plain_recording: Path, dialect: Dialect
) -> None:
    """Two hours ahead by the log, all its images were taken while the robot stood: it is mended."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", behind(-7200, *CAMERA), dialect=dialect)
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        (warning,) = recording.warnings
        assert warning.code == "recording.clock"
        assert re.search(r"camera's clock is 7200\.\d+ s ahead of", warning.message)
        assert np.abs(recording.depth_stamps() - plain.depth_stamps()).max() < 0.01 * SECOND
        assert len(list(recording.depth_frames())) == len(plain.depth_stamps())
    assert not inspect(path).missing


def test_slow_messages_are_no_wrong_clock(tmp_path: Path, plain_recording: Path) -> None:
    """Scans and images that are logged late, with right stamps, are left as they are."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", slower(0.6, "LaserScan", *CAMERA))
    with open_recording(plain_recording) as plain, open_recording(path) as recording:
        assert recording.warnings == []
        assert np.array_equal(recording.scan_stamps(), plain.scan_stamps())
        assert np.array_equal(recording.depth_stamps(), plain.depth_stamps())
    assert inspect(path).warnings == ()


def unsteady(entry: Entry) -> Iterable[Entry]:
    """Let the camera's clock be two hours behind, and run on at twice the pace."""
    if entry.type not in CAMERA:
        return [entry]
    return [restamped(entry, -7200 * SECOND + (entry.stamp_ns % (100 * SECOND)))]


def test_what_no_motion_shows_is_refused_by_its_offset(
    tmp_path: Path, plain_recording: Path
) -> None:
    """Images without any pose: the offset and its setting are named, and ``info`` is not ready."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", unsteady)
    with pytest.raises(RecordingError) as refused:
        open_recording(path)
    sentence = str(refused.value)
    assert "No depth image has a pose" in sentence
    assert re.search(r"camera's clock seems to be 71\d\d\.\d+ s behind", sentence)
    assert "by no steady time" in sentence
    assert "topics.clock_offset=71" in sentence
    assert sentence in inspect(path).missing


def test_stamps_that_never_meet(tmp_path: Path, plain_recording: Path) -> None:
    """Where the log's times tell nothing, the refusal says how far apart the stamps are."""

    def moved(entry: Entry) -> Iterable[Entry]:
        if entry.type not in CAMERA:
            return [entry]
        return [replace(restamped(entry, -3600 * SECOND), log_ns=entry.log_ns - 3600 * SECOND)]

    path = rewrite(plain_recording, tmp_path / "r.mcap", moved)
    with pytest.raises(RecordingError, match=r"from \+3[56]\d\d\.\d s after the first") as said:
        open_recording(path)
    assert "topics.clock_offset=SECONDS" in str(said.value)
    assert str(said.value) in inspect(path).missing
    given = TopicsConfig(clock_offset=3600.0)
    with (
        open_recording(plain_recording) as plain,
        open_recording(path, topics=given) as recording,
    ):
        assert np.array_equal(recording.depth_stamps(), plain.depth_stamps())
        assert recording.warnings == []
    assert not inspect(path, topics=given).missing


@pytest.fixture(scope="module")
def moving_recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a drive past five stops with six small images a second, on the way too."""
    scenario = Scenario(
        name="moving",
        description="a robot that looks while it drives",
        table=Table(shape="rectangle", length=1.2, width=0.8, height=0.755),
        robot=Robot(stops=5, span_deg=180, images_per_stop=1, colour=False, continuous_rate=6.0),
        camera=CameraSection(width=160, height=120),
    )
    path = tmp_path_factory.mktemp("moving") / "moving.mcap"
    write(simulate(scenario, seed=1, nominal=True), path, profile="ros2")
    return path


def check_mended_or_named(source: Path, path: Path, seconds: float) -> bool:
    """Check that all stamps are right to 20 ms, or untouched and named; tell whether they moved."""
    with open_recording(source) as plain, open_recording(path) as recording:
        known = {each.message for each in plain.warnings}
        said = [each.message for each in recording.warnings if each.code.endswith(".clock")]
        (message,) = set(said) - known
        off = [(recording.depth_stamps() - plain.depth_stamps()) / SECOND]
        if recording.names.laser:
            off.append((recording.scan_stamps() - plain.scan_stamps()) / SECOND)
    worst = max(float(np.abs(each).max()) for each in off)
    named = re.search(r"clock_offset=(-?[0-9.]+[0-9])", message)
    assert named is not None
    assert float(named[1]) == pytest.approx(seconds, abs=0.02)
    if "stamps were moved" in message:
        assert worst < 0.02
        return True
    assert worst == pytest.approx(abs(seconds))
    return False


@pytest.mark.parametrize("types", [CAMERA, ("LaserScan",)], ids=["camera", "laser"])
@pytest.mark.parametrize("seconds", [0.15, 0.4, -0.15, -0.4])
def test_a_clock_is_known_to_20_ms_from_a_drive_or_named(
    tmp_path: Path, moving_recording: Path, types: tuple[str, ...], seconds: float
) -> None:
    """0.4 s are told from messages that come late; 0.15 s where the motion is clear enough."""
    path = rewrite(moving_recording, tmp_path / "r.mcap", behind(seconds, *types))
    moved = check_mended_or_named(moving_recording, path, seconds)
    assert moved or abs(seconds) < 0.4


@pytest.mark.parametrize("seconds", [0.15, 0.4, -0.4])
def test_a_held_camera_that_moves_all_the_time(
    tmp_path: Path, real_recordings: Path, seconds: float
) -> None:
    """Its few real images do not tell for sure: the offset is named, or right to 20 ms."""
    source = real_recordings / "kitchen_near_end.mcap"
    path = rewrite(source, tmp_path / "r.mcap", behind(seconds, *CAMERA))
    check_mended_or_named(source, path, seconds)


@pytest.mark.parametrize(
    ("seconds", "code", "says"),
    [
        (0.4, "recording.clock", "logged 0.40 s later after their stamps than those of TF"),
        (-0.4, "accuracy.clock", "seems to be 0.40 s ahead of"),
    ],
)
def test_a_clock_that_the_motion_does_not_show_is_named(
    tmp_path: Path, real_recordings: Path, seconds: float, code: str, says: str
) -> None:
    """Poses that wander hide it: nothing is moved, what is open is said, and how to set it."""
    source = real_recordings / "kitchen.mcap"
    path = rewrite(source, tmp_path / "r.mcap", behind(seconds, *CAMERA))
    with open_recording(source) as plain, open_recording(path) as recording:
        off = recording.depth_stamps() - plain.depth_stamps()
        assert np.all(off == -round(seconds * SECOND))
        (message,) = (each.message for each in recording.warnings if each.code == code)
        assert says in message
        assert f"--set topics.clock_offset={seconds:.3f}" in message


def way_of_stops() -> Way:
    """Return a drive that moves for two seconds and stands for two, 40 s long."""
    stamps = np.arange(0, 40 * SECOND, SECOND // 50, dtype=np.int64)
    speed = ((stamps // (2 * SECOND)) % 2 == 0) * 0.3
    metres = np.cumsum(speed) / 50
    return Way(stamps, metres, np.ones(len(stamps), dtype=bool))


@pytest.mark.parametrize("offset_s", [0.0, 0.27, -0.8, 5000.0])
def test_the_offset_from_changes(offset_s: float) -> None:
    """Noisy changes give the offset to a hundredth; changes at random give none."""
    rng = np.random.default_rng(1)
    way = way_of_stops()
    true = np.arange(2 * SECOND, 38 * SECOND, SECOND // 15, dtype=np.int64)
    change = np.abs(np.diff(np.interp(true, way.stamps_ns, way.metres)))
    change = change * rng.uniform(0.5, 2.0, len(change)) + rng.uniform(0, 0.004, len(change))
    stamped = true - round(offset_s * SECOND)
    pairs = stamped[:-1], stamped[1:]
    found = offset_by_change(*pairs, change, way, about_s=offset_s + 0.15)
    assert found is not None
    assert found.seconds == pytest.approx(offset_s, abs=0.02)
    assert found.sigma < 0.02
    assert found.decided(offset_s or 0.5) == pytest.approx(offset_s, abs=0.02)
    shuffled = rng.permutation(change)
    assert offset_by_change(*pairs, shuffled, way, about_s=offset_s) is None


def test_stops_and_what_lies_beside_them() -> None:
    """Images in the middle of stops are at stops, one in motion is not, nor one off the drive."""
    stops = (np.arange(1, 9) * 4 + 3) * SECOND
    assert stands_at(stops, way_of_stops())
    assert not stands_at(stops + 2 * SECOND, way_of_stops())
    assert not stands_at(stops + 3600 * SECOND, way_of_stops())


def test_lags_are_bounded() -> None:
    """Of a million messages a few thousand lags are kept, over all of the drive."""
    lags = Lags()
    for lag in range(100_000):
        lags.add(lag * 1000)
    kept = lags.seconds()
    assert 1000 < len(kept) <= 4096
    assert kept[-1] > 0.95 * 0.1
