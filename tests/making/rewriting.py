"""Rewrites a recording with one condition changed, as ROS 1, ROS 2 or Foxglove would log it.

Messages pass through `rewrite` as ROS 2 messages of rosbags; a change takes one and yields what is
logged in its place. `simulate_plain` writes the recording that tests begin with.
"""

from __future__ import annotations

import copy
import io
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from foxglove import messages as fm
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from PIL import Image
from scipy.spatial.transform import Rotation

from tablemap.geometry import Pose2
from tablemap.simulation import Scenario, simulate, write
from tablemap.simulation.ros import Profile
from tablemap.simulation.scenario import CameraSection, LegsSection, Robot, Table
from tests.making.messages import ROS1, ROS2, png

Dialect = Literal["ros1", "ros2", "foxglove"]
DIALECTS: tuple[Dialect, ...] = ("ros1", "ros2", "foxglove")
SECOND = 1_000_000_000


@dataclass(frozen=True)
class Entry:
    """A message as it is logged; ``publisher`` tells channels of one topic apart."""

    topic: str
    message: Any
    log_ns: int
    publisher: str = ""

    @property
    def type(self) -> str:
        """The message's type without its package, such as ``CameraInfo``."""
        return str(self.message.__msgtype__.rpartition("/")[2])

    @property
    def is_depth(self) -> bool:
        """Whether this is an image of the depth camera."""
        return "depth" in self.topic and self.type in ("Image", "CompressedImage")

    @property
    def stamp_ns(self) -> int:
        """The header's stamp, of transforms that of the first."""
        message = self.message.transforms[0] if self.type == "TFMessage" else self.message
        return message.header.stamp.sec * SECOND + message.header.stamp.nanosec


Change = Callable[[Entry], Iterable[Entry]]


def simulate_plain(folder: Path, *, width: int = 320, profile: Profile = "ros2") -> Path:
    """Write a cheap recording of an ordinary table: eight stops, a small image at each."""
    scenario = Scenario(
        name="plain",
        description="a rectangle on four legs",
        table=Table(
            shape="rectangle",
            length=1.2,
            width=0.8,
            height=0.755,
            size_spread=0,
            legs=LegsSection(size=0.06, inset=0.07),
        ),
        robot=Robot(images_per_stop=1, colour=False, standing_scan_rate=4),
        camera=CameraSection(width=width, height=width * 3 // 4),
    )
    path = folder / "plain.mcap"
    write(simulate(scenario, seed=1, nominal=True), path, profile=profile)
    return path


def rewrite(source: Path, target: Path, *changes: Change, dialect: Dialect = "ros2") -> Path:
    """Log a recording anew, each of its messages passed through the changes; return ``target``."""
    entries: list[Entry] = list(_read(source))
    for change in changes:
        entries = [changed for entry in entries for changed in change(entry)]
    entries.sort(key=lambda entry: entry.log_ns)
    with target.open("wb") as stream:
        writer = Writer(stream, chunk_size=512 * 1024, compression=CompressionType.ZSTD)
        writer.start(profile=dialect if dialect != "foxglove" else "", library="rewritten")
        channels: dict[tuple[str, str, str], int] = {}
        for entry in entries:
            schema, encoding, data = _encoded(entry, dialect)
            key = (entry.topic, schema[0], entry.publisher)
            if key not in channels:
                metadata = {"callerid": entry.publisher} if entry.publisher else {}
                channels[key] = writer.register_channel(
                    entry.topic, encoding, writer.register_schema(*schema), metadata
                )
            writer.add_message(channels[key], entry.log_ns, data, entry.log_ns)
        writer.finish()
    return target


def edit(entry: Entry, **changed: Any) -> Entry:
    """Return an entry with some of its message's fields replaced."""
    return replace(entry, message=replace(entry.message, **changed))


def restamped(entry: Entry, shift_ns: int) -> Entry:
    """Return an entry with its header stamps shifted, and logged when it was."""
    message = copy.deepcopy(entry.message)
    for each in message.transforms if entry.type == "TFMessage" else [message]:
        stamp = each.header.stamp
        stamp_ns = stamp.sec * SECOND + stamp.nanosec + shift_ns
        stamp.sec, stamp.nanosec = stamp_ns // SECOND, stamp_ns % SECOND
    return replace(entry, message=message)


def reframed(entry: Entry, name: Callable[[str], str]) -> Entry:
    """Return an entry with all of its frames renamed."""
    message = copy.deepcopy(entry.message)
    for each in message.transforms if entry.type == "TFMessage" else [message]:
        each.header.frame_id = name(each.header.frame_id)
        if hasattr(each, "child_frame_id"):
            each.child_frame_id = name(each.child_frame_id)
    return replace(entry, message=message)


def with_edges(
    entry: Entry, change: Callable[[str, str, int, Pose2], Pose2 | None], *, alone: bool = False
) -> Entry | None:
    """Return transforms with planar edges changed: by parent, child, stamp and pose.

    An edge for which None is returned is left out, or with ``alone`` each that is not changed.
    Height and tilt stay as they are. None where no edge is left.
    """
    message = copy.deepcopy(entry.message)
    kept = []
    for each in message.transforms:
        place, turn = each.transform.translation, each.transform.rotation
        spin = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
        yaw = float(spin.as_euler("zyx")[0])
        stamp_ns = each.header.stamp.sec * SECOND + each.header.stamp.nanosec
        pose = Pose2(place.x, place.y, yaw)
        changed = change(each.header.frame_id, each.child_frame_id, stamp_ns, pose)
        if changed is None or (alone and changed == pose):
            continue
        place.x, place.y = changed.x, changed.y
        turned = Rotation.from_euler("z", changed.yaw - yaw) * spin
        turn.x, turn.y, turn.z, turn.w = (float(value) for value in turned.as_quat())
        kept.append(each)
    return replace(entry, message=replace(message, transforms=kept)) if kept else None


def depth_of(entry: Entry) -> np.ndarray[Any, np.dtype[np.uint16]]:
    """Return the recorded values of a 16-bit depth image, (height, width)."""
    if entry.type == "Image":
        return entry.message.data.view("<u2").reshape(entry.message.height, -1).copy()
    with Image.open(io.BytesIO(entry.message.data.tobytes()[12:])) as picture:
        return np.asarray(picture).astype(np.uint16)


def with_depth(entry: Entry, values: np.ndarray[Any, Any], *, encoding: str = "16UC1") -> Entry:
    """Return a depth image with other values: encoded as it was, or raw on the topic beside."""
    if entry.type == "CompressedImage" and encoding == "16UC1":
        data = np.frombuffer(bytes(12) + png(values.astype(np.uint16)), np.uint8)
        return edit(entry, data=data)
    message = ROS2.types["sensor_msgs/msg/Image"](
        header=entry.message.header,
        height=values.shape[0],
        width=values.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=values.shape[1] * values.itemsize,
        data=np.frombuffer(np.ascontiguousarray(values).tobytes(), np.uint8),
    )
    return replace(entry, topic=entry.topic.removesuffix("/compressedDepth"), message=message)


def _read(path: Path) -> Iterator[Entry]:
    with path.open("rb") as stream:
        reader = make_reader(stream)
        is_ros1 = reader.get_header().profile == "ros1"
        for schema, channel, raw in reader.iter_messages():
            assert schema is not None
            name = schema.name if "/msg/" in schema.name else schema.name.replace("/", "/msg/")
            if is_ros1:
                message = _as(ROS1.deserialize_ros1(raw.data, name), ROS2)
            else:
                message = ROS2.deserialize_cdr(raw.data, name)
            yield Entry(channel.topic, message, raw.log_time)


def _as(message: Any, store: Any) -> Any:
    """Return a message of one ROS version as that of the other."""
    if isinstance(message, list):
        return [_as(each, store) for each in message]
    if not is_dataclass(message):
        return message
    made = store.types[message.__msgtype__]
    have = {
        field.name.lower(): _as(getattr(message, field.name), store) for field in fields(message)
    }
    return made(
        **{
            field.name: have.get(field.name.lower(), 0)
            for field in fields(made)
            if field.name != "__msgtype__"
        }
    )


Schema = tuple[str, str, bytes]


def _encoded(entry: Entry, dialect: Dialect) -> tuple[Schema, str, bytes]:
    name = entry.message.__msgtype__
    if dialect == "foxglove":
        made = _foxglove(entry)
        schema = type(made).get_schema()
        return (schema.name, schema.encoding, schema.data), "protobuf", made.encode()
    if dialect == "ros1":
        text = ROS1.generate_msgdef(name, ros_version=1)[0].encode()
        data = ROS1.serialize_ros1(_as(entry.message, ROS1), name)
        return (name.replace("/msg/", "/"), "ros1msg", text), "ros1", bytes(data)
    text = ROS2.generate_msgdef(name, ros_version=2)[0].encode()
    return (name, "ros2msg", text), "cdr", bytes(ROS2.serialize_cdr(entry.message, name))


def _foxglove(entry: Entry) -> Any:
    message = entry.message
    if entry.type == "TFMessage":
        return fm.FrameTransforms(transforms=[_frame_transform(t) for t in message.transforms])
    about = {
        "timestamp": _timestamp(message.header.stamp),
        "frame_id": message.header.frame_id,
    }
    if entry.type in ("PoseStamped", "PoseWithCovarianceStamped"):
        pose = message.pose.pose if hasattr(message.pose, "covariance") else message.pose
        return fm.PoseInFrame(
            **about,
            pose=fm.Pose(
                position=fm.Vector3(x=pose.position.x, y=pose.position.y, z=pose.position.z),
                orientation=fm.Quaternion(
                    x=pose.orientation.x,
                    y=pose.orientation.y,
                    z=pose.orientation.z,
                    w=pose.orientation.w,
                ),
            ),
        )
    if entry.type == "LaserScan":
        end = message.angle_min + message.angle_increment * (len(message.ranges) - 1)
        return fm.LaserScan(
            **about,
            start_angle=message.angle_min,
            end_angle=end,
            ranges=message.ranges.astype(float).tolist(),
        )
    if entry.type == "CameraInfo":
        return fm.CameraCalibration(
            **about,
            width=message.width,
            height=message.height,
            distortion_model=message.distortion_model,
            D=message.d.tolist(),
            K=message.k.tolist(),
            R=message.r.tolist(),
            P=message.p.tolist(),
        )
    if entry.type == "Image":
        return fm.RawImage(
            **about,
            width=message.width,
            height=message.height,
            encoding=message.encoding,
            step=message.step,
            data=message.data.tobytes(),
        )
    if "compressedDepth" in message.format:
        return fm.CompressedImage(**about, data=message.data.tobytes()[12:], format="png")
    return fm.CompressedImage(**about, data=message.data.tobytes(), format="jpeg")


def _frame_transform(edge: Any) -> fm.FrameTransform:
    place, turn = edge.transform.translation, edge.transform.rotation
    return fm.FrameTransform(
        timestamp=_timestamp(edge.header.stamp),
        parent_frame_id=edge.header.frame_id,
        child_frame_id=edge.child_frame_id,
        translation=fm.Vector3(x=place.x, y=place.y, z=place.z),
        rotation=fm.Quaternion(x=turn.x, y=turn.y, z=turn.z, w=turn.w),
    )


def _timestamp(stamp: Any) -> fm.Timestamp:
    return fm.Timestamp(sec=stamp.sec, nsec=stamp.nanosec)
