"""The base's trajectories: recorded, by odometry, and registered; and KISS-ICP's map."""

from __future__ import annotations

import numpy as np
import rerun as rr

from tablemap import palette
from tablemap.config import ReviewConfig
from tablemap.geometry import Floats, Pose2
from tablemap.review import colours, text
from tablemap.review.clouds import raised, thinned
from tablemap.review.stream import Stream, sensor_times
from tablemap.stages.odometry import Odometry, OdometryMap, OdometryScan, Trajectory

TRAJECTORY_HEIGHT = 0.02
MOST_PIECES = 200
CORRECTION_LIMIT = 0.05  # metres
MAP_CELLS = 2


class ScansInTime:
    """Tells which scans are drawn: some in a second, or all at level ``full``."""

    def __init__(self, config: ReviewConfig) -> None:
        self._between_ns = 0 if config.level == "full" else int(config.scan_seconds * 1e9)
        self._last_ns: int | None = None

    def is_next(self, scan: OdometryScan) -> bool:
        """Tell whether a scan is drawn; call it once with each."""
        if self._last_ns is not None and scan.stamp_ns - self._last_ns < self._between_ns:
            return False
        self._last_ns = scan.stamp_ns
        return True


class MotionDrawing:
    """Draws the odometry; it thins its scans over sensor time."""

    def __init__(self) -> None:
        self._drawn: ScansInTime | None = None
        self._scans: list[tuple[int, float, float]] = []

    def log_scan(self, stream: Stream, scan: OdometryScan) -> None:
        """Log a scan at its pose by KISS-ICP; its threshold and correction are plotted later."""
        stream.scene.has_laser = True
        self._scans.append((scan.stamp_ns, scan.threshold, scan.correction))
        self._drawn = self._drawn or ScansInTime(stream.config)
        if not self._drawn.is_next(scan):
            return
        stream.at(scan.stamp_ns, snapshot=stream.scene.snapshot_at(scan.stamp_ns))
        stream.log(
            "odometry/scan",
            rr.Points3D(
                raised(scan.points, stream.scene.laser_height),
                colors=[palette.LASER.on_dark],
                radii=rr.Radius.ui_points(1.5),
            ),
        )

    def log_map(self, stream: Stream, local: OdometryMap) -> None:
        """Log KISS-ICP's map at that time, thinned."""
        stream.at(local.stamp_ns, snapshot=stream.scene.snapshot_at(local.stamp_ns))
        points = thinned(local.points, MAP_CELLS * stream.config.voxel)
        stream.log(
            "odometry/local_map",
            rr.Points3D(
                raised(points, stream.scene.laser_height),
                colors=[palette.LEFT_OUT.on_dark],
                radii=rr.Radius.ui_points(1.5),
            ),
        )

    def log_odometry(self, stream: Stream, odometry: Odometry) -> None:
        """Log the recorded and the estimated trajectories."""
        stream.hold()
        stream.scene.localised_way = odometry.localised
        stream.text("odometry/summary", text.odometry(odometry, stream.scene.recorded_warnings))
        log_trajectory(
            stream, "trajectory/localised", odometry.localised, palette.LOCALISED.on_dark
        )
        log_trajectory(stream, "trajectory/odometry", odometry.trajectory, palette.LASER.on_dark)
        if odometry.wheels is not None and len(odometry.wheels.poses):
            start = Pose2.from_array(odometry.localised.poses[0])
            moved = start @ Pose2.from_array(odometry.wheels.poses[0]).inverse()
            in_map = moved.apply(odometry.wheels.poses[:, :2])
            _log_path(stream, "trajectory/wheels", in_map, palette.WHEELS.on_dark)
        if self._scans:
            stamps, thresholds, corrections = zip(*self._scans, strict=True)
            times = sensor_times(stamps)
            for name, metres, ink in (
                ("threshold_mm", thresholds, palette.TEXT),
                ("correction_mm", corrections, palette.LASER),
            ):
                stream.plot(f"odometry/{name}", times, 1000 * np.array(metres), ink.on_dark)
            self._scans = []


def log_trajectory(
    stream: Stream, path: str, trajectory: Trajectory, colour: palette.Colour
) -> None:
    """Log a trajectory in the map as one line, named after its entity."""
    if len(trajectory.poses):
        _log_path(stream, path, trajectory.poses[:, :2], colour)


def log_correction(stream: Stream, trajectory: Trajectory) -> None:
    """Log the registered way in pieces, by how far the localisation had it from there."""
    localised = stream.scene.localised_way
    if localised is None or len(localised.poses) == 0 or len(trajectory.poses) < 2:
        return
    stamps = trajectory.stamps_ns - localised.stamps_ns[0]
    known = localised.stamps_ns - localised.stamps_ns[0]
    had = [np.interp(stamps, known, localised.poses[:, k]) for k in (0, 1)]
    off = np.linalg.norm(trajectory.poses[:, :2] - np.column_stack(had), axis=1)
    places = raised(trajectory.poses[:, :2], TRAJECTORY_HEIGHT)
    step = max(1, -(-len(places) // MOST_PIECES))
    starts = range(0, len(places) - 1, step)
    stream.log(
        "trajectory/correction",
        rr.LineStrips3D(
            [places[k : k + step + 1] for k in starts],
            colors=colours.severity(
                np.array([off[k : k + step + 1].mean() for k in starts]), CORRECTION_LIMIT
            ),
            radii=rr.Radius.ui_points(2.5),
        ),
    )


def _log_path(stream: Stream, path: str, places: Floats, colour: palette.Colour) -> None:
    stream.log(
        path,
        rr.LineStrips3D(
            [raised(places, TRAJECTORY_HEIGHT)],
            colors=[colour],
            radii=rr.Radius.ui_points(1.5),
            labels=[path.rsplit("/", 1)[-1]],
            show_labels=False,
        ),
    )
