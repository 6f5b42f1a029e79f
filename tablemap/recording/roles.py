"""The role of each topic (depth, calibration, colour, laser, pose), by type, name and camera.

If several topics fit, the rules are those of `_depth_rank`, `_calibration_rank`, `_colour_rank` and
`_laser_rank`; a choice between different sensors gives a warning.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

from tablemap.config import TopicsConfig
from tablemap.errors import ProcessWarning, RecordingError
from tablemap.recording.depth import depth_encoding, is_jpeg, is_lossless
from tablemap.recording.kinds import CALIBRATION, TRANSFORMS
from tablemap.recording.messages import (
    CameraInfo,
    CloudImage,
    CompressedImage,
    Image,
    LaserScan,
    Pose,
    TransformStamped,
)
from tablemap.recording.raw import Source
from tablemap.recording.topics import NO_DEPTH, Topic, shows_colour, shows_depth

_NO_POSE = {
    *("goal", "goals", "target", "initialpose", "initial", "waypoint", "clicked", "cmd", "command"),
    *("desired", "setpoint", "plan", "path", "grasp", "marker", "object", "detection"),
}


@dataclass(frozen=True, eq=False)
class Roles:
    """The topics by role; None for a role without a topic.

    - ``laser``: the one that is used
    - ``lasers``: all that could be it, best first
    - ``poses``: topics beside TF that say where something is
    - ``calibrations``: other calibrations of the same images
    - ``body_frame``: the images' frame if it has the axes of a body, else empty
    """

    depth: Topic | None
    calibration: Topic | None
    colour: Topic | None
    laser: Topic | None
    transforms: tuple[Topic, ...]
    lasers: tuple[Topic, ...] = ()
    poses: tuple[Topic, ...] = ()
    calibrations: tuple[Topic, ...] = ()
    body_frame: str = ""

    @property
    def is_own_calibration(self) -> bool:
        """Whether the depth is of a cloud, whose rays are its calibration."""
        return bool(self.depth and self.calibration and self.depth.ids & self.calibration.ids)


def find_roles(
    topics: Sequence[Topic], config: TopicsConfig, *, all_names: Sequence[str] = ()
) -> tuple[Roles, list[ProcessWarning]]:
    """Choose a topic for each role, and warn if several sensors fit.

    Raises `RecordingError` if a requested topic does not exist or does not fit its role.
    """
    warnings: list[ProcessWarning] = []
    names = sorted({*all_names, *(topic.name for topic in topics)})

    def given(role: str, name: str, fits: Callable[[Topic], bool]) -> Topic | None:
        return _given(topics, names, role=role, name=name, fits=fits) if name else None

    calibrations = [topic for topic in topics if isinstance(topic.first, CameraInfo)]
    depth = given("depth", config.depth, shows_depth)
    if depth is None:
        images = [topic for topic in topics if shows_depth(topic) and not topic.words & NO_DEPTH]
        images = _of_robot(images, topics, config.robot) if config.robot else images
        most = max((topic.count for topic in images), default=0)
        ranked = sorted(images, key=lambda topic: _depth_rank(topic, calibrations, most))
        depth = ranked[0] if ranked else None
        cameras = _distinct(ranked, lambda topic: topic.camera)
        _say_choice(warnings, "depth", [topic.name for topic in cameras])
    laser = given("laser", config.laser, lambda topic: isinstance(topic.first, LaserScan))
    lasers = (laser,) if laser is not None else _lasers(topics, depth)
    if depth is None:
        roles = Roles(
            None, None, None, next(iter(lasers), None), _tf(topics), lasers, _poses(topics, config)
        )
        return roles, warnings

    calibration = given("calibration", config.calibration, lambda topic: topic in calibrations)
    if calibration is None and isinstance(depth.first, CloudImage):
        calibration = replace(depth, kind=CALIBRATION, first=depth.first.calibration)
    if calibration is None and calibrations:
        calibration = min(calibrations, key=lambda topic: _calibration_rank(topic, depth))
        if _calibration_rank(calibration, depth)[0] >= _SAME_CAMERA:
            warnings.append(
                ProcessWarning(
                    "recording.topic_choice",
                    "recording",
                    f"No calibration lies beside {depth.name} or in its frame; {calibration.name} "
                    "was taken, perhaps that of another camera (--set topics.calibration=TOPIC).",
                )
            )
    others = tuple(
        topic
        for topic in calibrations
        if topic is not calibration and topic.frame_id == depth.frame_id and not config.calibration
    )
    colour = given("colour", config.colour, shows_colour)
    if colour is None:
        colours = [topic for topic in topics if shows_colour(topic)]
        related = [t for t in colours if t.camera == depth.camera or t.frame_id == depth.frame_id]
        if related or len({topic.camera for topic in colours}) == 1:
            colour = min(related or colours, key=lambda topic: _colour_rank(topic, depth))
    first = next(iter(lasers), None)
    warnings += _unread_clouds(topics) if first is None else []
    poses = _poses(topics, config)
    roles = Roles(depth, calibration, colour, first, _tf(topics), lasers, poses, others)
    return roles, warnings


def _unread_clouds(topics: Sequence[Topic]) -> list[ProcessWarning]:
    """Say which clouds may be those of a laser, where no scan was recorded."""
    clouds = [topic.name for topic in topics if topic.problem and "point cloud" in topic.problem]
    if not clouds:
        return []
    message = (
        f"No laser scan was recorded, and the point clouds on {', '.join(clouds)} are of no depth "
        "camera: those of a laser are not read. Record a LaserScan of it too (pointcloud_to_"
        "laserscan makes one); then the views are placed more exactly."
    )
    return [ProcessWarning("recording.unread_cloud", "recording", message)]


def with_laser(
    roles: Roles, frame: str | None, strangers: Collection[Topic], *, cause: str = ""
) -> tuple[Roles, list[ProcessWarning]]:
    """Return the roles with a laser of the base, or None without one, and warnings.

    Several topics in one frame are one laser; ``strangers`` belong to another robot. ``cause`` says
    why transforms may be missing.
    """
    own = [topic for topic in roles.lasers if topic not in strangers]
    laser = next((topic for topic in own if topic.frame_id == frame), None)
    warnings: list[ProcessWarning] = []
    if laser is not None:
        others = [topic for topic in _distinct(own, lambda t: t.frame_id) if topic is not laser]
        _say_choice(warnings, "laser", [topic.name for topic in (laser, *others)])
    elif roles.lasers:
        first = (own or roles.lasers)[0]
        warnings.append(
            ProcessWarning(
                "recording.no_pose",
                "recording",
                f"The laser on {first.name} was not used: its frame {first.frame_id!r} is not "
                f"connected to the base in TF. {cause}".strip(),
            )
        )
    return replace(roles, laser=laser), warnings


def _depth_rank(topic: Topic, calibrations: Sequence[Topic], most: int) -> tuple[object, ...]:
    """Return the rank of a depth topic, best first.

    The criteria in order: it has its own calibration; it is an image, not a cloud; it is called
    depth; it is registered to colour; it belongs to a head, not to a hand; it is complete; it is
    rectified; it is lossless; it is not encoded; then its name.
    """
    name = topic.name.lower()
    best = min((_calibration_rank(c, topic)[0] for c in calibrations), default=_UNRELATED)
    assert isinstance(topic.first, Image | CompressedImage)
    is_cloud = isinstance(topic.first, CloudImage)
    return (
        best == _UNRELATED and not is_cloud,
        is_cloud,
        "depth" not in name,
        not ("registered" in name or "aligned" in name),
        "head" not in name,
        bool({"hand", "wrist", "arm", "gripper", "base", "back", "rear"} & topic.words),
        topic.count < 0.8 * most,
        "rect" not in topic.words,
        not is_lossless(topic.first),
        not isinstance(topic.first, Image),
        depth_encoding(topic.first) != "16UC1",
        topic.name,
    )


_SIBLING, _SAME_FRAME, _SAME_CAMERA, _UNRELATED = range(4)


def _calibration_rank(topic: Topic, depth: Topic) -> tuple[int, bool, int, str]:
    """Return the rank of a calibration for a depth topic, best first.

    The criteria in order: it is the topic's sibling; it has the same frame; it belongs to the same
    camera; it has the same size; its name is most similar.
    """
    if topic.folder == depth.folder:
        relation = _SIBLING
    elif topic.frame_id and topic.frame_id == depth.frame_id:
        relation = _SAME_FRAME
    elif topic.camera and topic.camera == depth.camera:
        relation = _SAME_CAMERA
    else:
        relation = _UNRELATED
    return relation, not _same_size(topic, depth), -_alike(topic.name, depth.name), topic.name


def _colour_rank(topic: Topic, depth: Topic) -> tuple[object, ...]:
    """Return the rank of a colour topic: depth's frame, same camera, encoded, rectified, name."""
    return (
        topic.frame_id != depth.frame_id,
        topic.camera != depth.camera,
        not isinstance(topic.first, CompressedImage),
        "rect" not in topic.words,
        topic.name,
    )


def _of_robot(images: Sequence[Topic], topics: Sequence[Topic], robot: str) -> list[Topic]:
    """Return the images of a robot, by names or prefixes of frames; without one, of no robot."""
    name = robot.strip("/")
    own = [t for t in images if t.prefix == name or f"{t.name.strip('/')}/".startswith(f"{name}/")]
    names = _robot_namespaces(topics)
    nobodys = [t for t in images if not t.prefix and not _namespace_of(t, names)]
    if images and not (own or nobodys):
        raise RecordingError(
            f"No topic with depth images is of the robot {robot!r}; the recording has "
            f"{', '.join(topic.name for topic in images)}."
        )
    return own or nobodys


def _robot_namespaces(topics: Sequence[Topic]) -> set[str]:
    """Return the namespaces in which transforms were recorded."""
    return {topic.namespace for topic in _tf(topics)} - {""}


def _namespace_of(topic: Topic, namespaces: Collection[str]) -> str:
    """Return the innermost of some namespaces that contains a topic, or an empty text."""
    around = [name for name in namespaces if topic.name.startswith(f"{name}/")]
    return max(around, key=len, default="")


def _lasers(topics: Sequence[Topic], depth: Topic | None) -> tuple[Topic, ...]:
    """Return the laser topics, best first; those of the camera's own robot come first."""
    names = _robot_namespaces(topics)

    def robot(topic: Topic) -> tuple[str, str]:
        return _namespace_of(topic, names), topic.prefix

    def rank(topic: Topic) -> tuple[object, ...]:
        is_other = depth is not None and robot(topic) != robot(depth)
        return is_other, *_laser_rank(topic)

    return tuple(sorted((t for t in topics if isinstance(t.first, LaserScan)), key=rank))


def _laser_rank(topic: Topic) -> tuple[object, ...]:
    """Return a laser's rank: not made from depth, on the base, unfiltered, in front, wide, full."""
    scan = topic.first
    assert isinstance(scan, LaserScan)
    return (
        bool({"depth", "camera", "rgbd", "virtual", "fake"} & topic.words),
        "base" not in topic.words,
        bool({"filtered", "filter"} & topic.words),
        bool({"rear", "back", "side", "left", "right"} & topic.words),
        -round(abs(scan.angle_max - scan.angle_min), 1),
        -topic.count,
        topic.name,
    )


def _tf(topics: Sequence[Topic]) -> tuple[Topic, ...]:
    return tuple(topic for topic in topics if topic.kind == TRANSFORMS)


def _poses(topics: Sequence[Topic], config: TopicsConfig) -> tuple[Topic, ...]:
    """Return the topics that tell where something is, and not where it is to be."""
    asked_for = config.pose.strip("/")
    return tuple(
        topic
        for topic in topics
        if isinstance(topic.first, Pose)
        and (topic.name.strip("/") == asked_for or not topic.words & _NO_POSE)
    )


def _given(
    topics: Sequence[Topic],
    names: Sequence[str],
    *,
    role: str,
    name: str,
    fits: Callable[[Topic], bool],
) -> Topic:
    named = [topic for topic in topics if topic.name.strip("/") == name.strip("/")]
    for topic in named:
        if fits(topic):
            return topic
    if named or name in names:
        what = (
            named[0].problem if named and named[0].problem else "has no messages of the right type"
        )
        raise RecordingError(f"The topic {name!r} cannot be taken for {role}: it {what}.")
    near = difflib.get_close_matches(name, names, n=3, cutoff=0.4)
    hint = f"did you mean {' or '.join(near)}?" if near else f"it has {', '.join(names) or 'none'}."
    raise RecordingError(f"The recording has no topic {name!r} for {role}; {hint}")


def _say_choice(warnings: list[ProcessWarning], role: str, names: Sequence[str]) -> None:
    if len(names) > 1:
        warnings.append(
            ProcessWarning(
                "recording.topic_choice",
                "recording",
                f"Of {len(names)} topics that could be {role}, {names[0]} was chosen; "
                f"--set topics.{role}=TOPIC takes another ({', '.join(names[1:])}).",
            )
        )


def _distinct(topics: Sequence[Topic], key: Callable[[Topic], str]) -> list[Topic]:
    """Return the first topic of each key."""
    firsts: dict[str, Topic] = {}
    for topic in topics:
        firsts.setdefault(key(topic), topic)
    return list(firsts.values())


def _same_size(calibration: Topic, depth: Topic) -> bool:
    info, image = calibration.first, depth.first
    if not isinstance(info, CameraInfo) or not isinstance(image, Image):
        return True
    return (info.width, info.height) == (image.width, image.height)


def _alike(first: str, second: str) -> int:
    """Return how many characters two names begin with in common."""
    return next(
        (i for i, (a, b) in enumerate(zip(first, second, strict=False)) if a != b),
        min(len(first), len(second)),
    )


def camera_frame(roles: Roles, frames: Collection[str]) -> str:
    """Return the depth camera's frame: the images', or the calibration's if TF has only that."""
    assert roles.depth is not None
    assert roles.calibration is not None
    if roles.body_frame:
        return _optical_frame(roles.body_frame)
    own, calibrated = roles.depth.frame_id, roles.calibration.frame_id
    return calibrated if calibrated and own not in frames and calibrated in frames else own


def implied_transforms(roles: Roles) -> tuple[TransformStamped, ...]:
    """Return the poses that follow from the messages: a body's camera looks along its x axis."""
    first = roles.depth.first if roles.depth is not None else None
    if roles.body_frame:
        body, optical = roles.body_frame, _optical_frame(roles.body_frame)
    elif isinstance(first, CloudImage) and first.body_frame is not None:
        body, optical = first.body_frame, first.frame_id
    else:
        return ()
    nowhere, turn = (0.0, 0.0, 0.0), (-0.5, 0.5, -0.5, 0.5)
    return (TransformStamped(0, body, optical, nowhere, turn, True),)


def _optical_frame(body: str) -> str:
    """Return the name of the optical frame in the place of a body's."""
    return f"{body}_optical_axes"


def missing_roles(source: Source, roles: Roles, topics: Sequence[Topic]) -> list[str]:
    """Return what processing would lack, a sentence each with what to do."""
    listed = ", ".join(
        f"{channel.topic} ({channel.schema_name or channel.message_encoding})"
        for channel in sorted(source.channels.values(), key=lambda each: each.topic)
    )
    has = f"the recording has {listed or 'no topics'}"
    missing = []
    if roles.depth is None:
        problems = [f"{t.name} {t.problem}" for t in topics if t.problem and t.kind != TRANSFORMS]
        problems += [
            f"{t.name} has JPEG images, which keep no depth: record the topic itself or its "
            "compressedDepth"
            for t in topics
            if isinstance(t.first, CompressedImage) and is_jpeg(t.first) and "depth" in t.words
        ]
        if problems:
            advice = f"of its topics, {'; '.join(problems)}"
        else:
            advice = "record the camera's depth topic (16UC1, 32FC1, compressedDepth)"
        missing.append(f"No topic with depth images was found; {advice}; {has}.")
    if roles.calibration is None:
        missing.append(
            "No calibration of the depth camera was found (sensor_msgs/CameraInfo or "
            f"foxglove.CameraCalibration); record its camera_info topic; {has}."
        )
    if not (roles.transforms or roles.poses):
        missing.append(
            "No poses were found (/tf, /tf_static or foxglove.FrameTransforms); record them with "
            f"the localisation running; {has}."
        )
    return missing
