"""What a viewpoint is: depth, camera and pose."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats, Pose2, transform
from tablemap.recording.messages import CompressedImage, Image

SnapshotsKind = Literal["stops", "keyframes"]
"""Whether the base stood still for them, or they were chosen on the way."""


@dataclass(frozen=True)
class Camera:
    """A pinhole: pixels; x right, y down, z forward (REP 103 optical frame)."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    @cached_property
    def rays(self) -> NDArray[np.float32]:
        """The (height, width, 3) directions of the pixel centres, with z = 1."""
        u = (np.arange(self.width) - self.cx) / self.fx
        v = (np.arange(self.height) - self.cy) / self.fy
        grid = np.ones((self.height, self.width, 3), dtype=np.float32)
        grid[..., 0] = u[None, :]
        grid[..., 1] = v[:, None]
        return grid


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A planned snapshot: when the base stood, and the ``stamps_ns`` of the images there."""

    start_ns: int
    end_ns: int
    stamps_ns: NDArray[np.int64]

    @property
    def middle_ns(self) -> int:
        """The image nearest the middle of the images."""
        return int(self.stamps_ns[len(self.stamps_ns) // 2])


@dataclass(frozen=True, eq=False)
class Snapshot:
    """One viewpoint.

    ``depth`` is (height, width) float32 in metres, NaN where nothing was measured, combined over
    ``images`` images of the stop. ``base_from_camera`` (4, 4) carries the camera's height, roll and
    pitch, also where those came from the localisation: the base moves in the plane alone
    (``map_from_base``, as localised at ``stamp_ns``). ``odom_from_base`` is None without wheel
    odometry. ``start_ns`` and ``end_ns`` bound the time that the base stood still,
    or this view's part of it where the camera rested in several directions.
    ``depth_message`` and ``colour_message`` are what was recorded nearest the stamp. ``base_z`` is
    the height of the base's own origin in the fixed frame, metres. ``localised_sigma`` (3,) is what
    the localisation said of ``map_from_base``: x, y (metres), yaw (radians); None: it said nothing.
    """

    index: int
    stamp_ns: int
    start_ns: int
    end_ns: int
    images: int
    depth: NDArray[np.float32]
    camera: Camera
    base_from_camera: Floats
    map_from_base: Pose2
    odom_from_base: Pose2 | None
    depth_message: Image | CompressedImage
    colour_message: Image | CompressedImage | None
    base_z: float = 0.0
    localised_sigma: Floats | None = None

    def points_in_base(self) -> Floats:
        """Return (height, width, 3) float64 points in the base, NaN where depth is missing."""
        return transform(self.base_from_camera, self.camera.rays * self.depth[..., None])

    def corrected(self, *, base_from_camera: Floats, depth_scale: float) -> Snapshot:
        """Return this snapshot with another mounting and its depth multiplied by a scale."""
        scaled = (self.depth * np.float32(depth_scale)).astype(np.float32)
        return replace(self, base_from_camera=base_from_camera, depth=scaled)


@dataclass(frozen=True)
class SetAside:
    """Something that was not used, and why: its ``index`` among snapshots where it has one."""

    what: Literal["depth image", "viewpoint"]
    stamp_ns: int
    reason: str
    index: int | None = None


@dataclass(frozen=True, eq=False)
class Snapshots:
    """All viewpoints of a recording, in time order, and what became none."""

    snapshots: tuple[Snapshot, ...]
    set_aside: tuple[SetAside, ...]
    kind: SnapshotsKind
