"""Edge points and the model drawn into the camera's images: the first check of a doubtful run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from tablemap import palette
from tablemap.events import OfTable, OtherTable
from tablemap.geometry import Floats, Pose2, invert, transform
from tablemap.model import TableLeg, TableModel
from tablemap.review import colours, digits
from tablemap.review.clouds import closed, raised
from tablemap.review.doubted import DoubtLines
from tablemap.review.images import colour_archetype, depth_archetype
from tablemap.review.sensors import IMAGE_PLANE, log_images
from tablemap.review.solid import DRAWN_THICKNESS
from tablemap.review.stream import Stream
from tablemap.review.supports import section
from tablemap.review.tables import entity
from tablemap.stages.calibration import Calibration
from tablemap.stages.outline import EdgeKind, Outline
from tablemap.stages.segmentation import TableCandidate
from tablemap.stages.snapshots import Snapshot

SPACING = 0.01  # metres between the points of a line, so that the image can cut it anywhere
NEAREST = 0.05  # metres before the camera
DIGIT_SHARE = 0.04  # of the image's height
DASH_PX = 7.0
PIXEL_CENTRE = 0.5  # the viewer counts from a pixel's corner
LINE, POINT = 1.5, 1.7  # radii, pixels of the screen


class Projection:
    """Draws into the images of every snapshot; it stores the corrected cameras."""

    def __init__(self) -> None:
        self._snapshots: dict[int, Snapshot] = {}
        self._recorded: dict[int, Snapshot] = {}
        self._unused: set[int] = set()
        self._found: tuple[TableCandidate, ...] = ()
        self._has_model = False

    def take_cameras(self, calibration: Calibration) -> None:
        """Take the snapshots, as recorded and corrected."""
        self._recorded = {snapshot.index: snapshot for snapshot in calibration.recorded}
        self._snapshots = {snapshot.index: snapshot for snapshot in calibration.snapshots}

    def take_used(self, used: tuple[bool, ...]) -> None:
        """Take which snapshots are used, by index."""
        self._unused = {index for index, is_used in enumerate(used) if not is_used}

    def _in_turn(self, stream: Stream) -> Iterator[tuple[Snapshot, str]]:
        """Yield each snapshot at its time, with its image's frame.

        The best one comes last, as the timeline ``stage`` shows what was logged last.
        """
        names = stream.scene.names
        frame = (names.camera if names else "camera") + IMAGE_PLANE
        ordered = sorted(self._snapshots.values(), key=lambda one: one.index == stream.scene.best)
        for snapshot in ordered:
            stream.at(snapshot.stamp_ns, snapshot=snapshot.index)
            yield snapshot, frame
        stream.hold()

    def _best(self, seen: dict[int, int]) -> int | None:
        used = {index: much for index, much in seen.items() if much and index not in self._unused}
        return max(used, key=lambda index: used[index], default=None)

    def bring_to_front(self, stream: Stream, seen: dict[int, int]) -> None:
        """Show the view with most of the table on ``stage``, where no snapshot is chosen.

        ``seen`` is the number of pixels, or edge points, of the table in each view, by index.
        """
        best = self._best(seen)
        if best is None or best == stream.scene.best or best not in self._recorded:
            return
        stream.scene.best = best
        stream.at_stage()
        log_images(stream, self._recorded[best])
        stream.hold()

    def log_edges(self, stream: Stream, outline: Outline) -> None:
        """Log each view's edge points at their pixels, by kind; a view without any gets none."""
        views = {view.index: view for view in outline.views}
        for snapshot, frame in self._in_turn(stream):
            view = views.get(snapshot.index)
            for kind, (name, tint) in colours.EDGES.items():
                pixels = np.zeros((0, 2)) if view is None else view.pixels[view.kind == kind]
                stream.log(
                    f"camera/edges/{name}",
                    rr.Points2D(
                        (pixels + PIXEL_CENTRE).astype(np.float32),
                        colors=[tint],
                        radii=rr.Radius.ui_points(POINT),
                    ),
                    frame=frame,
                )

    def log_failure(self, stream: Stream) -> None:
        """Log the surfaces that were found in place of a model that was refused."""
        if not self._has_model:
            return
        self.log_candidates(stream, self._found)
        for _, frame in self._in_turn(stream):
            for part in ("model/outline", "model/underside", "model/legs", "doubts"):
                stream.log(f"camera/{part}", rr.LineStrips2D([]), frame=frame)

    def log_candidates(self, stream: Stream, candidates: tuple[TableCandidate, ...]) -> None:
        """Log where each image shows the surfaces that could be the table, as localised."""
        self._found = candidates or self._found
        for snapshot, frame in self._in_turn(stream):
            map_from_base = snapshot.map_from_base.lifted()
            map_from_base[2, 3] = stream.scene.floor_z
            seen: dict[int, list[NDArray[np.float32]]] = {}
            for number, one in enumerate(candidates):
                line = closed(one.hull, stream.scene.floor_z + one.height)
                pieces = in_image(snapshot, map_from_base, line, dashed=False) if len(line) else []
                if pieces:
                    seen[number] = pieces
            high = DIGIT_SHARE * snapshot.camera.height
            for number, place in places_apart(seen).items():
                seen[number] += digits.number(number, place - [0.0, 1.3 * high], high)
            strips = [piece for pieces in seen.values() for piece in pieces]
            labels = [
                f"{number}: {candidates[number].height:.2f} m"
                for number, pieces in seen.items()
                for _ in pieces
            ]
            stream.log(
                "camera/candidates",
                rr.LineStrips2D(
                    strips,
                    colors=[palette.OTHER_SURFACE.on_dark],
                    radii=rr.Radius.ui_points(LINE),
                    labels=labels,
                    show_labels=False,
                ),
                frame=frame,
            )

    def log_model(self, stream: Stream, model: TableModel, doubts: Sequence[DoubtLines]) -> None:
        """Log the model's lines in each camera's image, as if nothing hid them, and its doubts."""
        self.log_candidates(stream, ())
        self._log_lines(stream, model)
        if doubts:
            self._log_doubts(stream, model, doubts)
        self._has_model = True

    def _log_doubts(self, stream: Stream, model: TableModel, doubts: Sequence[DoubtLines]) -> None:
        for snapshot, frame in self._in_turn(stream):
            if snapshot.index >= len(model.snapshots):
                continue
            pieces = [
                (one.name, piece)
                for one in doubts
                for line in one.lines
                for piece in in_image(snapshot, base_in_map(model, snapshot), line, dashed=False)
            ]
            stream.log(
                "camera/doubts",
                rr.LineStrips2D(
                    [piece for _, piece in pieces],
                    colors=[palette.DOUBT.on_dark],
                    radii=rr.Radius.ui_points(LINE),
                    labels=[name for name, _ in pieces],
                    show_labels=False,
                ),
                frame=frame,
            )

    def take_other(self, stream: Stream, one: OfTable) -> None:
        """Take which view shows most of the edge of a table beside the chosen one."""
        scene = stream.scene.tables.get(one.number)
        if scene is not None and isinstance(one.result, Outline):
            scene.best = self._best(edge_points_seen(one.result))

    def log_other(self, stream: Stream, other: OtherTable) -> None:
        """Log the lines of another table's model in each camera's image, below its entity.

        The image that shows most of it is logged once more, with its lines: a view shows the images
        of the snapshot at the cursor, and few of these show this table.
        """
        scene = stream.scene.tables.get(other.number)
        if scene is None or isinstance(other.outcome, str):
            return
        with stream.within(entity(other.number), scene):
            self._log_lines(stream, other.outcome)
            best = self._recorded.get(scene.best) if scene.best is not None else None
            if best is not None and best.index < len(other.outcome.snapshots):
                _log_one_image(stream, best)
                drawn = _lines_in(self._snapshots[best.index], other.outcome)
                for part, strips in drawn.items():
                    stream.log_flat(f"view/{part}", _strips(part, strips))

    def _log_lines(self, stream: Stream, model: TableModel) -> None:
        for snapshot, frame in self._in_turn(stream):
            if snapshot.index < len(model.snapshots):
                for part, strips in _lines_in(snapshot, model).items():
                    stream.log(f"camera/model/{part}", _strips(part, strips), frame=frame)


Strips = list[tuple[NDArray[np.float32], str]]
"""Lines (n, 2) in an image, each with the status of what it shows."""


def _lines_in(snapshot: Snapshot, model: TableModel) -> dict[str, Strips]:
    """Return the model's lines in a snapshot's image, by part."""
    pose = base_in_map(model, snapshot)
    drawn: dict[str, Strips] = {"outline": [], "underside": [], "legs": []}
    for part, status, line in model_lines(model):
        pieces = in_image(snapshot, pose, line, dashed=status != "measured")
        drawn[part] += [(piece, status) for piece in pieces]
    return drawn


def base_in_map(model: TableModel, snapshot: Snapshot) -> Floats:
    """Return the pose (4, 4) of a snapshot's base on the floor, as the model has it."""
    base = model.snapshots[snapshot.index].map_from_base
    pose = Pose2(base.x, base.y, base.yaw).lifted()
    pose[2, 3] = model.floor_z
    return pose


def _strips(part: str, strips: Strips) -> rr.LineStrips2D:
    return rr.LineStrips2D(
        [strip for strip, _ in strips],
        colors=[
            palette.LEFT_OUT.on_dark if part == "underside" else colours.STATUS[status]
            for _, status in strips
        ],
        radii=rr.Radius.ui_points(LINE if part != "underside" else LINE / 2),
    )


def _log_one_image(stream: Stream, snapshot: Snapshot) -> None:
    """Log a snapshot's colour where it fits the depth, else its depth, for the whole recording."""
    message = snapshot.colour_message
    colour = colour_archetype(message) if message and stream.scene.colour_fits else None
    image = colour or depth_archetype(snapshot.depth_message, snapshot.depth)
    stream.log_flat("view/image", image)


def edge_points_seen(outline: Outline) -> dict[int, int]:
    """Return how many points of the table's own edge each view has, by its index."""
    return {view.index: int(np.sum(view.kind == EdgeKind.TABLE)) for view in outline.views}


def model_lines(model: TableModel) -> Iterator[tuple[str, str, NDArray[np.floating]]]:
    """Yield the model's lines: their part, their status, and points (n, 3) in the map."""
    surface = model.surface
    top = model.floor_z + surface.height.value
    bottom = top - (surface.thickness.value if surface.thickness else DRAWN_THICKNESS)
    for edge in surface.edges:
        side = np.array(edge.points, dtype=np.float64).reshape(-1, 2)
        yield "outline", edge.status, raised(side, top)
        if surface.thickness:
            yield "underside", edge.status, raised(side, bottom)
    for leg in model.legs:
        ring = _outline_of(leg)
        yield "legs", leg.status, raised(ring, model.floor_z)
        for x, y in ring[:: max(1, len(ring) // 4)]:
            yield "legs", leg.status, np.array([[x, y, model.floor_z], [x, y, bottom]])


def _outline_of(leg: TableLeg) -> Floats:
    """Return a leg's closed cross-section (n, 2) in the map."""
    sizes = {name: figure.value for name, figure in leg.dimensions.items()}
    return section(leg.shape, Pose2(leg.x, leg.y, leg.yaw), sizes)


def places_apart(lines: dict[int, list[NDArray[np.float32]]]) -> dict[int, Floats]:
    """Return a place (2,) on each line, given as pieces (n, 2), as far from the others' as can be.

    Each line's number stands there: lines that nearly coincide have theirs side by side.
    """
    places: dict[int, Floats] = {}
    for number, pieces in lines.items():
        points = np.concatenate(pieces).astype(np.float64)
        if not places:
            places[number] = points[np.argmin(points[:, 0])]
            continue
        taken = np.array(list(places.values()))
        away = np.linalg.norm(points[:, None] - taken, axis=-1).min(axis=1)
        places[number] = points[np.argmax(away)]
    return places


def in_image(
    snapshot: Snapshot, map_from_base: Floats, line: NDArray[np.floating], *, dashed: bool
) -> list[NDArray[np.float32]]:
    """Return the pieces (n, 2) of a line (m, 3) in the map that lie in a snapshot's image.

    They are columns and rows counted from the image's corner. ``map_from_base`` (4, 4) has the
    floor's height, from which the snapshot's camera counts its own.
    """
    camera_from_map = invert(map_from_base @ snapshot.base_from_camera)
    points = transform(camera_from_map, _dense(line))
    camera = snapshot.camera
    points[points[:, 2] <= NEAREST] = np.nan
    pixels = camera.project(points) + PIXEL_CENTRE
    with np.errstate(invalid="ignore"):
        is_in = ((pixels >= 0) & (pixels <= (camera.width, camera.height))).all(axis=1)
    if dashed:
        steps = np.linalg.norm(np.diff(pixels, axis=0, prepend=pixels[:1]), axis=1)
        is_in &= np.floor(np.cumsum(np.nan_to_num(steps)) / DASH_PX) % 2 == 0
    bounds = np.flatnonzero(np.diff(is_in.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    return [pixels[a:b].astype(np.float32) for a, b in bounds if b - a > 1]


def _dense(line: NDArray[np.floating]) -> Floats:
    """Return a line (m, 3) with a point every `SPACING`, its corners kept."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    count = max(2, int(along[-1] / SPACING))
    places = np.unique(np.concatenate([along, np.linspace(0.0, along[-1], count)]))
    return np.column_stack([np.interp(places, along, line[:, k]) for k in range(3)])
