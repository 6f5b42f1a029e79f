"""The result of the snapshot stage: depth, camera and pose of each viewpoint."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tablemap.config import DepthCamera
from tablemap.errors import ProcessWarning
from tablemap.geometry import Bools, Floats, Ints, Pose2, invert, transform
from tablemap.recording.messages import CompressedImage, Image
from tablemap.stages.snapshots.noise import DepthNoise, depth_noise
from tablemap.stages.snapshots.rounding import FINE, Rounding

SnapshotsKind = Literal["stops", "keyframes"]
"""Whether the snapshots come from stops of the base, or were chosen during the drive."""


@dataclass(frozen=True)
class Camera:
    """A pinhole camera, in pixels; x right, y down, z forward (REP 103 optical frame)."""

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

    def project(self, points: Floats) -> Floats:
        """Return the columns and rows (n, 2), from pixel centres, of points (n, 3) in the camera.

        Of a point that is not in front of the camera they mean nothing.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            u = self.fx * points[:, 0] / points[:, 2] + self.cx
            v = self.fy * points[:, 1] / points[:, 2] + self.cy
        return np.column_stack([u, v])


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A planned snapshot: the time that the base stood, and the ``stamps_ns`` of its images."""

    start_ns: int
    end_ns: int
    stamps_ns: Ints

    @property
    def middle_ns(self) -> int:
        """The stamp of the middle image."""
        return int(self.stamps_ns[len(self.stamps_ns) // 2])


@dataclass(frozen=True, eq=False)
class Snapshot:
    """One viewpoint.

    - ``start_ns``, ``end_ns``: bounds of the time that the base stood still, or of this view's part
      of it if the camera rested in several directions
    - ``images``: how many images of the stop were combined
    - ``depth``: (height, width) float32 metres, NaN where nothing was measured
    - ``base_from_camera``: (4, 4), with the camera's height, roll and pitch, also if these come
      from the localisation
    - ``map_from_base``: the localised pose at ``stamp_ns``: the base moves only in the plane
    - ``odom_from_base``: None without wheel odometry
    - ``depth_message``, ``colour_message``: the recorded messages nearest to the stamp
    - ``base_z``: metres, the height of the base's origin in the fixed frame
    - ``localised_sigma``: (3,) standard deviations of ``map_from_base`` as recorded, x and y in
      metres, yaw in radians; None if the localisation recorded none
    - ``recorded_noise``: of the depth as it was recorded; None if it is to be told by ``depth``
    - ``mended``: (height, width) bool, the single pixels that took the depth round them, or lost a
      wrong one; None where there are none
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
    recorded_noise: DepthNoise | None = None
    mended: Bools | None = None

    @cached_property
    def noise(self) -> DepthNoise:
        """The noise of the depth image: as recorded, for a correction hardly changes it."""
        return self.recorded_noise or depth_noise(self.depth)

    @property
    def mended_share(self) -> float:
        """The share of the image's pixels that were mended."""
        return 0.0 if self.mended is None else float(self.mended.mean())

    def points_in_base(self) -> Floats:
        """Return (height, width, 3) float64 points in the base, NaN where depth is missing."""
        return transform(self.base_from_camera, self.camera.rays * self.depth[..., None])

    def points_of(self, pixels: Bools) -> Floats:
        """Return (n, 3) float64 points in the base of some pixels, a mask (height, width)."""
        rays, depth = self.camera.rays[pixels], self.depth[pixels]
        return transform(self.base_from_camera, rays * depth[:, None])

    def depth_at(self, points: Floats, *, nearest: float = 0.1) -> tuple[Floats, Floats]:
        """Return how far points (n, 3) in the base are from the camera, and the depth seen there.

        Both are metres along the optical axis. The depth is NaN where there is none, outside of the
        image, and for points that are not ``nearest`` metres ahead.
        """
        seen = transform(invert(self.base_from_camera), points)
        column, row = np.round(self.camera.project(seen)).T
        with np.errstate(invalid="ignore"):
            inside = (seen[:, 2] > nearest) & (column >= 0) & (row >= 0)
            inside &= (column < self.camera.width) & (row < self.camera.height)
        depth = np.full(len(seen), np.nan)
        depth[inside] = self.depth[row[inside].astype(np.int64), column[inside].astype(np.int64)]
        return seen[:, 2], depth

    def corrected(self, *, base_from_camera: Floats, depth_scale: float) -> Snapshot:
        """Return this snapshot with another mounting and its depth multiplied by a scale."""
        scaled = (self.depth * np.float32(depth_scale)).astype(np.float32)
        return replace(self, base_from_camera=base_from_camera, depth=scaled)


@dataclass(frozen=True)
class SetAside:
    """An image or viewpoint that was not used, and why; ``index`` is its snapshot's, if any."""

    what: Literal["depth image", "viewpoint"]
    stamp_ns: int
    reason: str
    index: int | None = None


@dataclass(frozen=True)
class SeenCamera:
    """What the images show of the camera; ``kind`` is None where they do not tell.

    ``noise`` and ``step`` are metres at two metres, ``power`` is that of the distance with which
    the noise grows; all are NaN where too little was seen. ``rounding``: the steps where they are
    coarse. ``window``: the width of its matching window in pixels, 0 where it compares none.
    """

    kind: DepthCamera | None
    noise: float = float("nan")
    power: float = float("nan")
    step: float = float("nan")
    rounding: Rounding = FINE
    window: float = 0.0

    def __str__(self) -> str:
        if not np.isfinite(self.noise):
            return "depth camera: too little was seen to tell its kind"
        name = "of no known kind" if self.kind is None else self.kind.replace("_", " ")
        window = f"; windows of {self.window:.0f} pixels" if self.window else ""
        return (
            f"depth camera: {name} (noise {1e3 * self.noise:.1f} mm at 2 m, growing with the "
            f"distance to the power {self.power:.1f}; steps of {1e3 * self.step:.1f} mm there"
            f"{window})"
        )


UNKNOWN_CAMERA = SeenCamera(None)
"""A camera of which too little was seen, or whose images fit no kind."""


@dataclass(frozen=True, eq=False)
class Snapshots:
    """All viewpoints of a recording, in time order, and the images that were not used.

    ``camera``: what single images show of the camera's kind.
    """

    snapshots: tuple[Snapshot, ...]
    set_aside: tuple[SetAside, ...]
    kind: SnapshotsKind
    camera: SeenCamera = UNKNOWN_CAMERA
    warnings: tuple[ProcessWarning, ...] = ()
