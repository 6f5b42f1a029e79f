"""Drawings of the registration: pairs, their iterations, the pose graph, before and after."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from tablemap import palette
from tablemap.geometry import Floats, Pose2, transform
from tablemap.review import colours, text
from tablemap.review.clouds import raised
from tablemap.review.current import camera_of_stop
from tablemap.review.eyes import stops_eye
from tablemap.review.motion import log_correction, log_trajectory
from tablemap.review.pairs import Pairs
from tablemap.review.room import LOW, Room
from tablemap.review.stream import FEW_STOPS, DrawnScene, Stream
from tablemap.stages.registration import Pair, Registration, StopScan

GRAPH_PIXELS_PER_METRE = 160.0
RESIDUAL_LIMIT = 0.02
NAME_ASIDE = (0.0, 24.0)  # pixels
WORST_PAIRS = 12  # that are always shown
MANY_SHARE = 0.4
BASE_ARROW = 0.25
FLOOR = 0.02


class Alignment:
    """Draws the registration; it stores the pairs' iterations until the pairs are judged."""

    def __init__(self) -> None:
        self.pairs = Pairs()

    def log_as_far_as_it_came(self, stream: Stream) -> None:
        """Draw the stops at their localised poses, for a run that ended before registration."""
        stops = stream.scene.localised
        if "registration" not in stream.scene.reached and stops:
            stream.hold()
            _log_stops(stream, "registration/localised_stops", stops, (True,) * len(stops))
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
        _log_graph(stream, registration)
        _log_residuals(stream, registration)
        _log_dropped(stream, registration)
        self.pairs.log(stream, text.worst_first(registration), poses)


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
    strips, tints, labels = [], [], []
    for index, pose in enumerate(poses[: len(stream.scene.cameras)]):
        share = 1.0 if is_few else MANY_SHARE
        strips.append(camera_of_stop(stream.scene, index, pose, share=share))
        tints.append(colours.of_stop(index) if used[index] else palette.LEFT_OUT.on_dark)
        labels.append(str(index) if used[index] else f"{index} (not used)")
    if strips:
        stream.log(
            path,
            rr.LineStrips3D(
                strips,
                colors=tints,
                radii=rr.Radius.ui_points(1.5 if is_few else 1.0),
                labels=labels,
                show_labels=False,
            ),
        )
        places = _beside(stream.scene, strips, labels) if is_few else [one[-1] for one in strips]
        stream.names(f"{path}/names", places, labels, shown=is_few)


def _beside(
    scene: DrawnScene, cameras: Sequence[NDArray[np.float32]], labels: Sequence[str]
) -> list[Floats]:
    """Return where the stops' names are clear of their cameras, away from the table."""
    room = Room(stops_eye(scene), LOW)
    for line in cameras:
        room.take_line(line, width=5)
    tips = [line[-1].astype(np.float64) for line in cameras]
    centre = np.array(scene.centre or np.mean(tips, axis=0)[:2])
    return [
        room.place(label, tip, away=tip[:2] - centre)
        for label, tip in zip(labels, tips, strict=True)
    ]


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
    for views in text.from_one_place(poses):
        labels[views[0]] = text.numbered(views)
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
                colors=_tints(registration, pairs) if used else [palette.LEFT_OUT.on_dark],
                radii=rr.Radius.ui_points(0.7),
                labels=[_told(registration, pair) for pair in pairs],
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
    tints = _tints(registration, pairs)
    tints[[not pair.used for pair in pairs]] = palette.LEFT_OUT.on_dark
    return rr.LineStrips3D(
        [eyes[[p.target, p.source]] for p in pairs],
        colors=tints,
        radii=rr.Radius.ui_points(1.0),
        labels=[_told(registration, pair) for pair in pairs],
        show_labels=False,
    )


def _told(registration: Registration, pair: Pair) -> str:
    """Return what a pair's line says on hovering."""
    name = f"{pair.source} to {pair.target}, {pair.kind}"
    if not pair.used:
        return f"{name}: {pair.reason}"
    return f"{name}: off by {1000 * text.pair_residual(registration, pair):.1f} mm"


def _tints(registration: Registration, pairs: list[Pair]) -> NDArray[np.uint8]:
    """Return the pairs' colours (n, 3), by their residuals at the registered poses."""
    residuals = [text.pair_residual(registration, pair) for pair in pairs]
    return colours.severity(np.array(residuals), RESIDUAL_LIMIT)


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
        stream.log_flat("log", rr.TextLog(message, level="INFO"))
    stream.hold()


def _log_graph(stream: Stream, registration: Registration) -> None:
    """Draw stops as nodes coloured by their pairs' residuals, and the used pairs as edges."""
    if not registration.map_from_base:
        return
    places = np.array([pose.translation for pose in registration.map_from_base])
    places = (places - places.mean(axis=0)) * GRAPH_PIXELS_PER_METRE
    left: dict[int, list[float]] = {}
    for pair in registration.pairs:
        if pair.used:
            for index in (pair.source, pair.target):
                left.setdefault(index, []).append(text.pair_residual(registration, pair))
    mean = [float(np.mean(left.get(i, [np.nan]))) for i in range(len(places))]
    tints = colours.severity(np.array(mean), RESIDUAL_LIMIT)
    tints[~np.array(registration.used, dtype=bool)] = palette.LEFT_OUT.on_dark
    stream.log_flat(
        "registration/graph",
        rr.GraphNodes(
            node_ids=[str(i) for i in range(len(places))],
            positions=places * np.array([1.0, -1.0]),
            colors=tints,
            radii=[9.0] * len(places),
            show_labels=False,
        ),
        rr.GraphEdges(
            edges=[(str(p.target), str(p.source)) for p in registration.pairs if p.used],
            graph_type="undirected",
        ),
    )
    named = list(range(0, len(places), -(-len(places) // FEW_STOPS)))
    # A node without a colour has its label in the theme's colour of text.
    stream.log_flat(
        "registration/graph/names",
        rr.GraphNodes(
            node_ids=[f"stop {i}" for i in named],
            positions=(places[named] + NAME_ASIDE) * np.array([1.0, -1.0]),
            labels=[str(i) for i in named],
            show_labels=True,
        ),
    )


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
