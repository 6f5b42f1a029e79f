"""Frames are found by name and by how they move; poses are interpolated and never invented."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tablemap.config import TopicsConfig
from tablemap.errors import RecordingError
from tablemap.geometry import transform
from tablemap.recording import TransformStamped, open_recording
from tablemap.recording.messages import CameraInfo
from tablemap.recording.rectification import is_rectified, rectification
from tablemap.recording.tf.collector import TransformCollector
from tablemap.recording.tf.frame_roles import find_frames, ground_pose
from tablemap.recording.tf.frames import TransformTree
from tests.making import messages as w

SECOND = 1_000_000_000
LEVEL = (0.0, 0.0, 0.0, 1.0)


def tree_of(*edges: tuple[float, str, str, tuple[float, float, float], float]) -> TransformTree:
    """Make a tree of (seconds, parent, child, place, yaw in degrees)."""
    collector = TransformCollector()
    for seconds, parent, child, place, yaw in edges:
        turn = tuple(Rotation.from_euler("z", yaw, degrees=True).as_quat())
        collector.add(TransformStamped(int(seconds * SECOND), parent, child, place, turn, False))
    return collector.tree()


def drive(
    parent: str, child: str
) -> list[tuple[float, str, str, tuple[float, float, float], float]]:
    """Return two seconds of driving 1 m/s along x."""
    return [(t / 10, parent, child, (t / 10, 0.0, 0.0), float(t)) for t in range(21)]


def test_poses_are_interpolated_on_line_and_circle() -> None:
    """Half way between 0 and 90 degrees lies 45; out of order and double samples do no harm."""
    tree = tree_of(
        (2.0, "a", "b", (2.0, 0, 0), 90),
        (1.0, "a", "b", (0.0, 0, 0), 0),
        (2.0, "a", "b", (9.0, 0, 0), 10),
        (3.0, "a", "b", (2.0, 2.0, 0), 180),
    )
    poses, valid = tree.lookup("a", "b", [int(1.5 * SECOND), int(2.5 * SECOND)])
    assert valid.all()
    assert np.allclose(poses[:, :3, 3], [[1, 0, 0], [2, 1, 0]])
    assert np.allclose(
        Rotation.from_matrix(poses[:, :3, :3]).as_euler("zyx")[:, 0], [0.785398, 2.356194]
    )
    back, _ = tree.lookup("b", "a", [int(1.5 * SECOND)])
    assert np.allclose(back[0] @ poses[0], np.eye(4))


def test_nothing_is_extrapolated_beyond_the_tolerance() -> None:
    """50 ms beyond the last sample hold its pose, 200 ms have none."""
    tree = tree_of(*drive("a", "b"))
    stamps = [int(s * SECOND) for s in (-0.05, -0.2, 2.05, 2.2)]
    poses, valid = tree.lookup("a", "b", stamps)
    assert valid.tolist() == [True, False, True, False]
    assert np.allclose(poses[2, :3, 3], [2.0, 0, 0])


def test_a_gap_is_bridged_only_where_its_ends_agree() -> None:
    """Ten seconds without a sample are bridged by a robot that stood still, else not."""
    still = tree_of((0, "a", "b", (0, 0, 0), 0), (10, "a", "b", (0.01, 0, 0), 0))
    moved = tree_of((0, "a", "b", (0, 0, 0), 0), (10, "a", "b", (3.0, 0, 0), 0))
    stamps = np.array([5 * SECOND, SECOND // 20])
    assert still.lookup("a", "b", stamps)[1].tolist() == [True, True]
    poses, valid = moved.lookup("a", "b", stamps)
    assert valid.tolist() == [False, True]
    assert np.allclose(poses[1, :3, 3], 0)


def test_unchanging_edge_holds_at_any_time() -> None:
    """A mount that was published once, or always the same, needs no later sample."""
    tree = tree_of((5, "a", "b", (1, 0, 0), 0), *[(t, "b", "c", (0, 1, 0), 0) for t in range(3)])
    poses, valid = tree.lookup("a", "c", [0, 10**15])
    assert valid.all()
    assert np.allclose(poses[:, :3, 3], [1, 1, 0])


@pytest.mark.parametrize(
    ("edges", "says"),
    [
        ([(0, "a", "b", (0, 0, 0), 0), (0, "x", "b", (0, 0, 0), 0)], "several parents"),
        ([(0, "a", "b", (0, 0, 0), 0), (0, "b", "a", (0, 0, 0), 0)], "its own ancestor"),
        ([(0, "x", "a", (0, 0, 0), 0), (0, "y", "b", (0, 0, 0), 0)], "not connected"),
        ([(0, "a", "c", (0, 0, 0), 0)], "no frame 'b'"),
    ],
)
def test_broken_trees_are_told_clearly(edges: list, says: str) -> None:
    """Several parents, circles, separate trees and unknown frames each have their sentence."""
    with pytest.raises(RecordingError, match=says):
        tree_of(*edges).lookup("a", "b", [0])


def test_transforms_that_are_no_motion_are_rejected() -> None:
    """NaN and quaternions of length zero are counted with their reason, not used."""
    collector = TransformCollector()
    collector.add(TransformStamped(0, "a", "b", (0, 0, 0), LEVEL, False))
    collector.add(TransformStamped(1, "a", "b", (np.nan, 0, 0), LEVEL, False))
    collector.add(TransformStamped(2, "a", "b", (0, 0, 0), (0, 0, 0, 0), False))
    collector.add(TransformStamped(2, "a", "a", (0, 0, 0), LEVEL, False))
    assert len(collector.tree().edges["b"][0].stamps_ns) == 1
    assert collector.rejected == {
        ("a", "b", "a place or turn that is no number, or too large"): 1,
        ("a", "b", "a quaternion of zeros"): 1,
        ("a", "a", "a frame that is its own parent, or has no name"): 1,
    }


def test_roles_by_name_with_prefix() -> None:
    """A robot's prefix does not hide map, odom and base; another robot's base is not taken."""
    tree = tree_of(
        (0, "map", "r1/odom", (0.1, 0, 0), 0),
        (2, "map", "r1/odom", (0.2, 0, 0), 0),
        *drive("r1/odom", "r1/base_link"),
        (0, "r1/base_link", "r1/base_footprint", (0, 0, 0), 0),
        (0, "r1/base_link", "r1/camera", (0, 0, 1), 0),
        *drive("map", "r0/base_footprint"),
    )
    names = find_frames(tree, camera="r1/camera", lasers=["nowhere"], config=TopicsConfig())
    assert (names.fixed, names.odom, names.laser) == ("map", "r1/odom", None)
    assert names.base in ("r1/base_footprint", "r1/base_link")


def test_a_footprint_below_the_base_is_the_base() -> None:
    """A base_link above the floor may carry the footprint that says where the floor is."""
    tree = tree_of(
        *drive("odom", "base_link"),
        (0, "base_link", "base_footprint", (0, 0, -0.08), 0),
        (0, "base_link", "camera", (0, 0, 1.0), 0),
        *drive("odom", "r2/base_footprint"),
    )
    names = find_frames(tree, camera="camera", lasers=[], config=TopicsConfig())
    assert names.base == "base_footprint"
    parked = tree_of(
        *drive("map", "base_link"),
        (0, "base_link", "camera", (0, 0, 1.0), 0),
        (0, "map", "r2/base_footprint", (3, 0, 0), 0),
    )
    assert find_frames(parked, camera="camera", lasers=[], config=TopicsConfig()).base == (
        "base_link"
    )


def test_a_named_base_may_drift_in_height() -> None:
    """Odometry in space climbs by decimetres a lap; a frame of another name then is no base."""
    climbing = [
        (t, "odom", "base_link", (x, y, 0.01 * i), yaw)
        for i, (t, _, _, (x, y, _), yaw) in enumerate(drive("odom", "base_link"))
    ]
    tree = tree_of(*climbing, (0, "base_link", "camera", (0, 0, 1.0), 0))
    names = find_frames(tree, camera="camera", lasers=[], config=TopicsConfig())
    assert (names.base, names.base_is_virtual) == ("base_link", False)
    unnamed = [(t, "odom", "rig", place, yaw) for t, _, _, place, yaw in climbing]
    tree = tree_of(*unnamed, (0, "rig", "camera", (0, 0, 1.0), 0))
    assert find_frames(tree, camera="camera", lasers=[], config=TopicsConfig()).base_is_virtual


def test_a_map_below_utm_is_a_place_on_earth() -> None:
    """UTM's northing has millions of metres, and is no damage."""
    collector = TransformCollector()
    there = (4.5e5, 5.6e6, 200.0)
    collector.add(TransformStamped(0, "utm", "map", there, LEVEL, True))
    assert collector.tree().frames == ("map", "utm")
    assert not collector.rejected


def test_roles_by_motion_where_no_name_tells() -> None:
    """The last frame that drives in the plane is the base, what carries it the odometry."""
    tree = tree_of(
        (0, "origin", "w", (0.1, 0, 0), 0),
        (2, "origin", "w", (0.3, 0, 0), 0),
        *drive("w", "vehicle"),
        *[(t / 10, "vehicle", "neck", (0, 0, 1.0), 3.0 * t) for t in range(21)],
        (0, "neck", "eye", (0, 0, 0.1), 0),
    )
    names = find_frames(tree, camera="eye", lasers=[], config=TopicsConfig())
    assert (names.fixed, names.odom, names.base) == ("origin", "w", "vehicle")


def test_pose_within_the_robot_alone_is_no_localisation() -> None:
    """A camera on a base that nobody localised has no pose; the sentence says what to record."""
    tree = tree_of((0, "base_link", "camera", (0, 0, 1), 0))
    with pytest.raises(RecordingError, match="localisation running"):
        find_frames(tree, camera="camera", lasers=[], config=TopicsConfig())


def test_ground_pose_keeps_the_camera_where_it_is() -> None:
    """A tilting hand-held camera: the base is level, below it, and turned as it looks."""
    level = Rotation.from_quat([-0.5, 0.5, -0.5, 0.5])
    for yaw, pitch in ((0.3, 0.0), (-2.0, 0.5), (1.0, 1.5)):
        pose = np.eye(4)
        pose[:3, :3] = (Rotation.from_euler("ZY", [yaw, pitch]) * level).as_matrix()
        pose[:3, 3] = [1, 2, 1.5]
        ground = ground_pose(pose[None])[0]
        assert np.allclose(ground[:3, 3], [1, 2, 0])
        assert np.allclose(ground[:3, :3], Rotation.from_euler("z", yaw).as_matrix(), atol=1e-9)


def test_hand_held_recording_has_a_ground_base(tmp_path: Path) -> None:
    """`map -> camera` alone: planar base poses, and both together are the camera's pose."""
    path = tmp_path / "hand.mcap"
    recorder = w.RosRecorder(path)
    optical = Rotation.from_quat(w.OPTICAL)
    for tick in range(20):
        stamp_ns = w.START_NS + tick * w.SECOND // 10
        turn = Rotation.from_euler("zyx", [0.1 * tick, 0.4 + 0.02 * tick, 0.1]) * optical
        place = (0.1 * tick, 0.0, 1.3 + 0.02 * tick)
        recorder.transforms(stamp_ns, [("map", w.CAMERA, place, tuple(turn.as_quat()))])
        recorder.camera_info(f"{w.PREFIX}/camera_info", stamp_ns)
        w.raw_depth(recorder, stamp_ns)
    recorder.finish()
    with open_recording(path) as recording:
        assert recording.names.base_is_virtual
        assert recording.names.odom is None
        for frame in recording.depth_frames():
            base = recording.fixed_from_base(frame.stamp_ns)
            assert base is not None
            assert np.allclose(base[2, :], [0, 0, 1, 0])
            camera, _ = recording.tree.lookup("map", w.CAMERA, [frame.stamp_ns])
            assert np.allclose(base @ frame.base_from_camera, camera[0])


def calibration(d: tuple[float, ...], model: str = "plumb_bob") -> CameraInfo:
    """Return an HSR-like calibration of 640 x 480 pixels."""
    k = np.array([[538.0, 0, 315.0], [0, 538.0, 233.0], [0, 0, 1]])
    p = np.hstack([k, np.zeros((3, 1))])
    return CameraInfo(0, "camera", 480, 640, model, np.array(d), k, np.eye(3), p)


@pytest.mark.parametrize(
    ("model", "d"),
    [
        ("plumb_bob", (0.0622, -0.2196, -0.0001, -0.0010, 0.1565)),
        ("equidistant", (0.1, 0.02, 0, 0)),
    ],
)
def test_undistorted_depth_lies_on_the_pinhole(model: str, d: tuple[float, ...]) -> None:
    """A wall seen through the lens, at a slant, comes out flat to half a pixel's depth."""
    info = calibration(d, model)
    to_pinhole = rectification(info, width=640, height=480, topic="/depth/image_raw")
    assert to_pinhole.source is not None
    # What the lens shows at each of its pixels: follow each pinhole pixel to its recorded place.
    v, u = np.mgrid[0:480, 0:640]
    rays = np.stack([(u - 315) / 538, (v - 233) / 538, np.ones_like(u, float)], axis=-1)
    wall = (2.0 / (1 + 0.5 * rays[..., 0])).astype(np.float32)  # x / 4 + z / 2 = 1
    recorded = np.full(480 * 640, np.nan, np.float32)
    seen = to_pinhole.source >= 0
    recorded[to_pinhole.source[seen]] = wall[seen]
    depth = to_pinhole.apply(recorded.reshape(480, 640))
    points = transform(np.eye(4), rays * depth[..., None])
    off = np.abs(points[..., 0] / 4 + points[..., 2] / 2 - 1)
    assert np.mean(np.isfinite(depth)) > 0.9
    assert np.nanmax(off) < 2e-3


def test_rectified_images_are_taken_as_they_are() -> None:
    """The topic's name decides; `direct` is not `rect`."""
    assert is_rectified("/a/depth/image_rect_raw")
    assert is_rectified("/a/depth_rect/image")
    assert not is_rectified("/direct/depth/image_raw")
    info = calibration((0.1, 0, 0, 0, 0))
    assert rectification(info, width=640, height=480, topic="/a/image_rect").source is None
    unknown = calibration((0.1, 0, 0, 0, 0), "fisheye62")
    with pytest.raises(RecordingError, match="fisheye62"):
        rectification(unknown, width=640, height=480, topic="/a/image_raw")
