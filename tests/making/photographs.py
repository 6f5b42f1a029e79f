"""Organised depth images of simple scenes, with a depth camera's noise."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Bools, Floats, Pose2
from tablemap.recording.messages import Image
from tablemap.stages.segmentation import Label, Segmentation, ViewSegmentation
from tablemap.stages.snapshots import Camera, Snapshot
from tests.making.casting import Box, Drum, World

CAMERA = Camera(640, 480, 538.391, 538.085, 315.307, 233.048)


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
    world = World((scene.top, *scene.things))
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
        return world.cast(origin, rays @ rotation.T)

    truth, what = look(0.0, 0.0)
    spread = [(du, dv) for du in (-0.4, 0.0, 0.4) for dv in (-0.4, 0.0, 0.4)]
    parts = np.stack([look(*offset)[0] if any(offset) else truth for offset in spread])
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


def _shadow(truth: Floats, camera: Camera, baseline: float) -> Bools:
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
