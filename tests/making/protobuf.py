"""A message of each of Foxglove's types that are read, with its description in protobuf."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from foxglove import messages as fm

from tablemap.recording.raw import Channel
from tests.making import messages as w

STAMP = fm.Timestamp(sec=w.START_NS // w.SECOND, nsec=5)
PLACE = fm.Pose(position=fm.Vector3(x=1.0), orientation=fm.Quaternion(w=1.0))
EDGE = fm.FrameTransform(
    timestamp=STAMP,
    parent_frame_id="map",
    child_frame_id="odom",
    translation=fm.Vector3(x=1.0, y=2.0),
    rotation=fm.Quaternion(w=1.0),
)


def raw_image(stamp: fm.Timestamp) -> fm.RawImage:
    """Return the camera's depth as it is."""
    return fm.RawImage(
        timestamp=stamp,
        frame_id=w.CAMERA,
        width=w.WIDTH,
        height=w.HEIGHT,
        encoding="16UC1",
        step=2 * w.WIDTH,
        data=w.millimetres().tobytes(),
    )


def png_image(stamp: fm.Timestamp) -> fm.CompressedImage:
    """Return the camera's depth as a PNG."""
    return fm.CompressedImage(
        timestamp=stamp, frame_id=w.CAMERA, data=w.png(w.millimetres()), format="png"
    )


def point_cloud(stamp: fm.Timestamp) -> fm.PointCloud:
    """Return the camera's depth as organised points."""
    number = fm.PackedElementFieldNumericType.Float32
    return fm.PointCloud(
        timestamp=stamp,
        frame_id=w.CAMERA,
        point_stride=12,
        fields=[
            fm.PackedElementField(name=name, offset=4 * place, type=number)
            for place, name in enumerate("xyz")
        ],
        data=w.cloud().tobytes(),
    )


def laser_scan(stamp: fm.Timestamp) -> fm.LaserScan:
    """Return a scan of 31 beams, 1 to 2 m long."""
    return fm.LaserScan(
        timestamp=stamp,
        frame_id=w.LASER,
        start_angle=-1.5,
        end_angle=1.5,
        ranges=np.linspace(1, 2, 31).tolist(),
    )


MESSAGES: tuple[Any, ...] = (
    raw_image(STAMP),
    png_image(STAMP),
    fm.CameraCalibration(
        timestamp=STAMP, frame_id=w.CAMERA, width=w.WIDTH, height=w.HEIGHT, K=w.K, D=[0.1] * 5
    ),
    point_cloud(STAMP),
    laser_scan(STAMP),
    fm.PoseInFrame(timestamp=STAMP, frame_id="map", pose=PLACE),
    EDGE,
    fm.FrameTransforms(transforms=[EDGE, EDGE]),
)


@cache
def channels() -> tuple[tuple[Channel, bytes], ...]:
    """Return a channel and a message of each type that is read."""
    found = []
    for message in MESSAGES:
        schema = type(message).get_schema()
        channel = Channel(1, "/it", "protobuf", schema.name, "protobuf", schema.data, {})
        found.append((channel, message.encode()))
    return tuple(found)
