"""Pairs of stops as ICP aligned them: clouds that move along the timeline ``iteration``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from tablemap import palette
from tablemap.geometry import Floats, Pose2
from tablemap.review.room import Eye, Room
from tablemap.review.stream import Stream
from tablemap.stages.registration import Pair, PairIteration, PairStarted

FRAME = "pairs"
"""The frame in which the pairs lie side by side; it is no place in the map."""
LEAST_REACH, MOST_REACH = 1.0, 3.5  # metres round the table
GAP = 1.15  # of a cell's size
FEW_PAIRS = 30
"""Up to this number of pairs there is room for the RMSE beside a pair's name."""
WIDER = 1.15  # columns over rows
MOST_POINTS = 360  # of each of a pair's two clouds: a cell has room for so many
MOST_JUDGED = 500  # of each cloud of the pair that is shown alone
ROOM_SHARE = 85  # per cent of the targets' points that the view of a single pair shows
LEAST_ROOM, MOST_ROOM = 1.0, 10.0  # metres round the table in that view
STEEP = 4.0  # rise of its eye for each metre that it stands back
BACK = 2.1  # distance of its eye, in what it shows
SEEN_SHARE = 60  # per cent of the points that must fit in a cell

Key = tuple[int, int]


@dataclass(eq=False)
class _Sequence:
    source: Floats
    target: Floats
    poses: list[Pose2] = field(default_factory=list)
    figures: list[tuple[int, float, float, int]] = field(default_factory=list)


class PairDrawing:
    """Stores the motion of each pair until the pairs are judged, and then draws them.

    The memory grows with the pairs, whose number the snapshots bound. The clouds are those of the
    registration, not copies. If a pair is aligned again, its sequence goes on.
    """

    def __init__(self) -> None:
        self._sequences: dict[Key, _Sequence] = {}

    def start(self, _: Stream, started: PairStarted) -> None:
        """Store the start of a pair, and its clouds."""
        sequence = self._sequences.setdefault(
            (started.source, started.target),
            _Sequence(started.source_points, started.target_points),
        )
        sequence.poses.append(started.target_from_source)

    def step(self, _: Stream, iteration: PairIteration) -> None:
        """Store one iteration of a pair that was started."""
        sequence = self._sequences[iteration.source, iteration.target]
        figures = (iteration.fitness, iteration.rmse, iteration.inliers)
        sequence.figures.append((len(sequence.poses), *figures))
        sequence.poses.append(iteration.target_from_source)

    def log(self, stream: Stream, pairs: Sequence[Pair], poses: Sequence[Pose2]) -> None:
        """Plot the pairs in this order, and draw their clouds up to the allowed number.

        ``poses`` are the stops' in the map: each pair is drawn in the orientation of its target.
        Pairs that are not in ``pairs`` (in a run that failed) come last.
        """
        named = {(p.source, p.target): p for p in pairs if p.kind != "odometry"}
        keys = [key for key in named if key in self._sequences]
        keys += [key for key in self._sequences if key not in named]
        config = stream.config
        plotted = keys if config.level == "full" else keys[: config.plotted_pairs]
        _plot(
            stream, [key for key in plotted if self._sequences[key].figures], named, self._sequences
        )
        _log_at_stops(stream, keys, named, self._sequences, poses)
        shown = [key for key in keys[: config.aligned_pairs] if max(key) < len(poses)]
        if shown:
            stream.text("registration/pairs/summary", aligned(len(shown), len(keys)))
            self._lay_out(stream, shown, named, poses)
        self._sequences = {}

    def _lay_out(
        self, stream: Stream, keys: list[Key], named: dict[Key, Pair], poses: Sequence[Pose2]
    ) -> None:
        middle = np.array(stream.scene.centre or np.mean([p.translation for p in poses], axis=0))
        reach = self._reach(keys, poses, middle)
        columns = int(np.ceil(np.sqrt(WIDER * len(keys))))
        rows = -(-len(keys) // columns)
        pitch = 2 * reach * GAP
        stream.scene.pairs_reach = pitch * max(columns / WIDER, rows) / 2
        places, labels = [], []
        for number, key in enumerate(keys):
            row, column = divmod(number, columns)
            cell = np.array([column - (columns - 1) / 2, (rows - 1) / 2 - row]) * pitch
            cell_from_map = Pose2(float(cell[0] - middle[0]), float(cell[1] - middle[1]))
            pair, tint = named.get(key), _tint(named.get(key))
            sequence = self._sequences[key]
            _log_clouds(stream, key, sequence, cell_from_map @ poses[key[1]], cell, reach, tint)
            places.append((cell[0], cell[1] - reach, 0.0))
            rmse = f": rmse {1000 * pair.rmse:.1f} mm" if pair and len(keys) <= FEW_PAIRS else ""
            labels.append(f"{key[0]} to {key[1]}{rmse}")
        stream.names("registration/pairs/names", places, labels, frame=FRAME)

    def _reach(self, keys: list[Key], poses: Sequence[Pose2], middle: Floats) -> float:
        """Return the radius round the table that holds most of the pairs' points, with limits."""
        away = [
            np.linalg.norm(
                poses[target].apply(self._sequences[source, target].target[:, :2]) - middle, axis=1
            )
            for source, target in keys
        ]
        most = float(np.percentile(np.concatenate(away), SEEN_SHARE))
        return float(np.clip(most, LEAST_REACH, MOST_REACH))


def _log_at_stops(
    stream: Stream,
    keys: list[Key],
    named: dict[Key, Pair],
    sequences: dict[Key, _Sequence],
    poses: Sequence[Pose2],
) -> None:
    """Log for each stop the worst of its pairs, in the map, and over the iterations the worst."""
    known = [key for key in keys if max(key) < len(poses)]
    if not known:
        return
    eye = _eye_of_pair(stream, [poses[key[1]].apply(sequences[key].target) for key in known])
    stream.scene.pair_eye = eye.position, eye.target
    for index, stamp in enumerate(stream.scene.stamps_ns[: len(poses)]):
        key = next((one for one in known if index in one), None)
        stream.at_stop(stamp, index)
        if key is None:
            _empty_pair(stream)
        else:
            sequence = sequences[key]
            _log_pair(stream, eye, key, sequence, named.get(key), poses[key[1]], sequence.poses[-1])
    for key in known[:1]:
        first, *others = sequences[key].poses
        stream.at_iteration(0)
        _log_pair(stream, eye, key, sequences[key], named.get(key), poses[key[1]], first)
        for step, pose in enumerate(others, start=1):
            stream.at_iteration(step)
            moved = poses[key[1]] @ pose
            _log_cloud(stream, "after", moved.apply(sequences[key].source), _tint(named.get(key)))
    stream.hold()


def _eye_of_pair(stream: Stream, targets: list[Floats]) -> Eye:
    """Return an eye above the table from which most of the targets' points (n, 3) are seen."""
    scene = stream.scene
    points = np.concatenate(targets)
    centre = np.array(scene.centre or points[:, :2].mean(axis=0))
    away = np.percentile(np.linalg.norm(points[:, :2] - centre, axis=1), ROOM_SHARE)
    back = BACK * float(np.clip(away, LEAST_ROOM, MOST_ROOM)) / math.hypot(1.0, STEEP)
    target = (float(centre[0]), float(centre[1]), scene.height)
    return Eye((target[0], target[1] - back, target[2] + STEEP * back), target)


def _log_pair(
    stream: Stream,
    eye: Eye,
    key: Key,
    sequence: _Sequence,
    pair: Pair | None,
    map_from_target: Pose2,
    target_from_source: Pose2,
) -> None:
    """Log a pair in the map: its target, and its source where ICP began and where it is."""
    begun, moved = (map_from_target @ one for one in (sequence.poses[0], target_from_source))
    target = map_from_target.apply(sequence.target)
    room = Room(eye)
    for entity, points, tint in (
        ("target", target, palette.TEXT.on_dark),
        ("before", begun.apply(sequence.source), palette.LOCALISED.on_dark),
        ("after", moved.apply(sequence.source), _tint(pair)),
    ):
        room.take_points(_log_cloud(stream, entity, points, tint))
    name = pair_told(key, pair)
    place = room.place(name, np.array(eye.target), away=np.array([0.0, -1.0]))
    stream.names("registration/pair_at_stop/names", [place], [name])


def _log_cloud(
    stream: Stream, entity: str, points: Floats, tint: palette.Colour
) -> NDArray[np.float32]:
    """Log one of a pair's clouds (n, 3) in the map; return the points that are drawn."""
    few = points[:: max(1, -(-len(points) // MOST_JUDGED))].astype(np.float32)
    stream.log(
        f"registration/pair_at_stop/{entity}",
        rr.Points3D(few, colors=[tint], radii=rr.Radius.ui_points(2.0)),
    )
    return few


def _empty_pair(stream: Stream) -> None:
    for entity in ("target", "before", "after"):
        stream.log(f"registration/pair_at_stop/{entity}", rr.Points3D([]))
    stream.names("registration/pair_at_stop/names", [], [])


def _log_clouds(
    stream: Stream,
    key: Key,
    sequence: _Sequence,
    cell_from_target: Pose2,
    cell: Floats,
    reach: float,
    tint: palette.Colour,
) -> None:
    """Log the target, the source, and the source's motion over the iterations and its end."""
    path = f"registration/pairs/{_name(key)}"
    moved = [cell_from_target @ pose for pose in sequence.poses]
    target = cell_from_target.apply(sequence.target)
    ended = moved[-1].apply(sequence.source)
    source = sequence.source[np.linalg.norm(ended[:, :2] - cell, axis=1) < reach]
    clouds = (
        ("target", target[np.linalg.norm(target[:, :2] - cell, axis=1) < reach], FRAME),
        ("source", source, f"pair {_name(key)}"),
    )
    for name, points, frame in clouds:
        stream.log(
            f"{path}/{name}",
            rr.Points3D(
                points[:: max(1, -(-len(points) // MOST_POINTS))].astype(np.float32),
                colors=[palette.TEXT.on_dark if name == "target" else tint],
                radii=rr.Radius.ui_points(1.5),
            ),
            frame=frame,
        )
    frames = np.stack([pose.lifted() for pose in moved])
    steps = rr.TimeColumn("iteration", sequence=range(len(frames)))
    stream.transforms(f"{path}/motion", FRAME, clouds[1][2], steps, frames)
    # Other timelines show the end of the pair: `hold` would also write it at iteration 0.
    stream.at(stream.scene.start_ns, snapshot=0)
    stream.transform(f"{path}/motion", FRAME, clouds[1][2], frames[-1])
    stream.hold()


def _tint(pair: Pair | None) -> palette.Colour:
    """Return the colour of a pair's source: red where the pair was dropped."""
    is_dropped = pair is not None and not pair.used
    return (palette.DISTRUSTED if is_dropped else palette.TRUSTED).on_dark


def _plot(
    stream: Stream, keys: list[Key], named: dict[Key, Pair], sequences: dict[Key, _Sequence]
) -> None:
    """Plot the figures of the iterations, a line for each pair."""
    if not keys:
        return
    steps = np.unique([figures[0] for key in keys for figures in sequences[key].figures])
    values = np.full((3, len(steps), len(keys)), np.nan)
    for column, key in enumerate(keys):
        its, *figures = zip(*sequences[key].figures, strict=True)
        values[:, np.searchsorted(steps, its), column] = figures
    fitness, rmse, inliers = values
    for name, shown in (("fitness", fitness), ("rmse_mm", 1000 * rmse), ("inliers", inliers)):
        stream.plots(
            f"registration/iterations/{name}",
            rr.TimeColumn("iteration", sequence=steps),
            shown,
            colours=[_tint(named.get(key)) for key in keys],
            names=[_name(key) for key in keys],
        )


def _name(key: Key) -> str:
    return f"{key[0]:02d}_to_{key[1]:02d}"


def aligned(shown: int, pairs: int) -> str:
    """Return the explanation of the view of aligned pairs."""
    return (
        "*Worst pair of the stop*: of the snapshot at the cursor, in the "
        "map; on the timeline `iteration` the worst of all. *All pairs*: "
        f"{shown} of {pairs} pairs, the dropped and the worst first, each in a cell of its own and "
        "lying as its target does in the map; beside few names stands the RMSE. On the timeline "
        "`iteration` the sources move from where ICP began (0) to where it ended; on the others "
        "they are as they ended."
    )


def pair_told(key: tuple[int, int], pair: Pair | None) -> str:
    """Return the name of the pair that is shown alone."""
    name = f"{key[0]} to {key[1]}"
    if pair is None:
        return name
    return f"{name}: rmse {1000 * pair.rmse:.1f} mm" + ("" if pair.used else f", {pair.reason}")
