"""A recording as mcap and rosbags read it, for tests that must not rest on our own reader."""

from __future__ import annotations

import io
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from numpy.typing import NDArray
from PIL import Image
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from tablemap.geometry import Floats


def read(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Return (log time, decoded message) by topic, in the order of the file."""
    messages: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        ros1 = reader.get_header().profile == "ros1"
        store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        tf = "tf2_msgs/msg/TFMessage"
        if tf not in store.types:
            store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", tf))
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            name = schema.name if "/msg/" in schema.name else schema.name.replace("/", "/msg/")
            decode = store.deserialize_ros1 if ros1 else store.deserialize_cdr
            messages[channel.topic].append((message.log_time, decode(message.data, name)))
    return messages


def stamp_ns(message: Any) -> int:
    """Return a message's header stamp."""
    stamp = message.header.stamp
    return int(stamp.sec * 1_000_000_000 + stamp.nanosec)


def depth_millimetres(message: Any) -> NDArray[np.uint16]:
    """Decode a depth image of millimetres, compressed or raw."""
    assert (message.format if hasattr(message, "format") else message.encoding)[:5] == "16UC1"
    return np.asarray(depth_steps(message)).astype(np.uint16)


def depth_steps(message: Any) -> NDArray[np.uint16] | NDArray[np.float32]:
    """Decode a depth image's own values: millimetres, metres, or steps of the inverse depth.

    0 or NaN where nothing was measured.
    """
    if hasattr(message, "format"):
        return np.asarray(Image.open(io.BytesIO(message.data.tobytes()[12:]))).astype(np.uint16)
    kind = "<u2" if message.encoding == "16UC1" else "<f4"
    return np.asarray(message.data.view(kind).reshape(message.height, message.width))


def transforms(messages: dict[str, list[tuple[int, Any]]]) -> dict[str, dict[int, Floats]]:
    """Return, by child frame, the (4, 4) poses in its parent by stamp."""
    edges: dict[str, dict[int, Floats]] = defaultdict(dict)
    for _, message in messages["/tf_static"] + messages["/tf"]:
        for edge in message.transforms:
            t, q = edge.transform.translation, edge.transform.rotation
            pose = np.eye(4)
            pose[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
            pose[:3, 3] = t.x, t.y, t.z
            edges[edge.child_frame_id][stamp_ns(edge)] = pose
    return edges


def nearest(poses: dict[int, Floats], stamp: int) -> Floats:
    """Return the pose whose stamp is nearest."""
    return poses[min(poses, key=lambda each: abs(each - stamp))]
