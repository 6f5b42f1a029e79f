"""The stops' names in the first view, once the models are there: clear of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tablemap.events import OtherTable
from tablemap.geometry import Floats, Pose2
from tablemap.model import TableModel
from tablemap.review.alignment import BASE_ARROW, FLOOR, MANY_SHARE, base_labels
from tablemap.review.clouds import closed, middles, raised
from tablemap.review.current import camera_of_stop, current_camera, name_of
from tablemap.review.eyes import overview_eye
from tablemap.review.motion import TRAJECTORY_HEIGHT
from tablemap.review.room import Room
from tablemap.review.scene import FEW_STOPS
from tablemap.review.solid import take_model
from tablemap.review.stream import Stream
from tablemap.review.tables import entity
from tablemap.review.top import TOUCHES
from tablemap.stages.odometry import Trajectory
from tablemap.stages.registration import Registration, StopScan
from tablemap.stages.surface import Surface


class Naming:
    """Writes the names again as each model comes; before that they stand at their stops."""

    def __init__(self) -> None:
        self._poses: tuple[Pose2, ...] = ()
        self._used: tuple[bool, ...] = ()
        self._way: Trajectory | None = None
        self._scans: tuple[StopScan, ...] = ()
        self._room: Room | None = None
        self._tables: list[OtherTable] = []
        self._touching: Floats | None = None

    def take_registration(self, registration: Registration) -> None:
        """Take the registered stops and the way between them."""
        self._poses, self._used = registration.map_from_base, registration.used
        self._way, self._scans = registration.trajectory, registration.stop_scans

    def take_surface(self, surface: Surface) -> None:
        """Take what touches the table at its height."""
        self._touching = surface.beside

    def lines(self, stream: Stream) -> list[NDArray[np.floating]]:
        """Return what the first view shows beside the table, as lines (n, 3) in the map."""
        touching = self._touching
        near = [] if touching is None else [closed(touching, stream.scene.height)]
        return [*near, *self._ways(stream)]

    def _ways(self, stream: Stream) -> list[NDArray[np.floating]]:
        """Return stops and the way between them as lines (n, 3)."""
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

    def points(self, stream: Stream) -> NDArray[np.floating]:
        """Return the points (n, 3) in the map that the first view shows: scans and clutter."""
        scene, poses = stream.scene, self._poses
        found: list[NDArray[np.floating]] = [
            raised(poses[scan.index].apply(scan.points), scene.laser_height) for scan in self._scans
        ]
        if len(poses) <= FEW_STOPS:
            found += [poses[k].apply(cloud) for k, cloud in scene.clutter.items() if k < len(poses)]
        return np.concatenate([np.zeros((0, 3)), *found])

    def log_beside(self, stream: Stream, room: Room) -> None:
        """Log the names where the picture of the first view has room."""
        self._room = room
        self._log(stream)

    def log_found(self, stream: Stream, texts: list[str], hulls: list[NDArray[np.float32]]) -> None:
        """Name the surfaces that were found, and the stops, in the first view of a failed run."""
        room = Room(overview_eye(stream.scene))
        room.take_points(self.points(stream))
        for line in (*hulls, *self.lines(stream)):
            room.take_line(line)
        towards = np.subtract(room.eye.position, room.eye.target)[:2]
        placed = room.names(texts, middles(hulls), away=towards)
        stream.hold()
        stream.names("story/found/names", placed.places, texts, leaders=placed.leaders)
        self.log_beside(stream, room)

    def log_other(self, stream: Stream, other: OtherTable) -> None:
        """Name another table, and log the stops' names again, clear of its model too."""
        if isinstance(other.outcome, TableModel) and self._room is not None:
            take_model(self._room, other.outcome)
            self._tables.append(other)
            self._log(stream)

    def _log(self, stream: Stream) -> None:
        if self._room is None or not self._poses:
            return
        room = self._room.copy()
        stream.hold()
        first = stream.scene.best
        if first is not None and first < min(len(self._poses), len(stream.scene.cameras)):
            room.take_line(
                current_camera(stream.scene, first, self._poses[first], eye=room.eye), width=5
            )
        self._log_touching(stream, room)
        self._log_tables(stream, room)
        if len(self._poses) <= FEW_STOPS:
            self._log_bases(stream, room)
        self._log_cameras(stream, room)
        stream.hold()

    def _log_touching(self, stream: Stream, room: Room) -> None:
        """Log the name of what touches the table, which the first view shows as a line."""
        if self._touching is None or not stream.scene.is_modelled:
            return
        line = closed(self._touching, stream.scene.height)
        away = line[:, :2].mean(axis=0) - np.array(stream.scene.centre or (0.0, 0.0))
        placed = room.names([TOUCHES], line[:-1].mean(axis=0)[None], away=away)
        stream.names("model/beside/names", placed.places, [TOUCHES], leaders=placed.leaders)

    def _log_tables(self, stream: Stream, room: Room) -> None:
        """Log the name of each table beside the chosen one: its number, as in its tab."""
        towards = np.subtract(room.eye.position, room.eye.target)[:2]
        for other in self._tables:
            model = other.outcome
            if not isinstance(model, TableModel):
                continue
            name = f"table {other.number:02d}"
            middle = (
                model.surface.pose.x,
                model.surface.pose.y,
                model.floor_z + model.surface.height.value,
            )
            placed = room.names([name], np.array([middle]), away=towards)
            path = f"{entity(other.number)}/name"
            stream.names(path, placed.places, [name], leaders=placed.leaders)

    def _log_bases(self, stream: Stream, room: Room) -> None:
        centre = np.array(stream.scene.centre or (0.0, 0.0))
        feet = raised(np.array([pose.translation for pose in self._poses]), FLOOR)
        labels = base_labels(self._poses)
        placed = room.names(labels, feet.astype(np.float64), away=feet[:, :2] - centre)
        stream.names("registration/bases/names", placed.places, labels, leaders=placed.leaders)

    def _log_cameras(self, stream: Stream, room: Room) -> None:
        """Log the name of each stop's camera, of which a viewer shows one at a time."""
        scene = stream.scene
        centre = np.array(scene.centre or (0.0, 0.0))
        stops = zip(scene.stamps_ns, self._poses, self._used, strict=False)
        for index, (stamp, pose, is_used) in enumerate(stops):
            line = current_camera(scene, index, pose, eye=room.eye)
            beside = room.copy()
            beside.take_line(line, width=6)
            name = name_of(index, is_used=is_used)
            tip = line[-1].astype(np.float64)
            place = beside.place(name, tip, away=tip[:2] - centre)
            stream.at_stop(stamp, index)
            stream.names("stop/camera/names", [place], [name])
