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
from tablemap.review.stream import Stream
from tablemap.stages.registration import Registration

LARGER = 1.8  # than the other stops' cameras


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
    for index, (pose, (_, frustum)) in enumerate(zip(poses, scene.cameras, strict=False)):
        larger = frustum[0] + LARGER * (frustum - frustum[0])
        centre, *corners = transform(pose.lifted(), larger)
        spokes = [point for corner in corners for point in (centre, corner)]
        stream.at_stop(scene.stamps_ns[index], index)
        stream.log(
            "stop/camera",
            rr.LineStrips3D(
                [np.array([*corners, corners[0], *spokes], dtype=np.float32)],
                colors=[colours.of_stop(index) if used[index] else palette.LEFT_OUT.on_dark],
                radii=rr.Radius.ui_points(3.0),
            ),
        )
        name = f"stop {index}" if used[index] else f"stop {index}, not used"
        stream.names("stop/camera/names", [centre], [name])
    stream.hold()
