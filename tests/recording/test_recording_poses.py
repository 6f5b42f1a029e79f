"""Poses that topics tell where TF lacks them, and mountings that a file tells."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tablemap.config import SensorsConfig, TopicsConfig
from tablemap.errors import RecordingError
from tablemap.recording import inspect, open_recording
from tablemap.stages.registration.solution import localisation_anchors
from tests.making import messages as w
from tests.making.command import tablemap
from tests.making.made_up_run import MadeUpRecording, snapshot
from tests.making.messages import ROS2
from tests.making.rewriting import SECOND, Change, Dialect, Entry, rewrite, with_edges

COVARIANCE = np.diag([0.04, 0.09, 0.0, 0.0, 0.0, 0.01])


def without(*children: str) -> Change:
    """Return what leaves the transforms to some frames out."""

    def change(entry: Entry) -> Iterable[Entry]:
        if entry.type != "TFMessage":
            return [entry]
        kept = with_edges(entry, lambda _, child, __, pose: None if child in children else pose)
        return [] if kept is None else [kept]

    return change


def posed(
    source: Path, kind: str, *, topic: str, every: float, child: str = "base_footprint"
) -> Change:
    """Return what logs the base's poses on a topic, every so many seconds, beside each scan."""
    recording = open_recording(source)
    last = [0]

    def change(entry: Entry) -> Iterable[Entry]:
        yield entry
        if entry.type != "LaserScan" or entry.log_ns - last[0] < every * SECOND:
            return
        wheels = kind == "nav_msgs/msg/Odometry"
        find = recording.odom_from_base if wheels else recording.fixed_from_base
        pose = find(entry.stamp_ns)
        if pose is None:
            return
        last[0] = entry.log_ns
        get = ROS2.types.__getitem__
        header = get("std_msgs/msg/Header")(
            stamp=entry.message.header.stamp, frame_id="odom" if wheels else "map"
        )
        turn = Rotation.from_matrix(pose[:3, :3]).as_quat()
        plain = get("geometry_msgs/msg/Pose")(
            position=get("geometry_msgs/msg/Point")(*pose[:3, 3]),
            orientation=get("geometry_msgs/msg/Quaternion")(*turn),
        )
        fields: dict[str, Any] = {"header": header, "pose": plain}
        if kind != "geometry_msgs/msg/PoseStamped":
            fields["pose"] = get("geometry_msgs/msg/PoseWithCovariance")(
                pose=plain, covariance=COVARIANCE.ravel()
            )
        if wheels:
            nothing = get("geometry_msgs/msg/Vector3")(0.0, 0.0, 0.0)
            twist = get("geometry_msgs/msg/Twist")(linear=nothing, angular=nothing)
            fields |= {
                "child_frame_id": child,
                "twist": get("geometry_msgs/msg/TwistWithCovariance")(
                    twist=twist, covariance=np.zeros(36)
                ),
            }
        yield Entry(topic, get(kind)(**fields), entry.log_ns)

    return change


CASES: dict[str, tuple[str, str, float, tuple[str, ...]]] = {
    "localisation": ("geometry_msgs/msg/PoseWithCovarianceStamped", "/amcl_pose", 0.5, ("odom",)),
    "every pose": ("geometry_msgs/msg/PoseStamped", "/pose", 0.0, ("odom", "base_footprint")),
    "wheels": ("nav_msgs/msg/Odometry", "/odom", 0.0, ("base_footprint",)),
}


@pytest.mark.parametrize(
    ("case", "dialect"),
    [(case, dialect) for case in CASES for dialect in ("ros1", "ros2", "foxglove")][:-1],
)
def test_topics_of_poses_stand_in_for_transforms(
    tmp_path: Path, plain_recording: Path, case: str, dialect: Dialect
) -> None:
    """The localisation's, each with its covariance; a mocap's; the wheels': the same stops."""
    kind, topic, every, children = CASES[case]
    path = rewrite(
        plain_recording,
        tmp_path / "posed.mcap",
        posed(plain_recording, kind, topic=topic, every=every),
        without(*children),
        dialect=dialect,
    )
    info = inspect(path)
    assert not info.missing
    assert [t.name for t in info.topics if t.role == "pose"] == (
        [topic] if case != "wheels" else []
    )
    with open_recording(plain_recording) as recording:
        stamps = recording.depth_stamps()
        before, names = recording.fixed_from_bases(stamps)[0], recording.names
        wheels_before = recording.odom_from_bases(stamps)[0]
    with open_recording(path) as recording:
        assert recording.names.fixed == names.fixed
        after, known = recording.fixed_from_bases(stamps)
        assert known.all()
        assert np.abs(after - before).max() < 0.005
        if case == "every pose":
            assert recording.names.odom is None
        else:
            assert np.abs(recording.odom_from_bases(stamps)[0] - wheels_before).max() < 0.001
        (warning,) = recording.warnings
        assert warning.code == "recording.pose_topic"
        assert topic in warning.message
        sigma = recording.localised_sigma(int(stamps[0]))
        if case == "localisation" and dialect != "foxglove":
            assert sigma == pytest.approx([0.2, 0.3, 0.1])
        else:
            assert sigma is None


def test_poses_beside_a_localised_tf_change_nothing(tmp_path: Path, plain_recording: Path) -> None:
    """They are not even read, unless a topic is asked for; goals are no poses."""
    kind = "geometry_msgs/msg/PoseStamped"
    goal = posed(plain_recording, kind, topic="/move_base/goal", every=1.0)
    path = rewrite(plain_recording, tmp_path / "goal.mcap", goal)
    with open_recording(path) as recording:
        assert recording.warnings == []
    bare = rewrite(path, tmp_path / "bare.mcap", without("odom"))
    with open_recording(bare) as recording:
        assert recording.names.fixed == "odom"  # the goal is not where the robot is
    asked = TopicsConfig(pose="/move_base/goal")
    with open_recording(bare, topics=asked) as recording:
        assert recording.names.fixed == "map"
    with pytest.raises(RecordingError, match=r"'/pose' has no poses that could be read"):
        open_recording(bare, topics=TopicsConfig(pose="/pose"))


def test_a_pose_that_is_unsure_counts_less() -> None:
    """And one that claims to be surer than is believed of any counts as that."""
    sensors, plain = SensorsConfig(), snapshot(MadeUpRecording(), 0)
    believed = (sensors.localisation_sigma, sensors.localisation_sigma)
    for said, expected in (
        (None, believed),
        (np.array([1.5, 0.001, 0.1]), (1.5, believed[1])),
    ):
        (anchor,) = localisation_anchors([replace(plain, localised_sigma=said)], sensors)
        sigmas = 1 / np.sqrt(np.diag(anchor.information))
        assert sigmas[:2] == pytest.approx(expected)


def toml(parent: str, child: str, xyz: tuple[float, ...], turn: tuple[float, ...]) -> str:
    """Return a mounting as a table of TOML."""
    rows = f"xyz = {list(xyz)}\nquaternion = {list(turn)}\n"
    return f"[[transform]]\nparent = '{parent}'\nchild = '{child}'\n{rows}"


def urdf(parent: str, child: str, xyz: tuple[float, ...], turn: tuple[float, ...]) -> str:
    """Return a mounting as a joint of URDF."""
    rpy = " ".join(map(str, Rotation.from_quat(turn).as_euler("xyz")))
    place = f'<origin xyz="{" ".join(map(str, xyz))}" rpy="{rpy}"/>'
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{child}_joint" type="fixed">{place}{ends}</joint>'


@pytest.mark.parametrize("form", [toml, urdf])
def test_extrinsics_of_a_file_stand_in_for_static_transforms(
    tmp_path: Path, form: Callable[..., str]
) -> None:
    """What TF knows itself stays; a joint that moves is not taken for one that stands."""
    path, file = tmp_path / "drive.mcap", tmp_path / "extrinsics"
    recorder = w.RosRecorder(path)
    for tick in range(21):
        stamp_ns = w.START_NS + tick * w.SECOND // 10
        recorder.transforms(stamp_ns, w.drive_edges(stamp_ns))
        recorder.scan("/base_scan", stamp_ns)
    recorder.camera_info(f"{w.PREFIX}/camera_info", stamp_ns)
    w.raw_depth(recorder, stamp_ns)
    recorder.finish()
    assert inspect(path).missing
    moved = ("odom", "base_footprint", (9.0, 9.0, 9.0), w.LEVEL)
    content = "\n".join(form(*edge) for edge in [*w.STATIC_EDGES, moved])
    if form is urdf:
        turning = '<joint name="j" type="revolute"><parent link="a"/><child link="b"/></joint>'
        content = f"<robot name='r'><link name='base_link'/>{content}{turning}</robot>"
    file.write_text(content)
    topics = TopicsConfig(extrinsics=str(file))
    assert not inspect(path, topics=topics).missing
    with open_recording(path, topics=topics) as recording:
        assert recording.names.laser == w.LASER
        assert "b" not in recording.tree.frames
        (frame,) = recording.depth_frames()
        assert np.allclose(frame.base_from_camera[:3, 2], [1, 0, 0], atol=1e-9)
        assert np.allclose(frame.base_from_camera[:3, 3], [0.1, 0, w.CAMERA_HEIGHT])
        pose = recording.fixed_from_base(stamp_ns)
        assert pose is not None
        assert pose[0, 3] == pytest.approx(1.402)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "No such file"),
        ("[[transform]]\nparent = 'a'\n", "found something else"),
        ("[[transform]]\nparent='a'\nchild='b'\nxyz=[0,0]\n", "expected 3 numbers"),
        ("[[transform]]\nparent='a'\nchild='b'\nxyz=[0,0,0]\nrpz=[0,0,0]\n", "'rpz'"),
        ("<sdf/>", "its root is <sdf>"),
        ("<robot name='r'/>", "no transform"),
    ],
)
def test_what_is_no_extrinsics_is_said(tmp_path: Path, content: str | None, says: str) -> None:
    """In a sentence, with the file."""
    path, file = tmp_path / "drive.mcap", tmp_path / "extrinsics"
    w.write_drive(path)
    if content is not None:
        file.write_text(content)
    with pytest.raises(RecordingError, match=says) as caught:
        open_recording(path, topics=TopicsConfig(extrinsics=str(file)))
    assert str(file) in str(caught.value)


@pytest.mark.slow
def test_a_drive_with_amcl_pose_gives_the_table(tmp_path: Path, plain_recording: Path) -> None:
    """To the millimetre, for wheels and laser tie the stops as before."""
    kind, topic, every, children = CASES["localisation"]
    change = posed(plain_recording, kind, topic=topic, every=every)
    path = rewrite(plain_recording, tmp_path / "posed.mcap", change, without(*children))
    sizes = []
    for recording in (plain_recording, path):
        options = ("--output", tmp_path / "runs", "--review", "off", "--json", "-q")
        done = tablemap("process", recording, *options)
        assert done.returncode == 0, done.stderr
        surface = json.loads(Path(json.loads(done.stdout)["model"]).read_text())["surface"]
        sizes.append([size["value"] for size in surface["dimensions"].values()])
    assert sizes[0] == pytest.approx([1.2, 0.8], abs=0.004)
    assert sizes[1] == pytest.approx(sizes[0], abs=0.001)
