"""ROS 1 and ROS 2 messages, serialised for an MCAP, each with the schema that decodes it."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tablemap.geometry import Floats

Profile = Literal["ros1", "ros2"]

_TF = "tf2_msgs/msg/TFMessage"


class RosMessages:
    """Makes serialised messages of one profile."""

    def __init__(self, profile: Profile) -> None:
        self.profile: Profile = profile
        self._store: Any = get_typestore(
            Stores.ROS1_NOETIC if profile == "ros1" else Stores.ROS2_HUMBLE
        )
        if _TF not in self._store.types:
            self._store.register(
                get_types_from_msg("geometry_msgs/TransformStamped[] transforms", _TF)
            )

    def schema(self, name: str) -> tuple[str, str, bytes]:
        """Return an MCAP schema's name, encoding and text for a message's full name."""
        version = 1 if self.profile == "ros1" else 2
        text: str = self._store.generate_msgdef(name, ros_version=version)[0]
        if self.profile == "ros1":
            return name.replace("/msg/", "/"), "ros1msg", text.encode()
        return name, "ros2msg", text.encode()

    def transforms(self, edges: list[tuple[int, str, str, Floats, Floats]]) -> bytes:
        """Serialise TF edges: stamp, parent, child, translation (3,), quaternion (4,) x y z w."""
        make = self._type
        stamped = [
            make("geometry_msgs/msg/TransformStamped")(
                header=self._header(stamp_ns, parent),
                child_frame_id=child,
                transform=make("geometry_msgs/msg/Transform")(
                    translation=make("geometry_msgs/msg/Vector3")(*map(float, translation)),
                    rotation=make("geometry_msgs/msg/Quaternion")(*map(float, quaternion)),
                ),
            )
            for stamp_ns, parent, child, translation, quaternion in edges
        ]
        return self._serialised(make(_TF)(transforms=stamped), _TF)

    def laser_scan(
        self,
        stamp_ns: int,
        frame: str,
        ranges: NDArray[np.float32],
        *,
        angles: tuple[float, float, float],
        times: tuple[float, float],
        limits: tuple[float, float],
    ) -> bytes:
        """Serialise a scan: angles are first, last and step, times a beam's and the scan's."""
        name = "sensor_msgs/msg/LaserScan"
        message = self._type(name)(
            header=self._header(stamp_ns, frame),
            angle_min=angles[0],
            angle_max=angles[1],
            angle_increment=angles[2],
            time_increment=times[0],
            scan_time=times[1],
            range_min=limits[0],
            range_max=limits[1],
            ranges=ranges,
            intensities=np.zeros(0, dtype=np.float32),
        )
        return self._serialised(message, name)

    def camera_info(
        self, stamp_ns: int, frame: str, *, width: int, height: int, k: Floats, d: Floats
    ) -> bytes:
        """Serialise a plumb-bob calibration: K (3, 3) in pixels, D (5,)."""
        name = "sensor_msgs/msg/CameraInfo"
        matrices = {
            "d": d,
            "k": k.ravel(),
            "r": np.eye(3).ravel(),
            "p": np.column_stack([k, np.zeros(3)]).ravel(),
        }
        if self.profile == "ros1":
            matrices = {key.upper(): value for key, value in matrices.items()}
        roi = self._type("sensor_msgs/msg/RegionOfInterest")(
            x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        message = self._type(name)(
            header=self._header(stamp_ns, frame),
            height=height,
            width=width,
            distortion_model="plumb_bob",
            binning_x=0,
            binning_y=0,
            roi=roi,
            **matrices,
        )
        return self._serialised(message, name)

    def compressed_image(self, stamp_ns: int, frame: str, encoding: str, data: bytes) -> bytes:
        """Serialise an encoded image; ``encoding`` is the message's format."""
        name = "sensor_msgs/msg/CompressedImage"
        message = self._type(name)(
            header=self._header(stamp_ns, frame),
            format=encoding,
            data=np.frombuffer(data, dtype=np.uint8),
        )
        return self._serialised(message, name)

    def image(
        self, stamp_ns: int, frame: str, depth: NDArray[np.uint16] | NDArray[np.float32]
    ) -> bytes:
        """Serialise a raw image: 16UC1 of whole millimetres, 32FC1 of metres."""
        name = "sensor_msgs/msg/Image"
        message = self._type(name)(
            header=self._header(stamp_ns, frame),
            height=depth.shape[0],
            width=depth.shape[1],
            encoding="16UC1" if depth.dtype == np.uint16 else "32FC1",
            is_bigendian=0,
            step=depth.itemsize * depth.shape[1],
            data=np.frombuffer(
                depth.astype(depth.dtype.newbyteorder("<")).tobytes(), dtype=np.uint8
            ),
        )
        return self._serialised(message, name)

    def _header(self, stamp_ns: int, frame: str) -> Any:
        seconds, nanoseconds = divmod(int(stamp_ns), 1_000_000_000)
        stamp = self._type("builtin_interfaces/msg/Time")(sec=seconds, nanosec=nanoseconds)
        header = self._type("std_msgs/msg/Header")
        if self.profile == "ros1":
            return header(seq=0, stamp=stamp, frame_id=frame)
        return header(stamp=stamp, frame_id=frame)

    def _type(self, name: str) -> Any:
        return self._store.types[name]

    def _serialised(self, message: Any, name: str) -> bytes:
        if self.profile == "ros1":
            return bytes(self._store.serialize_ros1(message, name))
        return bytes(self._store.serialize_cdr(message, name))
