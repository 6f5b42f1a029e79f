"""How the stops came together: pairs, their iterations, the pose graph, before and after."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from tablemap.geometry import Pose2, transform
from tablemap.registration import Pair, PairIteration, Registration, StopScan
from tablemap.review import colours, text
from tablemap.review.clouds import raised
from tablemap.review.motion import log_trajectory
from tablemap.review.stream import FEW_STOPS, Stream

GRAPH_PIXELS_PER_METRE = 160.0
RESIDUAL_LIMIT = 0.02
PAIR_HEIGHT = 0.03
MANY_SHARE = 0.4


class Alignment:
    """Draws the registration; it collects a pair's iterations until the pair is complete."""

    def __init__(self) -> None:
        self._iterations: list[PairIteration] = []
        self._plotted: set[tuple[int, int]] = set()

    def log_iteration(self, stream: Stream, iteration: PairIteration) -> None:
        """Take one ICP iteration; a pair is plotted when the next one begins."""
        if self._iterations and (iteration.source, iteration.target) != _ends(self._iterations[0]):
            self._plot(stream)
        self._iterations.append(iteration)

    def log_pair(self, stream: Stream, pair: Pair) -> None:
        """Log a pair that was dropped, with its reason; `Registration` draws them all."""
        self._plot(stream)
        if not pair.used and stream.scene.stamps_ns:
            stream.hold()
            message = f"{pair.kind} pair {pair.source} to {pair.target} dropped: {pair.reason}"
            stream.log_flat("log", rr.TextLog(message, level="INFO"))

    def log_localised_stops(self, stream: Stream) -> None:
        """Draw the stops where the localisation has them: of a run that came no further."""
        stops = stream.scene.localised
        if "registration" not in stream.scene.reached and stops:
            stream.hold()
            _log_stops(stream, "registration/localised_stops", stops, (True,) * len(stops))

    def log_stop_scan(self, stream: Stream, scan: StopScan) -> None:
        """Log a stop's combined scan where the localisation has it."""
        poses = stream.scene.localised
        if scan.index < len(poses):
            stream.hold()
            _log_stop_scan(stream, "before", scan, poses[scan.index])

    def log_registration(self, stream: Stream, registration: Registration) -> None:
        """Log the pose graph, and the clouds and scans as localised and as registered."""
        self._plot(stream)
        scene = stream.scene
        poses = registration.map_from_base
        stream.hold()
        stream.text("registration/summary", text.registration(registration))
        log_trajectory(stream, "trajectory/registered", registration.trajectory, colours.REGISTERED)
        for scan in registration.stop_scans:
            if scan.index < len(scene.localised):
                _log_stop_scan(stream, "before", scan, scene.localised[scan.index])
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
        _log_pairs(stream, registration)
        _log_graph(stream, registration)
        _log_residuals(stream, registration)

    def _plot(self, stream: Stream) -> None:
        """Plot the collected pair on the timeline ``iteration``."""
        steps, self._iterations = self._iterations, []
        if not steps:
            return
        pair = _ends(steps[0])
        is_room = len(self._plotted) < stream.config.plotted_pairs
        if not (is_room or pair in self._plotted or stream.config.level == "full"):
            return
        self._plotted.add(pair)
        times = rr.TimeColumn("iteration", sequence=[step.iteration for step in steps])
        columns = {
            "fitness": [step.fitness for step in steps],
            "rmse_mm": [step.rmse * 1000 for step in steps],
            "inliers": [float(step.inliers) for step in steps],
        }
        for name, values in columns.items():
            path = f"registration/iterations/{name}/{pair[0]:02d}_to_{pair[1]:02d}"
            stream.rec.send_columns(
                path, indexes=[times], columns=rr.Scalars.columns(scalars=np.array(values))
            )


def _ends(step: PairIteration) -> tuple[int, int]:
    return step.source, step.target


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
    """Draw each stop's camera as a small pyramid with its number; grey where it was not used."""
    is_few = len(poses) <= FEW_STOPS
    strips, tints, labels = [], [], []
    for index, pose in enumerate(poses[: len(stream.scene.cameras)]):
        frustum = stream.scene.cameras[index][1]
        frustum = frustum[0] + (1.0 if is_few else MANY_SHARE) * (frustum - frustum[0])
        centre, *corners = transform(pose.lifted(), frustum)
        ring = [*corners, corners[0]]
        spokes = [point for corner in corners for point in (centre, corner)]
        strips.append(np.array([*ring, *spokes], dtype=np.float32))
        tints.append(colours.of_stop(index) if used[index] else colours.MUTED)
        labels.append(str(index) if used[index] else f"{index} (not used)")
    if strips:
        stream.log(
            path,
            rr.LineStrips3D(
                strips,
                colors=tints,
                radii=rr.Radius.ui_points(1.5 if is_few else 1.0),
                labels=labels,
                show_labels=is_few,
            ),
        )


def _log_pairs(stream: Stream, registration: Registration) -> None:
    groups: dict[tuple[str, bool], list[Pair]] = {}
    for pair in registration.pairs:
        groups.setdefault((pair.kind, pair.used), []).append(pair)
    poses = registration.map_from_base
    for (kind, used), pairs in groups.items():
        ends = [[poses[p.target].translation, poses[p.source].translation] for p in pairs]
        stream.log(
            f"registration/graph_in_map/{kind}_{'used' if used else 'dropped'}",
            rr.LineStrips3D(
                [raised(np.array(pair), PAIR_HEIGHT) for pair in ends],
                colors=[colours.USED if used else colours.DROPPED],
                radii=rr.Radius.ui_points(0.7),
                labels=[
                    f"{p.source} to {p.target}: rmse {1000 * p.rmse:.1f} mm"
                    if used
                    else f"{p.source} to {p.target}: {p.reason}"
                    for p in pairs
                ],
                show_labels=False,
            ),
        )
    if len(registration.graph_before) > 1:
        before = np.array([pose.translation for pose in registration.graph_before])
        stream.log(
            "registration/graph_before",
            rr.LineStrips3D(
                [raised(before, PAIR_HEIGHT)],
                colors=[colours.LOCALISED],
                radii=rr.Radius.ui_points(1.0),
            ),
        )


def _log_graph(stream: Stream, registration: Registration) -> None:
    """Draw stops as nodes coloured by what their pairs leave, and the used pairs as edges."""
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
    tints[~np.array(registration.used, dtype=bool)] = colours.MUTED
    stream.log_flat(
        "registration/graph",
        rr.GraphNodes(
            node_ids=[str(i) for i in range(len(places))],
            positions=places * np.array([1.0, -1.0]),
            colors=tints,
            labels=[
                f"stop {i}" if len(places) <= FEW_STOPS else str(i) for i in range(len(places))
            ],
            radii=[9.0] * len(places),
        ),
        rr.GraphEdges(
            edges=[(str(p.target), str(p.source)) for p in registration.pairs if p.used],
            graph_type="undirected",
        ),
    )


def _log_residuals(stream: Stream, registration: Registration) -> None:
    """Plot each stop's correction against the localisation, over the snapshots."""
    scene = stream.scene
    for index, pose in enumerate(registration.map_from_base[: len(scene.localised)]):
        step = scene.localised[index].inverse() @ pose
        stream.at(scene.stamps_ns[index], snapshot=index)
        stream.log_flat(
            "registration/correction_mm", rr.Scalars(1000 * float(np.hypot(step.x, step.y)))
        )
    stream.hold()
