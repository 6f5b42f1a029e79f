"""Poses from topics that TF lacks: those of a localisation, of the wheels, and given extrinsics.

A pose of the base in the map puts the root of the base's own tree below the map. If the wheels'
odometry lies in between, the new edge is the correction of the odometry, which is constant until
the next pose, as a localisation sends it. Without odometry the new edge is the base's own motion,
which is interpolated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from tablemap.config import TopicsConfig
from tablemap.errors import ProcessWarning, RecordingError
from tablemap.geometry import Floats, Ints
from tablemap.recording.messages import TransformStamped
from tablemap.recording.tf.frame_roles import BASE_NAMES, FIXED_NAMES, ODOM_NAMES
from tablemap.recording.tf.frames import Stamps, TransformEdge, TransformTree

_STEP_NS = 1_000_000  # the last correction is valid until this long before the next one


@dataclass(frozen=True, eq=False)
class PoseTrack:
    """The poses on one topic: of the frame ``child`` (empty: unknown) in ``frame``.

    - ``stamps_ns``: (n,), ascending
    - ``translations``: (n, 3) metres
    - ``quaternions``: (n, 4), xyzw
    - ``sigmas``: (n, 3) standard deviations of x, y (metres) and yaw (radians), NaN if unknown
    """

    topic: str
    frame: str
    child: str
    stamps_ns: Stamps
    translations: Floats
    quaternions: Floats
    sigmas: Floats

    @property
    def is_wheels(self) -> bool:
        """Whether this is odometry, and not a localisation."""
        return bool(self.child) and _own_name(self.frame) in ODOM_NAMES

    def sigmas_at(self, stamps_ns: Stamps) -> Floats:
        """Return the standard deviations (n, 3) that were valid at stamps (n,)."""
        last = np.searchsorted(self.stamps_ns, stamps_ns, side="right") - 1
        return np.asarray(self.sigmas[np.maximum(last, 0)])


def with_extrinsics(tree: TransformTree, given: Sequence[TransformStamped]) -> TransformTree:
    """Return the tree with the given transforms of frames whose place it lacks."""
    new = [
        TransformEdge(
            each.parent_frame,
            each.child_frame,
            np.zeros(1, dtype=np.int64),
            np.array([each.translation]),
            np.array([each.rotation]),
        )
        for each in given
        if each.child_frame not in tree.edges
    ]
    return _with(tree, *new) if new else tree


def completed(
    tree: TransformTree,
    tracks: Callable[[], Sequence[PoseTrack]],
    *,
    camera: str,
    config: TopicsConfig,
) -> tuple[TransformTree, PoseTrack | None, list[ProcessWarning]]:
    """Return the tree with the poses that it lacked, the localisation's track, and warnings.

    ``tracks`` reads the topics of poses. It is called only if the tree has no localised pose of the
    camera, or if a topic was requested. Raises `RecordingError` if that topic has no poses.
    """
    if _is_localised(tree, camera) and not config.pose:
        return tree, None, []
    found = [track for track in tracks() if len(track.stamps_ns) >= 2]
    said: list[ProcessWarning] = []
    for track in sorted(found, key=lambda each: -len(each.stamps_ns)):
        if track.is_wheels and not tree.connected(track.frame, track.child):
            tree = _hung(tree, track, track.child)
            said.append(_warning(track, track.child))
            break
    localised = [track for track in found if not track.is_wheels]
    if config.pose:
        localised = [track for track in found if track.topic.strip("/") == config.pose.strip("/")]
        if not localised:
            topics = ", ".join(sorted(track.topic for track in found)) or "none"
            raise RecordingError(
                f"The topic {config.pose!r} has no poses that could be read; those that have are: "
                f"{topics}."
            )
    elif _is_localised(tree, camera):
        return tree, None, said
    # A track with covariances is a localisation; otherwise prefer the one with most poses.
    localised.sort(key=lambda each: (np.isnan(each.sigmas).all(), -len(each.stamps_ns)))
    if not localised:
        return tree, None, said
    track = localised[0]
    child = config.pose_frame or track.child or _carrier(tree, camera)
    if child in tree.frames and tree.connected(track.frame, child):
        return tree, None, said
    said.append(_warning(track, child))
    return _hung(tree, track, child), track, said


def _hung(tree: TransformTree, track: PoseTrack, child: str) -> TransformTree:
    """Put the root of the child's tree below the frame of its poses."""
    poses = np.zeros((len(track.stamps_ns), 4, 4))
    poses[:, :3, :3] = Rotation.from_quat(track.quaternions).as_matrix()
    poses[:, :3, 3] = track.translations
    poses[:, 3, 3] = 1.0
    stamps, root = track.stamps_ns, child
    if child in tree.frames and (root := tree.root(child)) != child:
        child_from_root, known = tree.lookup(child, root, stamps)
        poses, stamps = (poses @ child_from_root)[known], stamps[known]
        if moving := tree.moving_edges(child, root):
            first = min(int(edge.stamps_ns[0]) for edge in moving)
            last = max(int(edge.stamps_ns[-1]) for edge in moving)
            stamps, order = _held(stamps, first, last)
            poses = poses[order]
    if not len(stamps):
        return tree
    turns = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    return _with(tree, TransformEdge(track.frame, root, stamps, poses[:, :3, 3], turns))


def _held(stamps: Stamps, first: int, last: int) -> tuple[Stamps, Ints]:
    """Return stamps for a motion in steps, and the index of the value at each."""
    if not len(stamps):
        return stamps, np.zeros(0, dtype=np.int64)
    places = np.arange(len(stamps))
    until = np.append(stamps[1:] - _STEP_NS, max(last, int(stamps[-1]) + 1))
    longer = until > stamps
    begin = min(first, int(stamps[0]) - 1)
    held = np.concatenate([[begin], stamps, until[longer]])
    order = np.concatenate([[0], places, places[longer]])
    by_time = np.argsort(held, kind="stable")
    return held[by_time], order[by_time]


def _is_localised(tree: TransformTree, camera: str) -> bool:
    """Tell whether a fixed frame that is not the odometry's is connected to the camera."""
    fixed = [f for f in tree.frames if _own_name(f) in set(FIXED_NAMES) - set(ODOM_NAMES)]
    return any(tree.connected(frame, camera) for frame in fixed)


def _carrier(tree: TransformTree, camera: str) -> str:
    """Return the frame of poses whose topic does not name it: the base that carries the camera."""
    for name in BASE_NAMES:
        for frame in tree.frames:
            if _own_name(frame) == name and tree.connected(frame, camera):
                return frame
    return tree.root(camera) if camera in tree.frames else camera


def _with(tree: TransformTree, *edges: TransformEdge) -> TransformTree:
    return tree.with_edges([*tree.all_edges, *edges])


def _own_name(frame: str) -> str:
    return frame.rpartition("/")[2]


def _warning(track: PoseTrack, child: str) -> ProcessWarning:
    return ProcessWarning(
        "recording.pose_topic",
        "recording",
        f"TF has no pose of {child} in {track.frame}; those on {track.topic} were taken.",
    )
