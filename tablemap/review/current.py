"""The stop at the cursor: on the timelines of the recording its own camera and points stand out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from tablemap import palette
from tablemap.geometry import Pose2, transform
from tablemap.review import colours
from tablemap.review.clouds import raised
from tablemap.review.eyes import overview_eye
from tablemap.review.room import Eye
from tablemap.review.scene import DrawnScene
from tablemap.review.stream import Stream
from tablemap.stages.registration import Registration

DEPTH_SHARE = 0.28  # of the table's reach
LEAST_DEPTH, MOST_DEPTH = 0.05, 0.2  # metres
LARGER = 1.5  # than the other stops' cameras
MOST_PX = 40.0  # of the current stop's camera in the picture of the first view


def camera_of_stop(
    scene: DrawnScene, index: int, pose: Pose2, *, share: float = 1.0
) -> NDArray[np.float32]:
    """Return a stop's camera as one line (n, 3), a pyramid whose tip comes last.

    Its size follows the table's, which is known from the candidates on, times ``share``.
    """
    tip, *corners = scene.cameras[index][1]
    depth = float(np.clip(DEPTH_SHARE * scene.extent, LEAST_DEPTH, MOST_DEPTH))
    corners = [tip + share * depth * (corner - tip) for corner in corners]
    spokes = [point for corner in corners for point in (corner, tip)]
    ring = [*corners, corners[0]]
    return transform(pose.lifted(), np.array([*ring, *spokes])).astype(np.float32)


def current_camera(scene: DrawnScene, index: int, pose: Pose2, *, eye: Eye) -> NDArray[np.float32]:
    """Return the camera of the stop at the cursor: larger than the others', small for its eye."""
    line = camera_of_stop(scene, index, pose, share=LARGER)
    pixels, _ = eye.pixels(line.astype(np.float64))
    share = min(1.0, MOST_PX / max(float(np.ptp(pixels, axis=0).max()), 1e-9))
    return camera_of_stop(scene, index, pose, share=share * LARGER)


def log_localised_stops(stream: Stream) -> None:
    """Draw each snapshot's camera where the localisation has it."""
    stops = stream.scene.localised
    _log_cameras(stream, stops, (True,) * len(stops))


def log_registered_stops(stream: Stream, registration: Registration) -> None:
    """Draw each snapshot's camera as registered, and what laser and camera saw from there."""
    scene, poses = stream.scene, registration.map_from_base
    _log_cameras(stream, poses, registration.used)
    scans = {scan.index: scan.points for scan in registration.stop_scans}
    for index, stamp in enumerate(scene.stamps_ns[: len(poses)]):
        seen: list[NDArray[np.floating]] = [
            raised(scans.get(index, np.zeros((0, 2))), scene.laser_height),
            *[cloud.get(index, np.zeros((0, 3))) for cloud in (scene.tops, scene.clutter)],
        ]
        stream.at_stop(stamp, index)
        stream.log(
            "stop/points",
            rr.Points3D(
                poses[index].apply(np.concatenate(seen)).astype(np.float32),
                colors=[colours.of_stop(index)],
                radii=rr.Radius.ui_points(1.8),
            ),
        )
    stream.hold()


def _log_cameras(stream: Stream, poses: Sequence[Pose2], used: Sequence[bool]) -> None:
    scene = stream.scene
    eye = overview_eye(scene)
    for index, pose in enumerate(poses[: len(scene.cameras)]):
        line = current_camera(scene, index, pose, eye=eye)
        stream.at_stop(scene.stamps_ns[index], index)
        stream.log(
            "stop/camera",
            rr.LineStrips3D(
                [line],
                colors=[colours.of_stop(index) if used[index] else palette.LEFT_OUT.on_dark],
                radii=rr.Radius.ui_points(2.5),
            ),
        )
        stream.names("stop/camera/names", line[-1:], [name_of(index, is_used=used[index])])
    stream.hold()


def name_of(index: int, *, is_used: bool) -> str:
    """Return the name of the stop at the cursor."""
    return f"stop {index}" if is_used else f"stop {index}, not used"
