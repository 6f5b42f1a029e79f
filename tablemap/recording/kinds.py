"""The kinds of messages that processing reads, by the names of their schemas."""

from __future__ import annotations

from tablemap.recording.raw import Channel

IMAGE, COMPRESSED, CALIBRATION, LASER, POINTS, POSE, TRANSFORMS = (
    "image",
    "compressed image",
    "calibration",
    "laser scan",
    "point cloud",
    "pose",
    "transforms",
)

KINDS = {
    "sensor_msgs/Image": IMAGE,
    "sensor_msgs/CompressedImage": COMPRESSED,
    "sensor_msgs/CameraInfo": CALIBRATION,
    "sensor_msgs/LaserScan": LASER,
    "sensor_msgs/MultiEchoLaserScan": LASER,
    "sensor_msgs/PointCloud2": POINTS,
    "geometry_msgs/PoseStamped": POSE,
    "geometry_msgs/PoseWithCovarianceStamped": POSE,
    "nav_msgs/Odometry": POSE,
    "tf2_msgs/TFMessage": TRANSFORMS,
    "tf/tfMessage": TRANSFORMS,
    "foxglove/RawImage": IMAGE,
    "foxglove/CompressedImage": COMPRESSED,
    "foxglove/CameraCalibration": CALIBRATION,
    "foxglove/LaserScan": LASER,
    "foxglove/PointCloud": POINTS,
    "foxglove/PoseInFrame": POSE,
    "foxglove/FrameTransform": TRANSFORMS,
    "foxglove/FrameTransforms": TRANSFORMS,
}
"""The kind of message of each schema that is read."""


def schema_key(name: str) -> str:
    """Return a schema's name without the spelling of its system: ``sensor_msgs/Image``."""
    return name.replace("/msg/", "/").replace("foxglove.", "foxglove/")


def kind_of(channel: Channel) -> str | None:
    """Return the kind of a channel's messages, or None if processing does not need them."""
    key = schema_key(channel.schema_name)
    if key.startswith("foxglove_msgs/"):
        key = key.replace("foxglove_msgs/", "foxglove/")
    return KINDS.get(key)
