"""Several robots in one recording: which transforms, laser and camera belong together.

Robots differ in the namespaces of their TF topics (``/robot1/tf``) if these send the same frames,
or in the prefixes of their frames (``robot1/base_link``) if they share one topic.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tablemap.config import TopicsConfig
from tablemap.errors import ProcessWarning, RecordingError
from tablemap.recording.extrinsics import read_extrinsics
from tablemap.recording.roles import Roles, camera_frame, with_laser
from tablemap.recording.tf.aliases import with_aliases
from tablemap.recording.tf.collector import TransformCollector
from tablemap.recording.tf.frame_roles import FrameNames, conflicts, find_frames
from tablemap.recording.tf.frames import TransformTree
from tablemap.recording.tf.holding import held_corrections
from tablemap.recording.tf.poses import PoseTrack, completed, with_extrinsics
from tablemap.recording.tf.restarts import joined_restarts
from tablemap.recording.topics import Topic


@dataclass(frozen=True, eq=False)
class Placed:
    """The camera's own robot: its transforms and frames, and the roles with its laser.

    ``localisation`` is the topic of poses that TF lacked, None if TF has them. ``warnings`` name
    choices, omissions and contradictory transforms.
    """

    tree: TransformTree
    names: FrameNames
    roles: Roles
    localisation: PoseTrack | None
    warnings: list[ProcessWarning]


def placed(
    collector: TransformCollector,
    roles: Roles,
    config: TopicsConfig,
    poses: Callable[[], Sequence[PoseTrack]],
) -> Placed:
    """Return the camera's own robot; ``poses`` reads the topics of poses, if TF lacks them.

    Raises `RecordingError` if the camera's poses, or its robot, cannot be determined.
    """
    tree, others, warnings = own_tree(collector, roles, robot=config.robot)
    if config.extrinsics:
        tree = with_extrinsics(tree, read_extrinsics(Path(config.extrinsics)))
    strangers = [topic for topic in roles.lasers if belongs(topic, others)]
    tree, renamed = with_aliases(tree, _unknown(roles, tree, strangers))
    warnings += renamed
    camera = camera_frame(roles, tree.frames)
    tree, localisation, said = completed(tree, poses, camera=camera, config=config)
    warnings += said
    if collector.rejected:
        warnings.append(ProcessWarning("recording.damaged", "recording", collector.lost()))
    camera = camera_frame(roles, tree.frames)
    own = [topic.frame_id for topic in roles.lasers if topic not in strangers]
    cause = _cause(collector, roles)
    try:
        names = find_frames(tree, camera=camera, lasers=own, config=config)
    except RecordingError as error:
        raise RecordingError(f"{error} {cause}".strip()) from error
    tree, restarts = joined_restarts(tree, names)
    tree, held = held_corrections(tree, names)
    warnings += [*restarts, *held]
    roles, choices = with_laser(roles, names.laser, strangers, cause=cause)
    warnings += [*choices, *conflicts(tree, names)]
    return Placed(tree, names, roles, localisation, warnings)


def _unknown(
    roles: Roles, tree: TransformTree, strangers: Sequence[Topic]
) -> Iterator[tuple[str, str]]:
    """Yield the topics of the robot's sensors, and their frames, that the tree does not place."""
    assert roles.depth is not None
    frame = roles.body_frame or camera_frame(roles, tree.frames)
    if frame not in tree.edges and (frame not in tree.frames or roles.body_frame):
        yield roles.depth.name, frame
    for topic in roles.lasers:
        if topic not in strangers and topic.frame_id not in tree.frames:
            yield topic.name, topic.frame_id


def _cause(collector: TransformCollector, roles: Roles) -> str:
    """Say what of the transforms is missing or was rejected; nothing where all is there."""
    causes = []
    of_ros = [topic for topic in roles.transforms if "TFMessage" in topic.channels[0].schema_name]
    if of_ros and not collector.has_static:
        causes.append(
            "The recording has no message on /tf_static, which of a split recording only the first "
            "file has: process both (--together FIRST THIS), or tell the mountings by --set "
            "topics.extrinsics=FILE."
        )
    if collector.rejected or collector.never_valid:
        causes.append(collector.lost())
    return " ".join(causes)


def own_tree(
    collector: TransformCollector, roles: Roles, *, robot: str
) -> tuple[TransformTree, frozenset[str], list[ProcessWarning]]:
    """Return the transforms of the camera's own robot, and the namespaces of the others.

    ``robot`` is the requested one, or empty. Raises `RecordingError` if the camera's robot cannot
    be determined.
    """
    robots, given = collector.robots(), robot.strip("/")
    if not robots:
        tree = collector.tree()
        prefixes = {frame.rpartition("/")[0] for frame in tree.frames}
        namespaces = {name.namespace.strip("/") for name in roles.transforms}
        if given and given not in prefixes | namespaces:
            raise RecordingError(
                f"No robot is named {robot!r}: the recording has no transforms of its namespace, "
                f"and no frames that begin with it; its frames are {', '.join(tree.frames[:12])}."
            )
        return tree, frozenset(), []
    if given and given not in {name.strip("/") for name in robots}:
        raise RecordingError(
            f"No robot is named {robot!r}; the recording has the robots {_listed(robots)}."
        )
    own = _own(collector, robots, roles, given)
    others = frozenset(robots) - {own}
    warning = ProcessWarning(
        "recording.topic_choice",
        "recording",
        f"{len(robots)} robots send the same frames ({_listed(robots)}); the transforms of "
        f"{own or '/tf'} were taken, as those of the camera; --set topics.robot=NAME takes "
        "another.",
    )
    return collector.tree(without=others), others, [warning]


def belongs(topic: Topic, namespaces: frozenset[str]) -> bool:
    """Tell whether a topic lies in one of some robots' namespaces."""
    return any(name and topic.name.startswith(f"{name}/") for name in namespaces)


def _own(collector: TransformCollector, robots: Sequence[str], roles: Roles, given: str) -> str:
    if given:
        for name in robots:
            if name.strip("/") == given:
                return name
    depth = roles.depth
    if depth is not None:
        around = [name for name in robots if depth.name.startswith(f"{name}/")]
        if around:
            return max(around, key=len)
        holding = []
        for name in robots:
            tree = collector.tree(without=frozenset(robots) - {name})
            if roles.calibration is not None and camera_frame(roles, tree.frames) in tree.frames:
                holding.append(name)
        if len(holding) == 1:
            return holding[0]
    raise RecordingError(
        f"The transforms are of {len(robots)} robots ({_listed(robots)}), and nothing tells whose "
        "the camera is; name the robot with --set topics.robot=NAME."
    )


def _listed(robots: Sequence[str]) -> str:
    return ", ".join(name or "/tf" for name in robots)
