"""The stops' names in the first view, once the models are there: clear of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tablemap.events import OtherTable
from tablemap.geometry import Pose2
from tablemap.model import TableModel
from tablemap.review.alignment import BASE_ARROW, FLOOR, MANY_SHARE, base_labels
from tablemap.review.clouds import raised
from tablemap.review.current import LARGER, camera_of_stop, name_of
from tablemap.review.motion import TRAJECTORY_HEIGHT
from tablemap.review.room import Room
from tablemap.review.solid import take_model
from tablemap.review.stream import FEW_STOPS, Stream
from tablemap.stages.odometry import Trajectory
from tablemap.stages.registration import Registration


class Naming:
    """Writes the names again as each model comes; before that they stand at their stops."""

    def __init__(self) -> None:
        self._poses: tuple[Pose2, ...] = ()
        self._used: tuple[bool, ...] = ()
        self._way: Trajectory | None = None
        self._room: Room | None = None

    def take_registration(self, registration: Registration) -> None:
        """Take the registered stops and the way between them."""
        self._poses, self._used = registration.map_from_base, registration.used
        self._way = registration.trajectory

    def lines(self, stream: Stream) -> list[NDArray[np.floating]]:
        """Return what the first view shows of stops and way, as lines (n, 3) in the map."""
        poses = np.array([pose.translation for pose in self._poses]).reshape(-1, 2)
        if len(poses) > FEW_STOPS:
            found = [
                camera_of_stop(stream.scene, k, pose, share=MANY_SHARE)
                for k, pose in enumerate(self._poses[: len(stream.scene.cameras)])
            ]
            return [*found, np.array([line[-1] for line in found])]
        tips = [pose.apply(np.array([BASE_ARROW, 0.0])) for pose in self._poses]
        arrows = [raised(np.array(ends), FLOOR) for ends in zip(poses, tips, strict=True)]
        ways = [self._way.poses[:, :2]] if self._way is not None else []
        return [*arrows, *[raised(way, TRAJECTORY_HEIGHT) for way in ways if len(way) > 1]]

    def log_beside(self, stream: Stream, room: Room) -> None:
        """Log the names where the picture of the first view has room."""
        self._room = room
        self._log(stream)

    def log_other(self, stream: Stream, other: OtherTable) -> None:
        """Log them again, clear of another table's model too."""
        if isinstance(other.outcome, TableModel) and self._room is not None:
            take_model(self._room, other.outcome)
            self._log(stream)

    def _log(self, stream: Stream) -> None:
        if self._room is None or not self._poses:
            return
        room = self._room.copy()
        stream.hold()
        if len(self._poses) <= FEW_STOPS:
            self._log_bases(stream, room)
        self._log_cameras(stream, room)
        stream.hold()

    def _log_bases(self, stream: Stream, room: Room) -> None:
        centre = np.array(stream.scene.centre or (0.0, 0.0))
        feet = raised(np.array([pose.translation for pose in self._poses]), FLOOR)
        labels = base_labels(self._poses)
        places = [
            room.place(label, foot.astype(np.float64), away=foot[:2] - centre, keeps=bool(label))
            for label, foot in zip(labels, feet, strict=True)
        ]
        stream.names("registration/bases/names", places, labels)

    def _log_cameras(self, stream: Stream, room: Room) -> None:
        """Log the name of each stop's camera, of which a viewer shows one at a time."""
        scene = stream.scene
        centre = np.array(scene.centre or (0.0, 0.0))
        stops = zip(scene.stamps_ns, self._poses, self._used, strict=False)
        for index, (stamp, pose, is_used) in enumerate(stops):
            line = camera_of_stop(scene, index, pose, share=LARGER)
            beside = room.copy()
            beside.take_line(line, width=6)
            name = name_of(index, is_used=is_used)
            tip = line[-1].astype(np.float64)
            place = beside.place(name, tip, away=tip[:2] - centre)
            stream.at_stop(stamp, index)
            stream.names("stop/camera/names", [place], [name])
