"""Organised depth images of simple scenes, cast ray by ray, with a depth camera's noise."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats, Pose2
from tablemap.recording.messages import Image
from tablemap.stages.segmentation import Label, Segmentation, ViewSegmentation
from tablemap.stages.snapshots import Camera, Snapshot

CAMERA = Camera(640, 480, 538.391, 538.085, 315.307, 233.048)


@dataclass(frozen=True)
class Box:
    """An upright box: ``centre`` and ``size`` (x, y), ``low`` to ``high``, turned by ``yaw``."""

    centre: tuple[float, float]
    size: tuple[float, float]
    low: float
    high: float
    yaw: float = 0.0

    def hit(self, origin: Floats, rays: Floats) -> Floats:
        """Return the distance along the rays to the box, inf where they miss."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
        start = turn @ (origin - [*self.centre, 0.0])
        local = rays @ turn.T
        lows = np.array([-self.size[0] / 2, -self.size[1] / 2, self.low])
        highs = np.array([self.size[0] / 2, self.size[1] / 2, self.high])
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (lows - start) / local, (highs - start) / local
        enter = np.minimum(a, b).max(axis=-1)
        leave = np.maximum(a, b).min(axis=-1)
        return np.where((enter < leave) & (enter > 0), enter, np.inf)

    def outside(self, points: Floats) -> Floats:
        """Return how far (n, 2) points lie outside its outline (negative: inside), metres."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        local = (points - self.centre) @ np.array([[c, -s], [s, c]])
        beyond = np.abs(local) - np.array(self.size) / 2
        far = np.linalg.norm(np.maximum(beyond, 0), axis=1)
        return far + np.minimum(beyond.max(axis=1), 0)


@dataclass(frozen=True)
class Drum:
    """An upright cylinder."""

    centre: tuple[float, float]
    diameter: float
    low: float
    high: float

    def hit(self, origin: Floats, rays: Floats) -> Floats:
        """Return the distance along the rays to the cylinder, inf where they miss."""
        start = origin[:2] - self.centre
        a = np.sum(rays[..., :2] ** 2, axis=-1)
        b = rays[..., :2] @ start
        root = b * b - a * (start @ start - self.diameter**2 / 4)
        with np.errstate(divide="ignore", invalid="ignore"):
            wall_in, wall_out = (-b - np.sqrt(root)) / a, (-b + np.sqrt(root)) / a
            at = (np.array([self.low, self.high]) - origin[2]) / rays[..., 2:]
        enter = np.maximum(wall_in, at.min(axis=-1))
        leave = np.minimum(wall_out, at.max(axis=-1))
        return np.where((root > 0) & (enter < leave) & (enter > 0), enter, np.inf)

    def outside(self, points: Floats) -> Floats:
        """Return how far (n, 2) points lie outside its outline (negative: inside), metres."""
        return np.linalg.norm(points - self.centre, axis=1) - self.diameter / 2


@dataclass(frozen=True)
class Scene:
    """A table top, what else there is, and a floor at z = 0."""

    top: Box | Drum
    things: tuple[Box | Drum, ...] = ()
    noise: float = 1.0
    steps: float = 0.0
    dropouts: float = 0.2
    shadow_baseline: float = 0.0
    images: int = 5
    label_tolerance: float = field(default=0.015)

    def cast(self, origin: Floats, rays: Floats) -> tuple[Floats, NDArray[np.intp]]:
        """Return how far along the rays they meet what: 0 floor, 1 top, 2 something else."""
        with np.errstate(divide="ignore"):
            floor = np.where(rays[..., 2] < 0, -origin[2] / rays[..., 2], np.inf)
        hits = np.stack([floor, *(thing.hit(origin, rays) for thing in (self.top, *self.things))])
        return hits.min(axis=0), np.minimum(hits.argmin(axis=0), 2)


def mount(height: float, pitch_deg: float, yaw_deg: float = 0.0) -> Floats:
    """Return ``base_from_camera`` (4, 4) of a camera above the base, looking down by a pitch."""
    pitch, yaw = np.radians(pitch_deg), np.radians(yaw_deg)
    forward = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), -np.sin(pitch)])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    pose[2, 3] = height
    return pose


def photograph(
    scene: Scene,
    base_from_camera: Floats,
    rng: np.random.Generator,
    *,
    index: int = 0,
    camera: Camera = CAMERA,
) -> tuple[Snapshot, ViewSegmentation]:
    """Return what a depth camera sees of the scene, and the labels that its truth gives.

    Mixed pixels are means over a pixel's area; depth noise is Nguyen's; each image of a stop has
    its own, and the snapshot is their median.
    """
    rotation, origin = base_from_camera[:3, :3], base_from_camera[:3, 3]
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))

    def look(du: Floats | float, dv: Floats | float) -> tuple[Floats, NDArray[np.intp]]:
        rays = np.stack(
            [
                (u + du - camera.cx) / camera.fx,
                (v + dv - camera.cy) / camera.fy,
                np.ones(u.shape),
            ],
            axis=-1,
        )
        return scene.cast(origin, rays @ rotation.T)

    truth, what = look(0.0, 0.0)
    parts = np.stack([look(du, dv)[0] for du in (-0.4, 0.0, 0.4) for dv in (-0.4, 0.0, 0.4)])
    low, high = parts.min(axis=0), parts.max(axis=0)
    broken = high - low > 0.1
    images = np.empty((scene.images, *truth.shape))
    for image in images:
        # Each image of a broken pixel sees another share of its parts.
        share = rng.random((9, *truth.shape)) ** 2
        mixed = (parts * share).sum(axis=0) / share.sum(axis=0)
        image[:] = np.where(broken, mixed, truth)
        image += scene.noise * (0.0012 + 0.0019 * (image - 0.4) ** 2) * rng.normal(size=u.shape)
        if scene.steps:
            image[:] = np.round(image / scene.steps) * scene.steps
        image[broken & (rng.random(u.shape) < scene.dropouts)] = np.nan
        image[~np.isfinite(image) | (image > 6)] = np.nan
    seen = np.isfinite(images).mean(axis=0) >= 0.5
    depth = np.full(truth.shape, np.nan)
    depth[seen] = np.nanmedian(images[:, seen], axis=0)
    if scene.shadow_baseline:
        depth[_shadow(truth, camera, scene.shadow_baseline)] = np.nan

    snapshot = Snapshot(
        index=index,
        stamp_ns=index,
        start_ns=index,
        end_ns=index,
        images=scene.images,
        depth=depth.astype(np.float32),
        camera=camera,
        base_from_camera=base_from_camera,
        map_from_base=Pose2(),
        odom_from_base=None,
        depth_message=Image(index, "camera", 0, 0, "32FC1", False, 0, b""),
        colour_message=None,
    )
    height = snapshot.points_in_base()[..., 2] - scene.top.high
    labels = np.full(depth.shape, Label.UNKNOWN, dtype=np.uint8)
    with np.errstate(invalid="ignore"):
        labels[height < -scene.label_tolerance] = Label.BEHIND
        labels[height > scene.label_tolerance] = Label.FRONT
        labels[(np.abs(height) <= scene.label_tolerance) & (what == 1)] = Label.TOP
    return snapshot, ViewSegmentation(index, labels, True, None, None, int((what == 1).sum()))


def _shadow(truth: Floats, camera: Camera, baseline: float) -> NDArray[np.bool_]:
    """Return the pixels that a projector ``baseline`` to the right of the camera does not reach."""
    columns = np.arange(camera.width)
    lit = columns - camera.fx * baseline / truth
    ahead = np.minimum.accumulate(lit[:, ::-1], axis=1)[:, ::-1]
    shadow = np.zeros(truth.shape, dtype=bool)
    shadow[:, :-1] = ahead[:, 1:] < lit[:, :-1] - 0.5
    return shadow


def segmentation_of(views: list[ViewSegmentation], height: float) -> Segmentation:
    """Return the views as a segmentation of the table at a height."""
    return Segmentation(tuple(views), height, 0.002, (), ())
