"""The depth camera in the robot's head, and its errors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Bools, Floats, Pose2
from tablemap.simulation import stereo, structured_light, time_of_flight
from tablemap.simulation.bending import Bend, draw_bend
from tablemap.simulation.drive import CAMERA_AHEAD
from tablemap.simulation.image_noise import with_bad_pixels
from tablemap.simulation.lens import Lens
from tablemap.simulation.scenario import CameraSection
from tablemap.simulation.scene import Scene
from tablemap.simulation.seeds import Generators, clipped_normal
from tablemap.simulation.view import View, see

_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True)
class CameraErrors:
    """The camera's errors that the seed drew for a recording.

    - ``depth_scale``: factor on the depth
    - ``x``, ``y``, ``z``: metres, shift of the true camera against the recorded one
    - ``roll``, ``pitch``, ``yaw``: radians, turn of the true camera about the base's axes
    - ``focal_scale``: the true focal length over the recorded one
    - ``bend``: factor on the depth, pixel by pixel
    - ``warming``: drift of the depth scale from the drive's start to its end, a share; it is zero
      in the middle of the drive
    - ``corners``: metres by which the outermost corners of the image read nearer: upper left, upper
      right, lower left, lower right
    """

    depth_scale: float
    roll: float
    pitch: float
    yaw: float
    x: float
    y: float
    z: float
    focal_scale: float
    bend: Bend | None
    warming: float
    corners: tuple[float, ...]

    @staticmethod
    def drawn(
        camera: CameraSection, rng: np.random.Generator, generator: Generators
    ) -> CameraErrors:
        """Draw the errors of one recording; none is more than 2.5 sigma.

        ``generator`` gives newer errors their own random numbers, so that older draws stay as they
        were.
        """
        unit = np.clip(rng.normal(size=7), -2.5, 2.5)
        return CameraErrors(
            float(1 + camera.scale_sigma * unit[0]),
            float(np.deg2rad(camera.roll_sigma_deg) * unit[1]),
            float(np.deg2rad(camera.pitch_sigma_deg) * unit[2]),
            float(np.deg2rad(camera.mount_yaw_sigma_deg) * unit[3]),
            float(camera.mount_sigma * unit[4]),
            float(camera.mount_sigma * unit[5]),
            float(camera.mount_height_sigma * unit[6]),
            float(1 + camera.focal_sigma * np.clip(generator("lens").normal(), -2.5, 2.5)),
            draw_bend(camera, generator("bend")),
            float(camera.warming_sigma * clipped_normal(generator("warming"), 1)[0]),
            tuple((camera.corner_nearer * generator("corners").uniform(0.5, 1.0, 4)).tolist()),
        )

    def applied(self, base_from_camera: Floats) -> Floats:
        """Return the true (4, 4) mounting of a recorded one."""
        cr, sr = np.cos(self.roll), np.sin(self.roll)
        cp, sp = np.cos(self.pitch), np.sin(self.pitch)
        cy, sy = np.cos(self.yaw), np.sin(self.yaw)
        about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
        about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        true = base_from_camera.copy()
        true[:3, :3] = about_z @ about_y @ about_x @ base_from_camera[:3, :3]
        true[:3, 3] += (self.x, self.y, self.z)
        return true


def recorded_mounting(camera_height: float, tilt: float) -> Floats:
    """Return the (4, 4) pose of the optical frame in the base that the robot publishes."""
    c, s = np.cos(tilt), np.sin(tilt)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ _OPTICAL
    pose[:3, 3] = (CAMERA_AHEAD, 0.0, camera_height)
    return pose


class DepthCamera(Lens):
    """A camera with its lens and its errors; makes views of scenes and noisy images of views."""

    def __init__(self, camera: CameraSection, errors: CameraErrors) -> None:
        super().__init__(camera, errors.focal_scale)
        self.errors = errors
        self._bounced: tuple[View, Floats] | None = None

    def view(self, scene: Scene, glass: Scene | None, map_from_camera: Floats) -> View:
        """Return the noise-free view from a pose of the optical frame."""
        return see(self, scene, glass, map_from_camera)

    def depth(
        self, view: View, rng: np.random.Generator, *, progress: float = 0.5
    ) -> NDArray[np.uint16] | NDArray[np.float32]:
        """Return one image (height, width) in the camera's encoding.

        16UC1 has whole millimetres, and 0 where nothing was measured; 32FC1 has metres and NaN.
        ``progress`` is the finished part of the drive: a camera that warms up drifts.
        """
        depth, missing = self._read(view, rng)
        if self.settings.dark_depth:
            reflectance = view.of_material("reflectance", view.parts)
            depth += self.settings.dark_depth * (1 - reflectance)
        if self.errors.bend:
            depth *= self.errors.bend.multiplier(depth)
        if any(self.errors.corners):
            depth -= self._nearer_corners
        depth, missing = with_bad_pixels(self, depth, missing, rng)
        scale = self.errors.depth_scale + self.errors.warming * (progress - 0.5)
        if self.settings.encoding == "32FC1":
            metres = np.where(missing, np.nan, depth * scale)
            return metres.astype(np.float32).reshape(self.height, self.width)
        millimetres = np.rint(depth * scale * 1000)
        millimetres[missing | (millimetres > 65535)] = 0
        return millimetres.astype(np.uint16).reshape(self.height, self.width)

    def _read(self, view: View, rng: np.random.Generator) -> tuple[Floats, Bools]:
        if self.settings.principle == "stereo":
            return stereo.read(self, view, rng)
        if self.settings.principle == "structured_light":
            return structured_light.read(self, view, rng)
        if self.settings.multipath and (self._bounced is None or self._bounced[0] is not view):
            self._bounced = view, time_of_flight.multipath_of(self, view)
        bounced = self._bounced[1] if self._bounced else None
        return time_of_flight.read(self, view, rng, multipath=bounced)

    @cached_property
    def _nearer_corners(self) -> Floats:
        """Return (height x width,) metres by which pixels near the corners read nearer."""
        reach = self.settings.corner_px * self.width / 640
        across, down = (
            (self.width - 1) * np.array([0, 1, 0, 1]),
            (self.height - 1) * np.array([0, 0, 1, 1]),
        )
        nearer = np.zeros(self.width * self.height)
        for u, v, most in zip(across, down, self.errors.corners, strict=True):
            away = np.hypot(*(self.pixels - (u, v)).T)
            nearer += most * np.maximum(1 - away / reach, 0.0)
        return nearer

    def colour(self, view: View, rng: np.random.Generator) -> NDArray[np.uint8]:
        """Return one (height, width, 3) picture, shaded by the surfaces' attitude."""
        palette = np.array([part.colour for part in view.scene.parts] + [(0.7, 0.8, 0.9)])
        light = np.minimum(np.abs(view.normals @ np.array([0.35, 0.25, 0.9])), 1.0)
        light = 255 * (0.4 + 0.6 * light)
        floor = np.flatnonzero((view.parts >= 0) & (view.normals[:, 2] > 0.99))
        points = view.map_from_camera[:3, 3] + view.depth[floor, None] * (
            self.rays[floor] @ view.map_from_camera[:3, :3].T
        )
        tiles = (np.floor(points[:, 0] / 0.3) + np.floor(points[:, 1] / 0.3)) % 2
        light[floor] *= np.where(points[:, 2] < 0.005, 1 - 0.1 * tiles, 1.0)
        light[view.behind_glass] = 0.7 * light[view.behind_glass] + 50.0
        grain = 3.0 * rng.standard_normal(len(light), dtype=np.float32)
        picture = palette.astype(np.float32)[view.parts]
        picture *= light.astype(np.float32)[:, None]
        picture += grain[:, None]
        np.clip(picture, 0, 255, out=picture)
        return picture.astype(np.uint8).reshape(self.height, self.width, 3)


def map_from(base: Floats, base_from_camera: Floats) -> Floats:
    """Return the (4, 4) camera pose in the map for a base pose (3,)."""
    return np.asarray(Pose2(*base).lifted() @ base_from_camera)
