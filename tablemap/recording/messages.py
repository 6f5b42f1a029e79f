"""The sensor messages for processing, independent of the recorder.

Field names are those of ROS; stamps are the header's, in integer nanoseconds; frames are as
recorded, without a leading slash.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats


@dataclass(frozen=True, eq=False)
class Image:
    """A raw image: ``data`` holds ``height`` rows of ``step`` bytes."""

    stamp_ns: int
    frame_id: str
    height: int
    width: int
    encoding: str
    is_bigendian: bool
    step: int
    data: bytes | memoryview


@dataclass(frozen=True, eq=False)
class CloudImage(Image):
    """The depth image (32FC1) from which an organised point cloud was made, and its pinhole.

    ``k`` is (3, 3) float64. If the cloud's own frame has a body's axes (x forward), ``body_frame``
    is that frame, and ``frame_id`` names the optical frame at the same place.
    """

    k: Floats
    body_frame: str | None

    @property
    def calibration(self) -> CameraInfo:
        """The pinhole as a calibration."""
        nothing = np.zeros(0)
        return CameraInfo(
            self.stamp_ns,
            self.frame_id,
            self.height,
            self.width,
            "",
            nothing,
            self.k,
            np.eye(3),
            np.zeros((3, 4)),
        )


@dataclass(frozen=True, eq=False)
class CompressedImage:
    """An encoded image; ``format`` as recorded, for example ``16UC1; compressedDepth png``."""

    stamp_ns: int
    frame_id: str
    format: str
    data: bytes | memoryview


@dataclass(frozen=True, eq=False)
class CameraInfo:
    """A camera calibration.

    - ``width``, ``height``: pixels to which it belongs
    - ``d``, ``k``, ``r``, ``p``: (n,), (3, 3), (3, 3), (3, 4), as ROS names them
    - ``binning``: how many pixels, across and down, make one pixel of the image
    - ``roi``: left, top, width, height of the window that the image shows; None: all
    """

    stamp_ns: int
    frame_id: str
    height: int
    width: int
    distortion_model: str
    d: Floats
    k: Floats
    r: Floats
    p: Floats
    binning: tuple[int, int] = (1, 1)
    roi: tuple[int, int, int, int] | None = None


@dataclass(frozen=True, eq=False)
class LaserScan:
    """A planar scan. ``ranges`` is (n,) float32 in metres; angles in radians; times in seconds."""

    stamp_ns: int
    frame_id: str
    angle_min: float
    angle_max: float
    angle_increment: float
    time_increment: float
    scan_time: float
    range_min: float
    range_max: float
    ranges: NDArray[np.float32]

    @property
    def angles(self) -> Floats:
        """The (n,) beam angles in the laser's frame."""
        beams = np.arange(len(self.ranges), dtype=np.float64)
        return self.angle_min + self.angle_increment * beams

    @property
    def sweep_seconds(self) -> float:
        """The time from the first beam, which the stamp is of, to the last."""
        return float(self.time_increment) * max(len(self.ranges) - 1, 0)


@dataclass(frozen=True)
class Pose:
    """A pose in a frame.

    - ``child_frame``: the frame that has the pose, empty if the message does not name it
    - ``translation``: metres
    - ``rotation``: quaternion (x, y, z, w)
    - ``sigma``: standard deviations of x, y (metres) and yaw (radians), NaN if the message has none
    """

    stamp_ns: int
    frame_id: str
    child_frame: str
    translation: tuple[float, float, float]
    rotation: tuple[float, float, float, float]
    sigma: tuple[float, float, float]


@dataclass(frozen=True)
class TransformStamped:
    """One edge of the TF tree: translation in metres, rotation as quaternion (x, y, z, w)."""

    stamp_ns: int
    parent_frame: str
    child_frame: str
    translation: tuple[float, float, float]
    rotation: tuple[float, float, float, float]
    is_static: bool


Message = Image | CompressedImage | CameraInfo | LaserScan | Pose | tuple[TransformStamped, ...]


class DecodingError(Exception):
    """A message that is not what its schema says; the text completes "it ..."."""
