"""The depth camera: a structured-light sensor in the robot's head, and its errors.

Noise by range and angle follows Nguyen, Izadi and Lovell (2012), "Modeling Kinect Sensor Noise for
Improved 3D Reconstruction and Tracking"; disparity steps, shadows and mixed pixels are those of the
PrimeSense principle: a projector beside the camera, matched in small windows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from tablemap.geometry import Floats, Pose2
from tablemap.simulation.bending import Bend, draw_bend
from tablemap.simulation.drive import CAMERA_AHEAD
from tablemap.simulation.scenario import Camera
from tablemap.simulation.scene import Scene
from tablemap.simulation.seeds import Generators

FX, FY, CX, CY = 538.391, 538.085, 315.307, 233.048
"""The intrinsics of the HSR's head camera at 640 x 480 pixels."""

_BASELINE = 0.075
_DISPARITY_STEP = 0.125
_NEAREST = 0.4
_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_SUBPIXELS = np.array([[-0.25, -0.25], [0.25, -0.25], [-0.25, 0.25], [0.25, 0.25]])


@dataclass(frozen=True)
class CameraErrors:
    """What the seed drew for a recording.

    Depth comes out multiplied by ``depth_scale``. The true camera is the recorded one, shifted by
    ``x``, ``y``, ``z`` and turned about the base's axes by ``roll``, ``pitch`` and ``yaw``; its
    true focal length is the recorded one times ``focal_scale``. ``bend`` multiplies depth pixel by
    pixel, and ``warming`` is the share by which the scale drifts from the drive's start to its end,
    none in its middle.
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

    @staticmethod
    def drawn(camera: Camera, rng: np.random.Generator, generator: Generators) -> CameraErrors:
        """Draw the errors of one recording; none is more than 2.5 sigma.

        ``generator`` gives what came to the simulator later its own random numbers, by purpose.
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
            float(camera.warming_sigma * np.clip(generator("warming").normal(), -2.5, 2.5)),
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


@dataclass(frozen=True, eq=False)
class View:
    """What the camera would see without noise: per pixel, flat over (height x width).

    ``depth`` metres (inf: nothing), ``normals`` in the map, ``parts`` of the scene, ``cosine`` of
    the angle of incidence, ``behind_glass`` (n,) bool, ``edges`` the indices near depth edges.
    """

    scene: Scene
    map_from_camera: Floats
    depth: Floats
    normals: Floats
    parts: NDArray[np.int32]
    cosine: Floats
    behind_glass: NDArray[np.bool_]
    edges: NDArray[np.int64]


class DepthCamera:
    """A camera with its lens; makes views of scenes and noisy images of views."""

    def __init__(self, camera: Camera, errors: CameraErrors) -> None:
        self.settings = camera
        self.errors = errors
        self.width, self.height = camera.width, camera.height
        sx, sy = camera.width / 640, camera.height / 480
        self.recorded_k = np.array(
            [
                [FX * sx, 0.0, (CX + 0.5) * sx - 0.5],
                [0.0, FY * sy, (CY + 0.5) * sy - 0.5],
                [0.0, 0.0, 1.0],
            ]
        )
        self.k = self.recorded_k * [[errors.focal_scale], [errors.focal_scale], [1.0]]
        self.k[:2, 2] = self.recorded_k[:2, 2]

    @cached_property
    def pixels(self) -> Floats:
        """The (height x width, 2) columns and rows of the pixels' centres."""
        v, u = np.mgrid[0 : self.height, 0 : self.width]
        return np.column_stack([u.ravel(), v.ravel()]).astype(np.float64)

    @cached_property
    def _rays(self) -> Floats:
        return self.directions(self.pixels)

    def directions(self, pixels: Floats) -> Floats:
        """Return the (n, 3) rays of (n, 2) image places, z = 1, through the lens."""
        distorted = (pixels - self.k[:2, 2]) / (self.k[0, 0], self.k[1, 1])
        plain = distorted
        if any(self.settings.distortion):
            k1, k2, p1, p2, k3 = self.settings.distortion
            # The plumb-bob model is undone by iteration, as OpenCV's undistortPoints does it.
            for _ in range(12):
                x, y = plain[:, 0], plain[:, 1]
                r2 = x * x + y * y
                radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
                shift = np.column_stack(
                    [
                        2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                        p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
                    ]
                )
                plain = (distorted - shift) / radial[:, None]
        return np.column_stack([plain, np.ones(len(plain))])

    def sees(self, points: Floats) -> NDArray[np.bool_]:
        """Return which points (n, 3) of the camera's frame lie within its image."""
        ahead = points[:, 2] > 0
        x, y = (points[:, :2] / np.where(ahead, points[:, 2], 1.0)[:, None]).T
        k1, k2, p1, p2, k3 = self.settings.distortion
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        u, v = self.k[0, 0] * u + self.k[0, 2], self.k[1, 1] * v + self.k[1, 2]
        within = (np.abs(u + 0.5 - self.width / 2) < self.width / 2) & (
            np.abs(v + 0.5 - self.height / 2) < self.height / 2
        )
        return np.asarray(ahead & within)

    def view(self, scene: Scene, glass: Scene | None, map_from_camera: Floats) -> View:
        """Cast one ray a pixel and find where depth jumps."""
        rays = self._rays @ map_from_camera[:3, :3].T
        origin = map_from_camera[:3, 3]
        hits = scene.cast(origin, rays)
        cosine = np.abs(np.sum(hits.normals * rays, axis=1)) / np.linalg.norm(rays, axis=1)
        behind_glass = np.zeros(len(rays), dtype=bool)
        if glass is not None:
            behind_glass = glass.cast(origin, rays).distance < hits.distance
        shape = (self.height, self.width)
        far = np.where(np.isfinite(hits.distance), hits.distance, 50.0).reshape(shape)
        parts = hits.parts.reshape(shape)
        edges = np.zeros(shape, dtype=bool)
        for a, b in (
            ((slice(None), slice(1, None)), (slice(None), slice(None, -1))),
            ((slice(1, None), slice(None)), (slice(None, -1), slice(None))),
        ):
            nearer = np.minimum(far[a], far[b])
            jump = (np.abs(far[a] - far[b]) > 0.03 + 0.02 * nearer**2) | (parts[a] != parts[b])
            edges[a] |= jump
            edges[b] |= jump
        near_edges = ndimage.maximum_filter(edges, size=5)
        return View(
            scene,
            map_from_camera,
            hits.distance,
            hits.normals,
            hits.parts,
            cosine,
            behind_glass,
            np.flatnonzero(near_edges),
        )

    def depth(
        self, view: View, rng: np.random.Generator, *, progress: float = 0.5
    ) -> NDArray[np.uint16]:
        """Return one (height, width) image in millimetres, 0 where nothing was measured.

        ``progress`` is the part of the drive that is done: a camera that warms up drifts.
        """
        noise = self.settings.noise
        depth, cosine, parts = view.depth.copy(), view.cosine.copy(), view.parts.copy()
        missing = ~np.isfinite(depth) | (depth < _NEAREST)
        if noise:
            self._blur_edges(view, depth, cosine, parts, missing, rng)
        if self.settings.dropouts:
            missing |= self._shadow(depth)
            missing |= self._unmeasured(view, depth, cosine, parts, rng)
        depth[missing] = 1.0
        if noise:
            angle = np.minimum(np.arccos(np.clip(cosine, 0.0, 1.0)), np.deg2rad(82))
            slanted = (angle / (np.pi / 2 - angle)) ** 2
            sigma = 0.0012 + 0.0019 * (depth - 0.4) ** 2 + 0.0001 / np.sqrt(depth) * slanted
            depth += noise * sigma * rng.standard_normal(len(depth), dtype=np.float32)
            np.maximum(depth, 0.1, out=depth)
            focal_times_baseline = self.k[0, 0] * _BASELINE
            steps = np.rint(focal_times_baseline / depth / _DISPARITY_STEP)
            depth = focal_times_baseline / (np.maximum(steps, 1) * _DISPARITY_STEP)
        if self.errors.bend:
            depth *= self.errors.bend.multiplier(depth)
        scale = self.errors.depth_scale + self.errors.warming * (progress - 0.5)
        millimetres = np.rint(depth * scale * 1000)
        millimetres[missing | (millimetres > 65535)] = 0
        return millimetres.astype(np.uint16).reshape(self.height, self.width)

    def colour(self, view: View, rng: np.random.Generator) -> NDArray[np.uint8]:
        """Return one (height, width, 3) picture, shaded by the surfaces' attitude."""
        palette = np.array([part.colour for part in view.scene.parts] + [(0.7, 0.8, 0.9)])
        light = np.minimum(np.abs(view.normals @ np.array([0.35, 0.25, 0.9])), 1.0)
        light = 255 * (0.4 + 0.6 * light)
        floor = np.flatnonzero((view.parts >= 0) & (view.normals[:, 2] > 0.99))
        points = view.map_from_camera[:3, 3] + view.depth[floor, None] * (
            self._rays[floor] @ view.map_from_camera[:3, :3].T
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

    def _blur_edges(
        self,
        view: View,
        depth: Floats,
        cosine: Floats,
        parts: NDArray[np.int32],
        missing: NDArray[np.bool_],
        rng: np.random.Generator,
    ) -> None:
        """Replace the pixels near depth edges: displaced sideways, mixed, or lost."""
        where = view.edges
        if len(where) == 0:
            return
        angle = np.minimum(np.arccos(np.clip(cosine[where], 0.0, 1.0)), np.deg2rad(80))
        lateral = self.settings.noise * (0.8 + 0.035 * angle / (np.pi / 2 - angle))
        shift = self._smooth_noise(rng)[where] * (lateral * self.width / 640)[:, None]
        places = (self.pixels[where] + shift)[:, None, :] + _SUBPIXELS
        rotation, origin = view.map_from_camera[:3, :3], view.map_from_camera[:3, 3]
        rays = self.directions(places.reshape(-1, 2)) @ rotation.T
        hits = view.scene.cast(origin, rays)
        # What a displaced ray hit is read at the pixel's own ray: a displacement moves edges, and
        # does not roughen a slanted plane (that is in the axial noise already).
        own = np.repeat(self._rays[where] @ rotation.T, len(_SUBPIXELS), axis=0)
        along = np.sum(hits.normals * own, axis=1)
        offset = np.sum(hits.normals * rays, axis=1) * np.where(
            np.isfinite(hits.distance), hits.distance, 0.0
        )
        steep = np.abs(along) < 0.08
        read = np.where(steep, hits.distance, offset / np.where(steep, 1.0, along))
        with np.errstate(invalid="ignore"):  # inf - inf, where the ray left the world
            wild = ~(np.abs(read - hits.distance) < 0.05)
        read = np.where(wild, hits.distance, read).reshape(-1, len(_SUBPIXELS))
        met = hits.parts.reshape(read.shape)
        slant = (np.abs(along) / np.linalg.norm(own, axis=1)).reshape(read.shape)
        front, back = read.argmin(axis=1), read.argmax(axis=1)
        row = np.arange(len(read))
        nearest, farthest = read[row, front], read[row, back]
        tolerance = 0.02 + 0.01 * np.where(np.isfinite(nearest), nearest, 0.0) ** 2
        in_front = read < (nearest + tolerance)[:, None]
        share = in_front.mean(axis=1)
        split = share < 1
        finite = np.where(np.isfinite(read), read, 0.0)
        value = np.sum(finite * in_front, axis=1) / np.maximum(in_front.sum(axis=1), 1)
        value[~np.isfinite(nearest)] = np.inf
        chance = rng.random((3, len(read)))
        goes_back = split & (chance[0] > share)
        mixed = split & (chance[1] < 0.3) & np.isfinite(farthest)
        value = np.where(goes_back, farthest, value)
        mix = chance[2, mixed]
        value[mixed] = mix * nearest[mixed] + (1 - mix) * farthest[mixed]
        chosen = np.where(goes_back, back, front)
        depth[where] = value
        parts[where] = met[row, chosen]
        cosine[where] = slant[row, chosen]
        missing[where] = ~np.isfinite(value) | (value < _NEAREST)
        if self.settings.dropouts:
            missing[where] |= split & (rng.random(len(read)) < 0.35)

    def _smooth_noise(self, rng: np.random.Generator) -> Floats:
        """Return (n, 2) of unit noise that neighbouring pixels share, as matching windows do."""
        white = rng.standard_normal((2, self.height, self.width), dtype=np.float32)
        smooth = ndimage.uniform_filter(white, size=(1, 3, 3), mode="wrap") * 3.0
        return np.asarray(smooth.reshape(2, -1).T, dtype=np.float64)

    def _shadow(self, depth: Floats) -> NDArray[np.bool_]:
        """Return where something nearer hides the projector, which stands to the camera's right.

        A place in column u lies at u - f b / z in the projector's image; it is lit where nothing to
        its right lies further left there.
        """
        disparity = np.where(np.isfinite(depth), self.k[0, 0] * _BASELINE / depth, 0.0)
        u = np.arange(self.width, dtype=np.float64)
        projected = u - disparity.reshape(self.height, self.width)
        least = np.minimum.accumulate(projected[:, ::-1], axis=1)[:, ::-1]
        hidden = np.zeros(projected.shape, dtype=bool)
        hidden[:, :-1] = projected[:, :-1] > least[:, 1:] + 0.5
        return hidden.ravel()

    def _unmeasured(
        self,
        view: View,
        depth: Floats,
        cosine: Floats,
        parts: NDArray[np.int32],
        rng: np.random.Generator,
    ) -> NDArray[np.bool_]:
        """Draw where too little light came back: glancing, dark, far, glossy, behind glass."""
        reflectance = np.array([part.reflectance for part in view.scene.parts] + [0.0])[parts]
        gloss = np.array([part.gloss for part in view.scene.parts] + [0.0])[parts]
        angle_deg = np.rad2deg(np.arccos(np.clip(cosine, 0.0, 1.0)))
        far = np.where(np.isfinite(depth), depth, 10.0)
        light = reflectance * cosine / far**2
        lost = 0.001 + 1 / (1 + np.exp((82.0 - angle_deg) / 1.5))
        lost += 1 / (1 + np.exp((far - 5.0) / -0.35))
        lost += np.clip(1 - light / 0.018, 0.0, 0.95) * (reflectance < 0.2)
        lost += 0.6 * view.behind_glass
        missing = rng.random(len(depth), dtype=np.float32) < lost
        if gloss.any():
            blobs = self._blobs(rng)
            missing |= blobs < gloss
        return np.asarray(missing)

    def _blobs(self, rng: np.random.Generator) -> Floats:
        """Return a patchy (n,) field, uniform in 0 to 1, of patches about 40 pixels wide."""
        rows, columns = max(self.height // 8, 2), max(self.width // 8, 2)
        field = ndimage.gaussian_filter(rng.standard_normal((rows, columns)), 2.5, mode="wrap")
        order = np.empty(field.size)
        order[np.argsort(field, axis=None)] = (np.arange(field.size) + 0.5) / field.size
        v = self.pixels[:, 1] / self.height * (rows - 1)
        u = self.pixels[:, 0] / self.width * (columns - 1)
        return np.asarray(ndimage.map_coordinates(order.reshape(field.shape), [v, u], order=1))


def map_from(base: Floats, base_from_camera: Floats) -> Floats:
    """Return the (4, 4) camera pose in the map for a base pose (3,)."""
    return np.asarray(Pose2(*base).lifted() @ base_from_camera)
