"""Drawings of the calibrated camera, the segmented views and the candidate tables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from tablemap import palette
from tablemap.geometry import Bools, Floats, transform
from tablemap.masks import shrunk
from tablemap.review import colours, text
from tablemap.review.clouds import closed, middles, raised, thinned
from tablemap.review.eyes import views_eye
from tablemap.review.room import LOW, Room
from tablemap.review.scene import DrawnScene
from tablemap.review.stream import Stream
from tablemap.stages.calibration import Calibration
from tablemap.stages.registration import StopScan
from tablemap.stages.segmentation import (
    Label,
    Segmentation,
    TableCandidate,
    TableRefused,
    TablesFound,
    ViewSegmentation,
)
from tablemap.stages.snapshots import Snapshot, Snapshots

SHOWN_WIDTH = 640
CLOUD_WIDTH = 110
INSIDE_CELLS, INSIDE_PX = 5, 4  # a cell inside the top is wider than so many pixels
MOST_IN_SIGHT = 4
COARSE = 0.04  # metres between the points that names in the view have to stand clear of
CELL_PX = 4  # of so many metres, at the usual distance of the eye
FEW_CANDIDATES = 3  # up to here their labels have room for reasons
RESIDUAL_RANGE_M = 0.015
BLOCK_PX = 20
NOT_SEEN = 70  # grey, darker than all of the scale


class Perception:
    """Draws segmentations; it stores the corrected snapshots to which the labels belong."""

    def __init__(self) -> None:
        self._snapshots: tuple[Snapshot, ...] = ()
        self._found: tuple[TableCandidate, ...] = ()
        self._seen: dict[int, NDArray[np.float32]] = {}

    def take_snapshots(self, taken: Snapshots) -> None:
        """Take the snapshots as recorded, until they are corrected."""
        self._snapshots = taken.snapshots

    def take_scans(self, stream: Stream, scans: Sequence[StopScan]) -> None:
        """Take what the laser saw from the stops: names in the views stand clear of it too."""
        scene = stream.scene
        for scan in scans:
            if scan.index in self._seen:
                points = scene.localised[scan.index].apply(scan.points)
                drawn = raised(points, scene.laser_height)
                self._seen[scan.index] = np.concatenate([self._seen[scan.index], drawn])

    def log_calibration(self, stream: Stream, calibration: Calibration) -> None:
        """Log the corrections of the camera by the floor."""
        self._snapshots = calibration.snapshots
        stream.scene.laser_height += calibration.floor_z - stream.scene.floor_z
        stream.scene.floor_z = calibration.floor_z
        stream.hold()
        stream.text(
            "calibration/summary", text.calibration(calibration, stream.scene.recorded_warnings)
        )
        for surface, seen in (("floor", calibration.floor), ("top", calibration.top)):
            if seen is not None:
                stream.scene.flatness.add(surface)
                for when, metres in (("before", seen.before), ("after", seen.after)):
                    image = _residual_image(metres)
                    stream.log_flat(f"calibration/{surface}_{when}", rr.Image(image))

    def log_segmentation(self, stream: Stream, segmentation: Segmentation) -> None:
        """Log labels in colours, as images and as points, and the candidate tables."""
        scene = stream.scene
        scene.height = scene.floor_z + segmentation.height
        self._log_context(stream)
        self._log_views(stream, segmentation.views)
        self._log_candidates(stream, segmentation)
        self._found = segmentation.candidates
        self._snapshots = ()

    def log_refused(self, stream: Stream, refused: TableRefused) -> None:
        """Log labels, points and reasons of a surface that gave no table."""
        self._log_context(stream)
        self._log_views(stream, refused.views)
        stream.hold()
        stream.text("segmentation/summary", text.refused(refused, self._found))
        self._snapshots = ()

    def log_names(self, stream: Stream) -> None:
        """Name the candidates again where the picture of the views has room, all if none won."""
        scene = stream.scene
        floor, failed = scene.floor_z, scene.failed
        room = Room(views_eye(scene), LOW)
        for one in self._found:
            if len(one.hull):
                room.take_line(closed(one.hull, floor + one.height))
        seen = self._seen.get(scene.best if scene.best is not None else max(self._seen, default=0))
        if seen is not None:
            room.take_points(seen, reach=CELL_PX)
        stream.hold()
        for name, is_shown in (("chosen", True), ("others", failed)):
            named = {
                k: one for k, one in enumerate(self._found) if one.chosen == (name == "chosen")
            }
            texts = _short(named, whole=_labels(named, among=self._found), among=self._found)
            middle = middles([closed(one.hull, floor + one.height) for one in named.values()])
            towards = np.subtract(room.eye.position, room.eye.target)[:2]
            placed = room.names(texts, middle, away=towards, shown=is_shown)
            stream.names(
                f"segmentation/candidates/{name}/names",
                np.array(placed.places).reshape(-1, 3),
                texts,
                shown=is_shown,
                leaders=placed.leaders,
            )

    def found(self, stream: Stream) -> tuple[list[str], list[NDArray[np.float32]]]:
        """Return the candidates' names and their hulls as lines (n, 3) in the map."""
        named = dict(enumerate(self._found))
        floor = stream.scene.floor_z
        texts = _short(named, whole=_labels(named, among=self._found), among=self._found)
        return texts, [closed(one.hull, floor + one.height) for one in self._found]

    def told(self) -> str:
        """Return what could have been the table, and the reasons against it."""
        return text.candidates(self._found) if self._found else ""

    def log_as_far_as_it_came(self, stream: Stream) -> None:
        """Log the points of snapshots that nobody labelled, for a run that ended before that."""
        for snapshot in self._snapshots:
            stream.at(snapshot.stamp_ns, snapshot=snapshot.index)
            step = max(1, snapshot.depth.shape[1] // CLOUD_WIDTH)
            few = np.zeros(snapshot.depth.shape, dtype=bool)
            few[::step, ::step] = np.isfinite(snapshot.depth[::step, ::step])
            points = _points_of(snapshot, few, stream.scene.floor_z)
            seen = transform(snapshot.map_from_base.lifted(), points)
            stream.log(
                "segmentation/points",
                rr.Points3D(
                    seen.astype(np.float32),
                    colors=[palette.LEFT_OUT.on_dark],
                    radii=rr.Radius.ui_points(2.0),
                ),
            )
        self._snapshots = ()
        stream.hold()

    def _log_context(self, stream: Stream) -> None:
        stream.scene.has_labels = True
        context = rr.AnnotationContext(
            [(int(label), name, colour) for label, (name, colour) in colours.LABELS.items()]
        )
        stream.rec.log("segmentation", context, static=True)

    def _log_views(self, stream: Stream, views: tuple[ViewSegmentation, ...]) -> None:
        scene = stream.scene
        by_index = {snapshot.index: snapshot for snapshot in self._snapshots}
        for view in views:
            snapshot = by_index.get(view.index)
            if snapshot is None:
                continue
            stream.at(snapshot.stamp_ns, snapshot=view.index)
            if not view.sees_table:
                reason = view.reason or "it does not see the table"
                stream.say(f"snapshot {view.index} set aside: {reason}")
            if view.sees_table:
                self._keep(stream, view, snapshot)
            coarse = max(1, -(-view.labels.shape[1] // SHOWN_WIDTH))
            labels = np.ascontiguousarray(view.labels[::coarse, ::coarse])
            stream.log_flat("segmentation/labels", rr.SegmentationImage(labels))
            step = max(1, view.labels.shape[1] // CLOUD_WIDTH)
            few = np.zeros(view.labels.shape, dtype=bool)
            few[::step, ::step] = view.labels[::step, ::step] != Label.UNKNOWN
            seen = few & np.isfinite(snapshot.depth)
            points = _points_of(snapshot, seen, scene.floor_z)
            in_map = transform(snapshot.map_from_base.lifted(), points).astype(np.float32)
            self._seen[view.index] = thinned(in_map, COARSE)
            stream.log(
                "segmentation/points",
                rr.Points3D(
                    in_map,
                    class_ids=view.labels[seen],
                    radii=rr.Radius.ui_points(2.0),
                ),
            )

    def _keep(self, stream: Stream, view: ViewSegmentation, snapshot: Snapshot) -> None:
        """Keep points for the registration's drawing: the top's rim, some inside, the clutter."""
        cell, scene = stream.config.voxel, stream.scene
        measured = np.isfinite(snapshot.depth)
        is_top = (view.labels == Label.TOP) & measured
        inside = shrunk(is_top, 5, outside=False)

        def kept(pixels: Bools, cell: float) -> NDArray[np.float32]:
            return thinned(_points_of(snapshot, pixels, scene.floor_z), cell)

        few = np.zeros_like(inside)
        few[::INSIDE_PX, ::INSIDE_PX] = inside[::INSIDE_PX, ::INSIDE_PX]
        rim, sparse = kept(is_top & ~inside, cell), kept(few, INSIDE_CELLS * cell)
        scene.tops[view.index] = np.concatenate([rim, sparse])
        scene.clutter[view.index] = kept((view.labels == Label.ON_TOP) & measured, cell)

    def log_tables_found(self, stream: Stream, found: TablesFound) -> None:
        """Log the candidate tables before the choice, so that they are there if it fails."""
        self._found = found.candidates
        stream.hold()
        stream.text("segmentation/summary", text.candidates(found.candidates))
        self._look_at_all(stream.scene)
        _log_hulls(
            stream,
            "candidates/others",
            dict(enumerate(found.candidates)),
            palette.OTHER_SURFACE,
            among=found.candidates,
            show_labels=True,
        )

    def _look_at_all(self, scene: DrawnScene) -> None:
        """Let the views show the first of the candidates."""
        hulls = [one.hull for one in self._found[:MOST_IN_SIGHT] if len(one.hull)]
        if hulls:
            all_of_them = np.concatenate(hulls)
            middle = (all_of_them.min(axis=0) + all_of_them.max(axis=0)) / 2
            scene.centre = (float(middle[0]), float(middle[1]))
            scene.extent = float(np.linalg.norm(all_of_them - middle, axis=1).max())
            scene.found = scene.centre, scene.extent

    def _log_candidates(self, stream: Stream, segmentation: Segmentation) -> None:
        stream.hold()
        mended = {one.index: one.mended_share for one in self._snapshots}
        stream.text("segmentation/summary", text.segmentation(segmentation, mended))
        for one in segmentation.candidates:
            if one.chosen:
                stream.scene.centre = (one.x, one.y)
                if len(one.hull):
                    reach = np.linalg.norm(one.hull - one.hull.mean(axis=0), axis=1)
                    stream.scene.extent = float(max(reach.max(), 0.3))
        numbered = dict(enumerate(segmentation.candidates))
        chosen = {k: one for k, one in numbered.items() if one.chosen}
        others = {k: one for k, one in numbered.items() if not one.chosen}
        for name, hulls, tint in (
            ("chosen", chosen, palette.MODEL),
            ("others", others, palette.OTHER_SURFACE),
        ):
            _log_hulls(
                stream,
                f"candidates/{name}",
                hulls,
                tint,
                among=segmentation.candidates,
                show_labels=name == "chosen",
            )


def _points_of(snapshot: Snapshot, pixels: Bools, floor_z: float) -> Floats:
    """Return the points (n, 3) of some pixels (height, width) in the base, over the map's zero."""
    points = snapshot.points_of(pixels)
    points[:, 2] += floor_z
    return points


def _log_hulls(
    stream: Stream,
    name: str,
    candidates: dict[int, TableCandidate],
    tint: palette.Ink,
    *,
    among: Sequence[TableCandidate],
    show_labels: bool,
) -> None:
    """Draw the candidates' hulls, by their numbers, in place of earlier ones.

    Many have only their numbers as names: the table beside the view says the rest.
    """
    floor = stream.scene.floor_z
    strips = [closed(one.hull, floor + one.height) for one in candidates.values()]
    labels = _labels(candidates, among=among)
    stream.log(
        f"segmentation/{name}",
        rr.LineStrips3D(
            strips,
            colors=[tint.on_dark],
            radii=rr.Radius.ui_points(2.0),
            labels=labels,
            show_labels=False,
        ),
    )
    short = _short(candidates, whole=labels, among=among)
    stream.names(f"segmentation/{name}/names", middles(strips), short, shown=show_labels)


def _labels(candidates: dict[int, TableCandidate], *, among: Sequence[TableCandidate]) -> list[str]:
    """Return numbers and heights, and where all candidates are few also what was made of them."""
    return [
        f"{number}: {one.height:.2f} m high"
        + (f", {one.reason or 'a table'}" if len(among) <= FEW_CANDIDATES else "")
        for number, one in candidates.items()
    ]


def _short(
    candidates: dict[int, TableCandidate], *, whole: list[str], among: Sequence[TableCandidate]
) -> list[str]:
    """Return the names that are shown: those of many are their numbers, but for the chosen one."""
    is_few = len(among) <= FEW_CANDIDATES
    return [
        text if is_few or one.chosen else str(number)
        for text, (number, one) in zip(whole, candidates.items(), strict=True)
    ]


def _residual_image(metres: Floats) -> NDArray[np.uint8]:
    """Colour heights above level, by the scale of signed distances; grey: not seen."""
    colour = colours.diverging(metres, RESIDUAL_RANGE_M)
    colour[~np.isfinite(metres)] = NOT_SEEN
    block = np.ones((BLOCK_PX, BLOCK_PX, 1), dtype=np.uint8)
    return np.kron(colour, block)
