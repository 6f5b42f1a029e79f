"""Drawings of the top: its edges in each view, the fitted candidates, and the chosen one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import shapely
from numpy.typing import NDArray

from tablemap import palette
from tablemap.geometry import Floats, Pose2
from tablemap.review import colours, text, wording
from tablemap.review.budget import bars
from tablemap.review.clouds import closed, raised, thinned
from tablemap.review.eyes import edges_eye
from tablemap.review.room import Room
from tablemap.review.stream import Stream
from tablemap.stages.outline import EdgeKind, Outline, ViewEdges
from tablemap.stages.surface import Surface, SurfaceEdge

LIFT = 0.003
RESIDUAL_LIMIT = 0.005
PLOT_WIDTH = 400.0
PLOT_HEIGHT = 100.0
PLOT_LIMIT_MM = 10.0
LABEL_DROP = 11.0  # the viewer writes labels this far below their points
BAR_PITCH = 28  # of the bars of a budget: title, bar, and the names of its parts
HISTOGRAM_BINS = 41
TOUCHES = "touches the table"
TOP_CELLS = 3
ALL_SEEN = 0.995
MOST_CORNERS = 12
DOT = 3  # pixels, radius of a drawn point


class TopDrawing:
    """Draws outline and surface; it stores the edges until the registered poses are known."""

    def __init__(self) -> None:
        self._poses: tuple[Pose2, ...] = ()
        self._surface: Surface | None = None
        self._edges: list[NDArray[np.float32]] = []

    def take_poses(self, poses: tuple[Pose2, ...]) -> None:
        """Take the registered poses, by snapshot index."""
        self._poses = poses

    def log_outline(self, stream: Stream, outline: Outline) -> None:
        """Log edge points by kind and view, and the top's height by each view."""
        scene = stream.scene
        scene.height = scene.floor_z + outline.height
        stream.series("outline/height_mm/by_view", palette.TABLE_EDGE.on_dark)
        stream.series("outline/height_mm/all_views", palette.MODEL.on_dark)
        for index, height in outline.height_by_view.items():
            if index < len(scene.stamps_ns):
                stream.at(scene.stamps_ns[index], snapshot=index)
                stream.log_flat("outline/height_mm/by_view", rr.Scalars(1000 * height))
                stream.log_flat("outline/height_mm/all_views", rr.Scalars(1000 * outline.height))
        stream.hold()
        stream.text("outline/summary", text.outline(outline))
        self._edges = []
        for view in outline.views:
            self.log_view(stream, view)

    def log_view(self, stream: Stream, view: ViewEdges) -> None:
        """Log one view's edge points by their kind, and the points that it saw as top."""
        poses = self._poses or tuple(stream.scene.localised)
        if view.index >= len(poses):
            return
        pose, height = poses[view.index], stream.scene.height + LIFT
        stream.hold()
        for kind, (name, colour) in colours.EDGES.items():
            if kind == EdgeKind.BORDER:  # no edge of anything: the images show it
                continue
            points = view.points[view.kind == kind]
            self._edges.append(raised(pose.apply(points), height))
            if len(points):
                stream.log(
                    f"outline/edges/{name}/{view.index:02d}",
                    rr.Points3D(
                        raised(pose.apply(points), height),
                        colors=[colour],
                        radii=rr.Radius.ui_points(2.5),
                    ),
                )
        top = thinned(view.top, TOP_CELLS * stream.config.voxel)
        if len(top):
            stream.log(
                f"outline/top/{view.index:02d}",
                rr.Points3D(
                    raised(pose.apply(top), stream.scene.height),
                    colors=[(*colours.of_stop(view.index), 120)],
                    radii=rr.Radius.ui_points(1.0),
                ),
            )

    def log_surface(self, stream: Stream, surface: Surface) -> None:
        """Log hull, candidates with their scores, and the chosen shape with its residuals."""
        scene = stream.scene
        scene.height = scene.floor_z + surface.height.value
        scene.outline = surface.outline
        if len(surface.outline):
            scene.centre, scene.yaw = (surface.pose.x, surface.pose.y), surface.pose.yaw
            away = surface.outline - np.array(scene.centre)
            scene.extent = float(max(np.linalg.norm(away, axis=1).max(), 0.2))
        height = scene.height + LIFT
        stream.hold()
        stream.text("surface/summary", text.surface(surface))
        if len(surface.hull) > 2:
            _log_line(
                stream,
                "surface/hull",
                closed(surface.hull, height),
                palette.LEFT_OUT.on_dark,
                "hull",
            )
        if surface.beside is not None:
            stream.log(
                "surface/beside",
                rr.LineStrips3D(
                    [closed(surface.beside, height)],
                    colors=[palette.OTHER_SURFACE.on_dark],
                    radii=rr.Radius.ui_points(1.5),
                    labels=[TOUCHES],
                    show_labels=False,
                ),
            )
        _log_budget(stream, surface)
        stream.log_flat("surface/candidates", rr.Clear(recursive=True))  # of an earlier fit
        names = wording.candidate_names(surface.candidates)
        for named, one in zip(names, surface.candidates, strict=True):
            tint = palette.MODEL if named == names[0] else palette.LEFT_OUT
            path = f"surface/candidates/{named.replace(' ', '_')}"
            if named == names[0]:
                scene.chosen = path
            if len(one.outline):
                line = closed(one.outline, height + LIFT)
                _log_line(stream, path, line, tint.on_dark, f"{named}: {one.score:.3f}")
        if len(surface.edges):
            labels = [_label(k, edge) for k, edge in enumerate(surface.edges)]
            stream.log(
                "surface/chosen",
                rr.LineStrips3D(
                    [raised(edge.points, height + 2 * LIFT) for edge in surface.edges],
                    colors=[colours.STATUS[edge.status] for edge in surface.edges],
                    radii=rr.Radius.ui_points(1.2),
                    labels=labels,
                    show_labels=False,
                ),
            )
            self._surface = surface
            self.log_names(stream)
        if len(surface.points):
            stream.log(
                "surface/residuals",
                rr.Points3D(
                    raised(surface.points, height),
                    colors=colours.diverging(surface.residuals, RESIDUAL_LIMIT),
                    radii=rr.Radius.ui_points(2.5),
                ),
            )
            _log_unrolled(stream, surface)
            _log_histogram(stream, surface.residuals)

    def log_names(self, stream: Stream, bands: Sequence[NDArray[np.floating]] = ()) -> Room:
        """Name the sides outside, clear of their points and of lines (n, 3) such as ``bands``.

        Return the room that the view's picture has left.
        """
        surface, scene = self._surface, stream.scene
        room = Room(edges_eye(scene))
        if surface is None:
            return room
        height = scene.height + LIFT
        room.take_solid(surface.outline, height, height)
        room.take_points(np.concatenate([np.zeros((0, 3)), *self._edges]), reach=DOT)
        for line in bands:
            room.take_line(line, width=DOT)
        if surface.beside is not None:
            room.take_line(closed(surface.beside, height), width=DOT)
        labels = [_label(k, edge) for k, edge in enumerate(surface.edges)]
        middles = raised(np.array([edge.points.mean(axis=0) for edge in surface.edges]), height)
        shown = len(labels) <= MOST_CORNERS
        placed = room.names(
            labels,
            middles,
            away=middles[:, :2] - np.array(scene.centre or (0.0, 0.0)),
            shown=shown,
        )
        stream.names(
            "surface/chosen/names", placed.places, labels, shown=shown, leaders=placed.leaders
        )
        if surface.beside is not None:
            middle = surface.beside.mean(axis=0)
            away = middle - np.array(scene.centre or (0.0, 0.0))
            placed = room.names([TOUCHES], raised(middle, height), away=away)
            stream.names("surface/beside/names", placed.places, [TOUCHES], leaders=placed.leaders)
        return room


def _label(number: int, edge: SurfaceEdge) -> str:
    """Return a side's number and length, with a note if it was not fully seen."""
    length = float(np.linalg.norm(np.diff(edge.points, axis=0), axis=1).sum())
    doubt = "" if edge.status == "measured" else f", {edge.status}"
    is_partly_seen = 0 < edge.seen_fraction < ALL_SEEN
    seen = f", {100 * edge.seen_fraction:.0f} % seen" if is_partly_seen else ""
    return f"{number}: {length:.3f} m{doubt}{seen}"


def _log_line(
    stream: Stream, path: str, line: NDArray[np.float32], tint: palette.Colour, name: str
) -> None:
    stream.log(
        path,
        rr.LineStrips3D(
            [line], colors=[tint], radii=rr.Radius.ui_points(1.5), labels=[name], show_labels=False
        ),
    )


def _log_histogram(stream: Stream, residuals: Floats) -> None:
    millimetres = 1000 * residuals[np.isfinite(residuals)]
    edges = np.linspace(-PLOT_LIMIT_MM, PLOT_LIMIT_MM, HISTOGRAM_BINS + 1)
    counts, _ = np.histogram(np.clip(millimetres, edges[0], edges[-1]), bins=edges)
    stream.log_flat(
        "surface/residual_histogram_mm",
        rr.BarChart(
            counts, color=palette.TABLE_EDGE.on_dark, abscissa=(edges[1:] + edges[:-1]) / 2
        ),
    )


def _log_unrolled(stream: Stream, surface: Surface) -> None:
    """Plot residuals in millimetres along the outline, unrolled from its first corner."""
    if len(surface.outline) < 3:
        return
    ring = shapely.LinearRing(surface.outline)
    along = shapely.line_locate_point(ring, shapely.points(surface.points)) / ring.length
    millimetres = np.clip(1000 * np.nan_to_num(surface.residuals), -PLOT_LIMIT_MM, PLOT_LIMIT_MM)
    scale = PLOT_HEIGHT / PLOT_LIMIT_MM
    marks = [-10.0, -5.0, 0.0, 5.0, 10.0]
    stream.log_flat(
        "surface/unrolled/axes",
        rr.LineStrips2D(
            [[(0.0, -scale * mark), (PLOT_WIDTH, -scale * mark)] for mark in marks],
            colors=[(palette.LEFT_OUT if mark else palette.TEXT).on_dark for mark in marks],
            radii=rr.Radius.ui_points(0.7),
        ),
    )
    stream.flat_names(
        "surface/unrolled/labels",
        [(-32.0, -scale * mark - LABEL_DROP) for mark in marks]
        + [(PLOT_WIDTH / 2, PLOT_HEIGHT + 10.0)],
        [f"{mark:+.0f} mm" if mark else "0 mm" for mark in marks]
        + [f"once round the outline, {ring.length:.2f} m"],
    )
    corners = shapely.line_locate_point(ring, shapely.points(surface.outline)) / ring.length
    if len(corners) <= MOST_CORNERS:
        stream.log_flat(
            "surface/unrolled/corners",
            rr.LineStrips2D(
                [
                    [(PLOT_WIDTH * share, -PLOT_HEIGHT), (PLOT_WIDTH * share, PLOT_HEIGHT)]
                    for share in corners
                ],
                colors=[palette.LEFT_OUT.on_dark],
                radii=rr.Radius.ui_points(0.7),
            ),
        )
    stream.log_flat(
        "surface/unrolled/residuals",
        rr.Points2D(
            np.column_stack([PLOT_WIDTH * along, -scale * millimetres]),
            colors=colours.diverging(surface.residuals, RESIDUAL_LIMIT),
            radii=rr.Radius.ui_points(1.5),
        ),
    )


def _log_budget(stream: Stream, surface: Surface) -> None:
    """Draw one bar a figure: the parts of its variance, 100 units wide."""
    drawn = bars(surface)
    if not drawn:
        return
    parts = [(row, one) for row, bar in enumerate(drawn) for one in bar.stretches]
    stream.log_flat(
        "surface/budget/parts",
        rr.Boxes2D(
            mins=[(100 * one.start, BAR_PITCH * row + 10) for row, one in parts],
            sizes=[(100 * (one.end - one.start), 6) for _, one in parts],
            colors=[one.colour for _, one in parts],
            labels=[one.label or one.part for _, one in parts],
            show_labels=False,
        ),
    )
    named = [(row, one) for row, one in parts if one.label]
    stream.flat_names(
        "surface/budget/names",
        [(50 * (one.start + one.end), BAR_PITCH * row + 16) for row, one in named]
        + [(50, BAR_PITCH * row + 1) for row in range(len(drawn))],
        [one.label for _, one in named] + [bar.title for bar in drawn],
    )
