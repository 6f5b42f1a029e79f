"""Drawings of the registration: pairs, the pose graph, before and after."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from tablemap import palette
from tablemap.geometry import Pose2, transform
from tablemap.review import colours, text
from tablemap.review.clouds import raised
from tablemap.review.current import camera_of_stop
from tablemap.review.eyes import stops_eye
from tablemap.review.matrix import log_matrix, tints, told
from tablemap.review.motion import log_correction, log_trajectory
from tablemap.review.numbering import from_one_place, numbered
from tablemap.review.pairs import PairDrawing
from tablemap.review.room import LOW, Room
from tablemap.review.scene import FEW_STOPS
from tablemap.review.stream import Stream
from tablemap.stages.registration import Pair, Registration, StopScan

WORST_PAIRS = 12  # that are always shown
MANY_SHARE = 0.4
BASE_ARROW = 0.25
FLOOR = 0.02


class Alignment:
    """Draws the registration; it stores the pairs' iterations until the pairs are judged."""

    def __init__(self) -> None:
        self.pairs = PairDrawing()
        self._registration: Registration | None = None

    def log_as_far_as_it_came(self, stream: Stream) -> None:
        """Draw the stops at their localised poses, for a run that ended before registration."""
        stops = stream.scene.localised
        if "registration" not in stream.scene.reached and stops:
            stream.hold()
            _log_stops(stream, "registration/localised_stops", stops, (True,) * len(stops))
            _log_names(stream, "registration/localised_stops", stops, (True,) * len(stops), ())
            self.pairs.log(stream, (), stops)

    def log_stop_scan(self, stream: Stream, scan: StopScan) -> None:
        """Log a stop's combined scan at its localised pose."""
        poses = stream.scene.localised
        if scan.index < len(poses):
            stream.hold()
            _log_stop_scan(stream, "before", scan, poses[scan.index])

    def log_registration(self, stream: Stream, registration: Registration) -> None:
        """Log the pose graph, and the clouds and scans as localised and as registered."""
        scene = stream.scene
        poses = registration.map_from_base
        stream.hold()
        stream.text("registration/summary", text.registration(registration))
        log_trajectory(
            stream, "trajectory/registered", registration.trajectory, palette.REGISTERED.on_dark
        )
        log_correction(stream, registration.trajectory)
        for scan in registration.stop_scans:
            _log_stop_scan(stream, "after", scan, poses[scan.index])
        for index, top in scene.tops.items():
            clutter = scene.clutter.get(index, top[:0])
            for moment, placed in (("before", scene.localised), ("after", poses)):
                for name, points in (("top", top), ("clutter", clutter)):
                    if len(points):
                        stream.log(
                            f"registration/{moment}/{name}/{index:02d}",
                            rr.Points3D(
                                placed[index].apply(points).astype(np.float32),
                                colors=[colours.of_stop(index)],
                                radii=rr.Radius.ui_points(1.5),
                            ),
                        )
        _log_stops(stream, "registration/stops", poses, registration.used)
        _log_stops(stream, "registration/localised_stops", scene.localised, registration.used)
        _log_bases(stream, registration)
        _log_way_of_cameras(stream, registration)
        _log_pairs(stream, registration)
        log_matrix(stream, registration)
        _log_residuals(stream, registration)
        _log_dropped(stream, registration)
        self._registration = registration
        self.log_names(stream)
        self.pairs.log(stream, text.worst_first(registration), poses)

    def log_names(self, stream: Stream) -> None:
        """Name the stops in both views of the registration, clear of what these show.

        Called again at the end, when the table's place is known, and with it the views' eye.
        """
        done, scene = self._registration, stream.scene
        if done is None:
            return
        stream.hold()
        scans = {scan.index: scan.points for scan in done.stop_scans}
        ends = _eyes(stream, done.map_from_base)
        shown = [p for p in done.pairs if scene.best in (p.source, p.target)]
        shown += text.worst_first(done)[:WORST_PAIRS]
        lines = [ends[[pair.target, pair.source]] for pair in shown]
        for path, poses, between in (
            ("registration/localised_stops", scene.localised, []),
            ("registration/stops", done.map_from_base, lines),
        ):
            drawn: list[NDArray[np.floating]] = [
                poses[index].apply(points)
                for cloud in (scene.tops, scene.clutter)
                for index, points in cloud.items()
            ]
            drawn += [
                raised(poses[index].apply(points), scene.laser_height)
                for index, points in scans.items()
            ]
            _log_names(stream, path, poses, done.used, drawn, lines=between)


def _log_stop_scan(stream: Stream, moment: str, scan: StopScan, pose: Pose2) -> None:
    stream.log(
        f"registration/{moment}/scan/{scan.index:02d}",
        rr.Points3D(
            raised(pose.apply(scan.points), stream.scene.laser_height),
            colors=[colours.of_stop(scan.index)],
            radii=rr.Radius.ui_points(1.5),
        ),
    )


def _log_stops(stream: Stream, path: str, poses: Sequence[Pose2], used: tuple[bool, ...]) -> None:
    """Draw each stop's camera as a small pyramid with its number, grey if it was not used."""
    is_few = len(poses) <= FEW_STOPS
    strips, colours_of, labels = [], [], []
    for index, pose in enumerate(poses[: len(stream.scene.cameras)]):
        share = 1.0 if is_few else MANY_SHARE
        strips.append(camera_of_stop(stream.scene, index, pose, share=share))
        colours_of.append(colours.of_stop(index) if used[index] else palette.LEFT_OUT.on_dark)
        labels.append(_name(index, is_used=used[index]))
    if strips:
        stream.log(
            path,
            rr.LineStrips3D(
                strips,
                colors=colours_of,
                radii=rr.Radius.ui_points(1.5 if is_few else 1.0),
                labels=labels,
                show_labels=False,
            ),
        )


def _log_names(
    stream: Stream,
    path: str,
    poses: Sequence[Pose2],
    used: Sequence[bool],
    drawn: Sequence[NDArray[np.floating]],
    *,
    lines: Sequence[NDArray[np.floating]] = (),
) -> None:
    """Name the stops beside their cameras, clear of points (n, 3) and lines, off the table."""
    scene = stream.scene
    is_few = len(poses) <= FEW_STOPS
    cameras = [camera_of_stop(scene, k, pose) for k, pose in enumerate(poses[: len(scene.cameras)])]
    if not cameras:
        return
    labels = [_name(k, is_used=used[k]) for k in range(len(cameras))]
    tips = np.array([line[-1] for line in cameras], dtype=np.float64)
    room = Room(stops_eye(scene), LOW)
    if is_few:
        room.take_points(np.concatenate([np.zeros((0, 3)), *drawn]))
    for line in (*cameras, *lines):
        room.take_line(line, width=5)
    centre = np.array(scene.centre or tips[:, :2].mean(axis=0))
    placed = room.names(labels, tips, away=tips[:, :2] - centre, shown=is_few)
    stream.names(f"{path}/names", placed.places, labels, shown=is_few, leaders=placed.leaders)


def _name(index: int, *, is_used: bool) -> str:
    return str(index) if is_used else f"{index} (not used)"


def _log_bases(stream: Stream, registration: Registration) -> None:
    """Draw the base at each stop as an arrow on the floor; a few stops also get their numbers."""
    poses = registration.map_from_base
    if not poses:
        return
    is_few = len(poses) <= FEW_STOPS
    ahead = [pose.rotate(np.array([BASE_ARROW, 0.0])) for pose in poses]
    labels = base_labels(poses)
    stream.log(
        "registration/bases",
        rr.Arrows3D(
            origins=raised(np.array([pose.translation for pose in poses]), FLOOR),
            vectors=raised(np.array(ahead), 0.0),
            colors=[
                colours.of_stop(i) if used else palette.LEFT_OUT.on_dark
                for i, used in enumerate(registration.used)
            ],
            radii=rr.Radius.ui_points(3.0 if is_few else 1.5),
            labels=labels,
            show_labels=False,
        ),
    )
    places = raised(np.array([pose.translation for pose in poses]), FLOOR)
    stream.names("registration/bases/names", places, labels, shown=is_few)


def _log_way_of_cameras(stream: Stream, registration: Registration) -> None:
    """Draw the way through the stops' cameras: that on the floor may lie under the table."""
    tips = _eyes(stream, registration.map_from_base[: len(stream.scene.cameras)])
    if len(tips) > 1:
        stream.log(
            "trajectory/cameras",
            rr.LineStrips3D(
                [tips], colors=[palette.REGISTERED.on_dark], radii=rr.Radius.ui_points(1.0)
            ),
        )


def base_labels(poses: Sequence[Pose2]) -> list[str]:
    """Return the numbers of the stops; one that shares its place with others stays without."""
    labels = [""] * len(poses)
    for views in from_one_place(poses):
        labels[views[0]] = numbered(views)
    return labels


def _log_pairs(stream: Stream, registration: Registration) -> None:
    groups: dict[tuple[str, bool], list[Pair]] = {}
    for pair in registration.pairs:
        groups.setdefault((pair.kind, pair.used), []).append(pair)
    eyes = _eyes(stream, registration.map_from_base)
    for (kind, used), pairs in groups.items():
        stream.log(
            f"registration/graph_in_map/{kind}_{'used' if used else 'dropped'}",
            rr.LineStrips3D(
                [eyes[[p.target, p.source]] for p in pairs],
                colors=tints(registration, pairs),
                radii=rr.Radius.ui_points(0.7),
                labels=[told(registration, pair) for pair in pairs],
                show_labels=False,
            ),
        )
    worst = text.worst_first(registration)[:WORST_PAIRS]
    if worst:
        stream.log("registration/graph_worst", _lines(registration, worst, eyes))
    for index, stamp in enumerate(stream.scene.stamps_ns):
        own = [p for p in registration.pairs if index in (p.source, p.target)]
        stream.at_stop(stamp, index)
        stream.log("registration/graph_at_stop", _lines(registration, own, eyes))
    stream.hold()
    if len(registration.graph_before) > 1:
        stream.log(
            "registration/graph_before",
            rr.LineStrips3D(
                [_eyes(stream, registration.graph_before)],
                colors=[palette.LOCALISED.on_dark],
                radii=rr.Radius.ui_points(1.0),
            ),
        )


def _lines(
    registration: Registration, pairs: list[Pair], eyes: NDArray[np.float32]
) -> rr.LineStrips3D:
    """Return the pairs as lines, by how well the registered poses agree with them."""
    return rr.LineStrips3D(
        [eyes[[p.target, p.source]] for p in pairs],
        colors=tints(registration, pairs),
        radii=rr.Radius.ui_points(1.0),
        labels=[told(registration, pair) for pair in pairs],
        show_labels=False,
    )


def _eyes(stream: Stream, poses: Sequence[Pose2]) -> NDArray[np.float32]:
    """Return (n, 3) the places of the stops' cameras, the tips of the pyramids; else the bases."""
    cameras = [frustum[0] for _, frustum in stream.scene.cameras]
    cameras += [np.zeros(3)] * (len(poses) - len(cameras))
    eyes = [transform(p.lifted(), eye) for p, eye in zip(poses, cameras, strict=False)]
    return np.array(eyes, dtype=np.float32).reshape(-1, 3)


def _log_dropped(stream: Stream, registration: Registration) -> None:
    """Log the dropped pairs and the reasons, at the time of their later stop."""
    stamps = stream.scene.stamps_ns
    dropped = [
        p for p in registration.pairs if not p.used and max(p.source, p.target) < len(stamps)
    ]
    for pair in sorted(dropped, key=lambda p: max(p.source, p.target)):
        later = max(pair.source, pair.target)
        stream.at(stamps[later], snapshot=later)
        message = f"{pair.kind} pair {pair.source} to {pair.target} dropped: {pair.reason}"
        stream.say(message)
    stream.hold()


def _log_residuals(stream: Stream, registration: Registration) -> None:
    """Plot each stop's correction against the localisation, over the snapshots."""
    scene = stream.scene
    stream.series("registration/correction_mm", palette.LOCALISED.on_dark)
    for index, pose in enumerate(registration.map_from_base[: len(scene.localised)]):
        step = scene.localised[index].inverse() @ pose
        stream.at(scene.stamps_ns[index], snapshot=index)
        stream.log_flat(
            "registration/correction_mm", rr.Scalars(1000 * float(np.hypot(step.x, step.y)))
        )
    stream.hold()
