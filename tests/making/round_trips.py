"""Round trips of a depth camera about boxes on a floor, for tests that need no simulator."""

from __future__ import annotations

import numpy as np

from tablemap.geometry import Floats, Pose2
from tablemap.recording.messages import CompressedImage
from tablemap.stages.snapshots import Camera, Snapshot
from tests.making.casting import Box, World, looking

CAMERA = Camera(320, 240, 269.0, 269.0, 157.6, 116.5)
MESSAGE = CompressedImage(0, "camera", "16UC1; compressedDepth png", b"")


def mounting(height: float = 1.1, down_deg: float = 25.0) -> Floats:
    """Return base_from_camera (4, 4) of a camera above the base's origin that looks ahead, down."""
    return looking(height, np.deg2rad(down_deg))


def tilted(mount: Floats, *, roll: float, pitch: float) -> Floats:
    """Turn a mounting about the base's axes, the camera's place kept."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    turned = mount.copy()
    turned[:3, :3] = about_y @ about_x @ mount[:3, :3]
    return turned


def render(
    map_from_base: Pose2, mount: Floats, boxes: list[Box], camera: Camera = CAMERA
) -> Floats:
    """Return (height, width) depth in metres of floor and boxes, NaN beyond 6 m."""
    depth = World(boxes).depth(map_from_base.lifted() @ mount, camera.rays.astype(np.float64))
    depth[depth > 6.0] = np.nan
    return depth


def table(x: float, y: float, length: float, width: float, height: float, yaw: float) -> list[Box]:
    """Return a table 3 cm thick on four legs."""
    boxes = [Box(x, y, length, width, height - 0.03, height, yaw)]
    pose = Pose2(x, y, yaw)
    for sx in (-1, 1):
        for sy in (-1, 1):
            place = pose.apply([sx * (length / 2 - 0.05), sy * (width / 2 - 0.05)])
            boxes.append(Box(place[0], place[1], 0.05, 0.05, 0.0, height - 0.03, yaw))
    return boxes


def round_trip(
    boxes: list[Box],
    centre: tuple[float, float],
    *,
    views: int = 6,
    radius: float = 1.7,
    seed: int = 0,
    mount: Floats | None = None,
    recorded_mount: Floats | None = None,
    depth_scale: float = 1.0,
    noise: float = 0.001,
    step: float = 0.0,
    pose_error: tuple[float, float] = (0.0, 0.0),
) -> tuple[Snapshot, ...]:
    """Return snapshots round a place, with noise, rounding to steps and wrong poses (m, rad)."""
    rng = np.random.default_rng(seed)
    mount = mounting() if mount is None else mount
    snapshots = []
    for index in range(views):
        bearing = 2 * np.pi * index / views
        place = np.array(centre) + radius * np.array([np.cos(bearing), np.sin(bearing)])
        pose = Pose2(float(place[0]), float(place[1]), float(bearing + np.pi))
        depth = render(pose, mount, boxes) * depth_scale
        depth = depth + rng.normal(0, noise, depth.shape) * np.nan_to_num(depth) ** 2
        if step > 0:
            depth = np.round(depth / step) * step
        localised = Pose2(
            pose.x + rng.normal(0, pose_error[0]),
            pose.y + rng.normal(0, pose_error[0]),
            pose.yaw + rng.normal(0, pose_error[1]),
        )
        snapshots.append(
            Snapshot(
                index=index,
                stamp_ns=index,
                start_ns=index,
                end_ns=index,
                images=1,
                depth=depth.astype(np.float32),
                camera=CAMERA,
                base_from_camera=mount if recorded_mount is None else recorded_mount,
                map_from_base=localised,
                odom_from_base=None,
                depth_message=MESSAGE,
                colour_message=None,
            )
        )
    return tuple(snapshots)
