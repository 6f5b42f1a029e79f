"""The roles of TF frames: the fixed frame, that of the wheel odometry, and the base.

Names decide first (REP 105), then the frames' motions:

- fixed: map, then world, earth, odom; else the root of the camera's tree, if that is no base and
  the camera moves in it.
- base: base_footprint, base_link, base and the like, if it moves in the plane (tilts less than
  `MAX_TILT` and rises less than `MAX_RISE`, or `NAMED_TILT` and `NAMED_RISE`); else the last frame
  between fixed and camera that moves in the plane; else the camera's own place, projected to the
  ground.
- odom: odom and the like; else a frame between the fixed frame and the base, if it moves too.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tablemap.config import TopicsConfig
from tablemap.errors import ProcessWarning, RecordingError
from tablemap.geometry import Bools, Floats, invert
from tablemap.recording.tf.frames import Stamps, TransformEdge, TransformTree

MAX_TILT = np.radians(5.0)
MAX_RISE = 0.10
NAMED_TILT, NAMED_RISE = np.radians(3.0), 0.4
"""Of a frame that is called a base: odometry in space drifts in height, a hand also tilts."""
_DRIVEN_METRES = 0.05

FIXED_NAMES = ("map", "world", "earth", "odom", "odom_combined", "vicon", "mocap")
ODOM_NAMES = ("odom", "odom_combined", "odometry", "wheel_odom")
BASE_NAMES = (
    "base_footprint",
    "base_link",
    "base",
    "base_frame",
    "robot_base",
    "mobile_base",
    "footprint",
    "chassis",
)


@dataclass(frozen=True)
class FrameNames:
    """The frames by role. ``odom`` is None without wheel odometry, ``laser`` without a laser.

    ``base_is_virtual`` says that no frame moves in the plane (a hand-held camera). Then the base is
    the camera's place on the ground with the camera's heading, and is no frame of the TF tree.
    """

    fixed: str
    odom: str | None
    base: str
    camera: str
    laser: str | None
    base_is_virtual: bool = False

    @property
    def carrier(self) -> str:
        """The frame of the TF tree that the base is, or is derived from."""
        return self.camera if self.base_is_virtual else self.base


def find_frames(
    tree: TransformTree, *, camera: str, lasers: Sequence[str], config: TopicsConfig
) -> FrameNames:
    """Return the frames by role; the laser is the first that the base carries.

    Raises `RecordingError` if the camera has no pose in a fixed frame; it names the frames tried.
    """
    fixed = _fixed(tree, camera, config.fixed_frame)
    names = FrameNames(fixed, None, f"{camera}_ground", camera, None, base_is_virtual=True)
    base = _base(tree, names, config.base_frame)
    if base is not None:
        names = replace(names, base=base, base_is_virtual=False)
    carrier = camera if names.base_is_virtual else names.base
    odom = _odom(tree, names, carrier, config.odom_frame)
    laser = next((frame for frame in lasers if _carries(tree, names, frame)), None)
    return replace(names, odom=odom, laser=laser)


def conflicts(tree: TransformTree, names: FrameNames) -> list[ProcessWarning]:
    """Return a warning for each edge that poses rest on, and that several sources send."""
    carrier = names.carrier
    ends = [(names.fixed, names.camera), (names.fixed, carrier)]
    ends += [(names.odom, carrier)] if names.odom else []
    ends += [(carrier, names.laser)] if names.laser else []
    used = [edge for end in ends for way in tree.path(*end) for edge in way]
    said = dict.fromkeys(edge.conflict for edge in used if edge.conflict is not None)
    return [ProcessWarning("accuracy.tf_conflict", "recording", str(conflict)) for conflict in said]


def fixed_from_bases(
    tree: TransformTree, names: FrameNames, stamps_ns: Stamps
) -> tuple[Floats, Bools]:
    """Return the base's (n, 4, 4) poses in the fixed frame at stamps, and which are known."""
    poses, valid = tree.lookup(names.fixed, names.carrier, stamps_ns)
    return (ground_pose(poses) if names.base_is_virtual else poses), valid


def base_from(
    tree: TransformTree, names: FrameNames, frame: str, stamps_ns: Stamps
) -> tuple[Floats, Bools]:
    """Return a frame's (n, 4, 4) poses in the base at stamps, and which are known."""
    if not names.base_is_virtual:
        return tree.lookup(names.base, frame, stamps_ns)
    bases, valid = fixed_from_bases(tree, names, stamps_ns)
    poses, known = tree.lookup(names.fixed, frame, stamps_ns)
    inverse = np.array([invert(base) for base in bases]).reshape(-1, 4, 4)
    return inverse @ poses, valid & known


def ground_pose(fixed_from_camera: Floats) -> Floats:
    """Return the poses (n, 4, 4) of the places below cameras, with the cameras' headings.

    The heading is that of the optical axis. If the camera looks down, so that the axis has hardly a
    heading, the image's upward direction helps.
    """
    forward = fixed_from_camera[:, :2, 2].copy()
    down = fixed_from_camera[:, 2, 2] < 0
    forward[down] -= fixed_from_camera[down, :2, 1]
    yaw = np.arctan2(forward[:, 1], forward[:, 0])
    poses = np.zeros_like(fixed_from_camera)
    poses[:, 0, 0] = poses[:, 1, 1] = np.cos(yaw)
    poses[:, 1, 0] = np.sin(yaw)
    poses[:, 0, 1] = -np.sin(yaw)
    poses[:, 2, 2] = poses[:, 3, 3] = 1.0
    poses[:, :2, 3] = fixed_from_camera[:, :2, 3]
    return poses


def _named(tree: TransformTree, names: tuple[str, ...]) -> list[str]:
    """Return the frames of these names, with or without a robot's prefix, best first."""
    return [frame for name in names for frame in tree.frames if frame.rpartition("/")[2] == name]


def _fixed(tree: TransformTree, camera: str, given: str) -> str:
    if not tree.frames:
        raise RecordingError(
            "The recording has no transforms, so that the camera's poses are unknown; record /tf "
            "and /tf_static with the localisation running."
        )
    given = given.lstrip("/")
    if given:
        tree.path(given, camera)
        return given
    if not camera:
        raise RecordingError(
            "The depth images name no frame (their frame_id is empty), so that their poses are "
            "unknown; set the camera driver's frame and record again."
        )
    if camera not in tree.frames:
        raise RecordingError(
            f"The depth camera's frame {camera!r} is not in the TF tree, whose frames are "
            f"{', '.join(tree.frames[:12])}; {_way_to(camera, tree.frames)}."
        )
    for frame in _named(tree, FIXED_NAMES):
        if tree.connected(frame, camera):
            return frame
    root = tree.root(camera)
    is_base = root.rpartition("/")[2] in BASE_NAMES
    if is_base or not tree.moving_edges(root, camera):
        raise RecordingError(
            f"The depth camera's poses are unknown: the TF tree knows it only within {root!r}, and "
            f"no fixed frame (map, world, odom) above. Record /tf with the localisation running, "
            "or name the fixed frame with --set topics.fixed_frame=FRAME."
        )
    return root


def _way_to(camera: str, frames: Sequence[str]) -> str:
    """Say how to connect a camera's frame that is not in the tree."""
    words = _words(camera)
    bodies = [frame for frame in frames if words and words & _words(frame)]
    if not bodies:
        return "record /tf_static too, from the start"
    body = max(bodies, key=lambda frame: (len(words & _words(frame)), -len(frame)))
    return (
        f"{body!r} seems to be the camera's body, and the transform to its optical frame is "
        "missing: record the camera driver's /tf_static, or tell it by --set topics.extrinsics=FILE"
    )


def _words(frame: str) -> set[str]:
    """Return the words of a frame's name that say which sensor it is."""
    own = set(re.split(r"[^a-z0-9]+", frame.lower()))
    return own - {"", "link", "frame", "optical", "sensor", "base", "robot"}


def _base(tree: TransformTree, names: FrameNames, given: str) -> str | None:
    given = given.lstrip("/")
    if given:
        tree.path(names.fixed, given)
        return given
    between = [edge.child for edge in tree.path(names.fixed, names.camera)[1]]
    named = [frame for frame in _named(tree, BASE_NAMES) if _belongs(tree, names, frame)]
    # Another robot's base is neither on the way to the camera nor fixed to a frame that is.
    named.sort(key=lambda frame: not _is_fixed_to_one(tree, frame, between))
    for frame in named:
        if frame != names.fixed and (
            _is_planar(tree, names.fixed, frame)
            or _is_planar(tree, names.fixed, frame, tilt=NAMED_TILT, rise=NAMED_RISE)
        ):
            return frame
    for edge in tree.path(names.fixed, names.camera)[1]:
        if edge.child == names.camera or not _is_driven(edge):
            continue
        if _is_planar(tree, names.fixed, edge.child):
            return edge.child
    return None


def _belongs(tree: TransformTree, names: FrameNames, frame: str) -> bool:
    """Tell whether a frame reaches the camera without passing the fixed frame."""
    if not tree.connected(frame, names.camera):
        return False
    up_frame, up_camera = tree.path(frame, names.camera)
    return all(edge.parent != names.fixed for edge in (*up_frame, *up_camera)) or not up_frame


def _is_fixed_to_one(tree: TransformTree, frame: str, others: Sequence[str]) -> bool:
    """Tell whether a frame is one of others, or never moves against one of them."""
    return frame in others or any(
        tree.connected(frame, other) and not tree.moving_edges(frame, other) for other in others
    )


def _carries(tree: TransformTree, names: FrameNames, laser: str) -> bool:
    """Tell whether a laser belongs to the base, and not to another robot."""
    if names.base_is_virtual:
        return tree.connected(laser, names.camera)
    return _belongs(tree, names, laser)


def _is_driven(edge: TransformEdge) -> bool:
    return not edge.is_static and bool(
        np.ptp(edge.translations[:, :2], axis=0).max() > _DRIVEN_METRES
    )


def _is_planar(
    tree: TransformTree, fixed: str, frame: str, *, tilt: float = MAX_TILT, rise: float = MAX_RISE
) -> bool:
    stamps = pose_stamps(tree, fixed, frame)
    thinned = stamps[:: max(len(stamps) // 500, 1)]
    poses, valid = tree.lookup(fixed, frame, thinned)
    if not valid.any():
        return True
    poses = poses[valid]
    tilted = np.quantile(np.arccos(np.clip(poses[:, 2, 2], -1, 1)), 0.95)
    low, high = np.quantile(poses[:, 2, 3], [0.05, 0.95])
    return bool(tilted < tilt and high - low < rise)


def _odom(tree: TransformTree, names: FrameNames, carrier: str, given: str) -> str | None:
    given = given.lstrip("/")
    if given:
        tree.path(given, carrier)
        return given
    for frame in _named(tree, ODOM_NAMES):
        if not tree.connected(frame, carrier) or not tree.moving_edges(frame, carrier):
            continue
        up_frame, up_carrier = tree.path(frame, carrier)
        # A way through the fixed frame would be the localisation again, or another robot.
        passed = {edge.parent for edge in (*up_frame, *up_carrier)} - {frame}
        if names.fixed not in passed:
            return frame
    for edge in tree.path(names.fixed, carrier)[1]:
        if edge.parent != names.fixed and _is_driven(edge):
            return edge.parent if tree.moving_edges(names.fixed, edge.parent) else None
    return None


def pose_stamps(tree: TransformTree, fixed: str, frame: str) -> Stamps:
    """Return stamps that all edges between two frames cover, from the edge with most samples.

    If nothing moves between the frames, return the single stamp of an edge.
    """
    moving = tree.moving_edges(fixed, frame)
    if not moving:
        up_fixed, up_frame = tree.path(fixed, frame)
        stamps = [edge.stamps_ns for edge in (*up_fixed, *up_frame)]
        return np.array([max(int(s[0]) for s in stamps)] if stamps else [0], dtype=np.int64)
    stamps_ns = max(moving, key=lambda edge: len(edge.stamps_ns)).stamps_ns
    return stamps_ns[tree.lookup(fixed, frame, stamps_ns)[1]]
