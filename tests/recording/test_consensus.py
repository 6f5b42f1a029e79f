"""A lone message never outvotes many: what it says is left out, and that is said."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tablemap.geometry import Pose2
from tablemap.recording import inspect, open_recording
from tests.making.rewriting import DIALECTS, Change, Dialect, Entry, edit, rewrite, with_edges

PLACES = ("first", "middle", "last")
WAYS: tuple[tuple[str, Dialect], ...] = (
    *(("first", dialect) for dialect in DIALECTS),
    ("middle", "ros1"),
    ("last", "ros2"),
)


def one_of(kind: str, place: str, change: Change, *, count: int, times: int = 1) -> Change:
    """Change one of the ``count`` messages of a kind, or so many after each other."""
    first = {"first": 0, "middle": count // 2, "last": count - times}[place]
    seen = [0]

    def changed(entry: Entry) -> Iterable[Entry]:
        is_one = entry.type == kind and (kind != "TFMessage" or entry.topic == "/tf")
        seen[0] += is_one
        if is_one and first < seen[0] <= first + times:
            yield from change(entry)
        else:
            yield entry

    return changed


def renamed(old: str, new: str, *, child: bool = False) -> Change:
    """Change the name of one frame in all transforms of a message."""

    def change(entry: Entry) -> Iterable[Entry]:
        transforms = []
        for each in entry.message.transforms:
            if child and each.child_frame_id == old:
                each = replace(each, child_frame_id=new)
            elif not child and each.header.frame_id == old:
                each = replace(each, header=replace(each.header, frame_id=new))
            transforms.append(each)
        yield edit(entry, transforms=transforms)

    return change


def number_of(path: Path, kind: str) -> int:
    """Return how many messages of a kind a recording has; of transforms those on /tf."""
    topics = inspect(path).topics
    names = {"TFMessage": "/tf", "CameraInfo": "camera_info"}
    return sum(t.count for t in topics if t.name.endswith(names.get(kind, kind)))


@pytest.fixture(scope="module")
def many(plain_recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plain drive with each image, its calibration and the static transforms sent often."""

    def often(entry: Entry) -> Iterable[Entry]:
        yield entry
        if entry.type == "CameraInfo" or entry.topic == "/tf_static":
            for later in range(1, 40 if entry.topic == "/tf_static" else 6):
                yield replace(entry, log_ns=entry.log_ns + later * 1_000_000)

    return rewrite(plain_recording, tmp_path_factory.mktemp("many") / "many.mcap", often)


def check_poses(path: Path, plain: Path) -> list[str]:
    """Check that every pose and calibration is the plain drive's; return what is said."""
    with open_recording(plain) as sound, open_recording(path) as recording:
        assert recording.names == sound.names
        ours, theirs = list(recording.depth_frames()), list(sound.depth_frames())
        assert [f.stamp_ns for f in ours] == [f.stamp_ns for f in theirs]
        for one, other in zip(ours, theirs, strict=True):
            assert np.allclose(one.k, other.k, rtol=1e-12)
            assert np.allclose(one.base_from_camera, other.base_from_camera, atol=1e-9)
        stamps = sound.pose_stamps()
        for pair in (
            (recording.fixed_from_bases(stamps), sound.fixed_from_bases(stamps)),
            (recording.odom_from_bases(stamps), sound.odom_from_bases(stamps)),
        ):
            covered = pair[0][1]
            assert covered.mean() > 0.99
            assert np.allclose(pair[0][0][covered], pair[1][0][covered], atol=0.02)
        assert len(recording.scan_stamps()) >= len(sound.scan_stamps()) - 1
        return [warning.code for warning in recording.warnings]


@pytest.mark.parametrize(("place", "dialect"), WAYS)
@pytest.mark.parametrize(
    "change",
    [
        renamed("map", "mbp"),
        renamed("odom", "odol"),
        renamed("odom", "odol", child=True),
        renamed("base_footprint", "base_foot", child=True),
    ],
)
def test_one_wrong_letter_gives_no_frame_two_parents(
    tmp_path: Path, many: Path, change: Change, place: str, dialect: Dialect
) -> None:
    """Whether in a parent's name or a child's, and wherever it comes."""
    count = number_of(many, "TFMessage")
    path = rewrite(
        many, tmp_path / "r.mcap", one_of("TFMessage", place, change, count=count), dialect=dialect
    )
    said = check_poses(path, many)
    assert set(said) <= {"recording.damaged"}
    assert not inspect(path).missing


def with_k(share: float) -> Change:
    """Change a calibration's focal lengths."""

    def change(entry: Entry) -> Iterable[Entry]:
        k, p = entry.message.k.copy(), entry.message.p.copy()
        k[[0, 4]] *= share
        p[[0, 5]] *= share
        yield edit(entry, k=k, p=p)

    return change


@pytest.mark.parametrize(("place", "dialect"), WAYS)
@pytest.mark.parametrize("share", [1.05, 0.5, 16.0])
def test_one_wrong_calibration_changes_no_image(
    tmp_path: Path, many: Path, share: float, place: str, dialect: Dialect
) -> None:
    """The first one neither, which had been believed until the next came."""
    count = number_of(many, "CameraInfo")
    change = one_of("CameraInfo", place, with_k(share), count=count)
    path = rewrite(many, tmp_path / "r.mcap", change, dialect=dialect)
    assert check_poses(path, many) == ["recording.calibration"]


def test_a_calibration_that_changes_is_not_outvoted(tmp_path: Path, many: Path) -> None:
    """Three messages of a camera that was set otherwise are no damage."""
    count = number_of(many, "CameraInfo")
    change = one_of("CameraInfo", "last", with_k(1.5), count=count, times=6)
    path = rewrite(many, tmp_path / "r.mcap", change)
    with open_recording(path) as recording, open_recording(many) as plain:
        last = list(recording.depth_frames())[-1]
        assert last.k[0, 0] == pytest.approx(1.5 * list(plain.depth_frames())[-1].k[0, 0])


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("what", ["place", "parent"])
def test_one_wrong_mounting_of_many_is_left_out(
    tmp_path: Path, many: Path, place: str, what: str
) -> None:
    """Of static transforms that are sent again and again the last one need not be right."""

    def moved(parent: str, child: str, _: int, pose: Pose2) -> Pose2:
        return Pose2(pose.x + 0.02, pose.y, pose.yaw) if child.startswith("base_range") else pose

    def elsewhere(entry: Entry) -> Iterable[Entry]:
        other = with_edges(entry, moved)
        assert other is not None
        yield other

    change = elsewhere if what == "place" else renamed("base_link", "bbse_link")
    number = [0]
    statics = sum(t.count for t in inspect(many).topics if t.name == "/tf_static")
    chosen = {"first": 1, "middle": statics // 2, "last": statics}[place]

    def one(entry: Entry) -> Iterable[Entry]:
        number[0] += entry.topic == "/tf_static"
        is_one = entry.topic == "/tf_static" and number[0] == chosen
        yield from change(entry) if is_one else [entry]

    path = rewrite(many, tmp_path / "r.mcap", one)
    assert check_poses(path, many) == ["recording.damaged"]


def framed(entry: Entry) -> Iterable[Entry]:
    """Change one letter of the frame in a message's header."""
    frame = entry.message.header.frame_id
    yield edit(entry, header=replace(entry.message.header, frame_id=frame[:-1] + "~"))


@pytest.mark.parametrize("kind", ["CompressedImage", "CameraInfo", "LaserScan"])
def test_the_first_message_s_frame_does_not_leave_out_all_others(
    tmp_path: Path, many: Path, kind: str
) -> None:
    """One wrong letter costs the message that has it alone."""
    path = rewrite(many, tmp_path / "r.mcap", one_of(kind, "first", framed, count=1))
    with open_recording(path) as recording, open_recording(many) as plain:
        assert recording.names == plain.names
        lost = len(plain.depth_stamps()) - len(recording.depth_stamps())
        assert lost == (kind == "CompressedImage")
        assert len(plain.scan_stamps()) - len(recording.scan_stamps()) == (kind == "LaserScan")
        list(recording.depth_frames())
        list(recording.scans())
        codes = [warning.code for warning in recording.warnings]
        assert codes == ([] if kind == "CameraInfo" else ["recording.topic_choice"])
