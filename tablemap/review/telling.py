"""What the overview shows at each stage: the first findings, until the model takes their place."""

from __future__ import annotations

import numpy as np
import rerun as rr

from tablemap import palette
from tablemap.geometry import Pose2
from tablemap.review import colours
from tablemap.review.clouds import closed, middles, raised
from tablemap.review.scene import FEW_STOPS
from tablemap.review.stream import Stream
from tablemap.stages.outline import EdgeKind, Outline
from tablemap.stages.segmentation import Segmentation
from tablemap.stages.snapshots import Snapshots
from tablemap.stages.surface import Surface

ARROW = 0.25  # metres
MOST_NAMED = 8
FLOOR = 0.02  # metres above it


class Telling:
    """Draws below ``/story``; each stage's finding takes the place of what it made obsolete."""

    def __init__(self) -> None:
        self._poses: tuple[Pose2, ...] = ()

    def take_poses(self, poses: tuple[Pose2, ...]) -> None:
        """Take the registered poses, by snapshot index."""
        self._poses = poses

    def log_stops(self, stream: Stream, taken: Snapshots) -> None:
        """Draw where the localisation has the stops."""
        stream.hold()
        poses = [snapshot.map_from_base for snapshot in taken.snapshots]
        ahead = np.array([pose.rotate(np.array([ARROW, 0.0])) for pose in poses]).reshape(-1, 2)
        places = np.array([pose.translation for pose in poses]).reshape(-1, 2)
        stream.log(
            "story/stops",
            rr.Arrows3D(
                origins=raised(places, FLOOR),
                vectors=raised(ahead, 0.0),
                colors=[palette.LOCALISED.on_dark],
                radii=rr.Radius.ui_points(2.0),
            ),
        )
        numbers = [str(snapshot.index) for snapshot in taken.snapshots]
        shown = len(poses) <= FEW_STOPS
        stream.names("story/stops/names", raised(places, FLOOR), numbers, shown=shown)

    def log_candidates(self, stream: Stream, segmentation: Segmentation) -> None:
        """Draw what could be the table, with heights."""
        found = segmentation.candidates
        strips = [closed(one.hull, stream.scene.floor_z + one.height) for one in found]
        stream.log(
            "story/candidates",
            rr.LineStrips3D(
                strips,
                colors=[
                    (palette.MODEL if one.chosen else palette.OTHER_SURFACE).on_dark
                    for one in found
                ],
                radii=rr.Radius.ui_points(2.0),
            ),
        )
        heights = [f"{k}: {one.height:.2f} m high" for k, one in enumerate(found)]
        shown = len(found) <= MOST_NAMED
        stream.names("story/candidates/names", middles(strips), heights, shown=shown)

    def log_edges(self, stream: Stream, outline: Outline) -> None:
        """Draw the table's own edge points of all views, in place of the candidates."""
        points = [
            self._poses[view.index].apply(view.points[view.kind == EdgeKind.TABLE])
            for view in outline.views
            if view.index < len(self._poses)
        ]
        stream.log(
            "story/edges",
            rr.Points3D(
                raised(np.concatenate([np.zeros((0, 2)), *points]), stream.scene.height),
                colors=[colours.EDGES[EdgeKind.TABLE][1]],
                radii=rr.Radius.ui_points(2.0),
            ),
        )
        _empty(stream, "candidates", "stops")

    def log_top(self, stream: Stream, surface: Surface) -> None:
        """Draw the fitted sides."""
        stream.log(
            "story/top",
            rr.LineStrips3D(
                [raised(edge.points, stream.scene.height) for edge in surface.edges],
                colors=[colours.STATUS[edge.status] for edge in surface.edges],
                radii=rr.Radius.ui_points(2.0),
            ),
        )

    def end(self, stream: Stream) -> None:
        """Take all of it away: the model is there."""
        stream.hold()
        _empty(stream, "stops", "candidates", "edges", "top")


def _empty(stream: Stream, *names: str) -> None:
    for name in names:
        if name == "stops":
            stream.log("story/stops", rr.Arrows3D(origins=[], vectors=[]))
        elif name == "edges":
            stream.log("story/edges", rr.Points3D([]))
        else:
            stream.log(f"story/{name}", rr.LineStrips3D([]))
        if name in ("stops", "candidates"):
            stream.names(f"story/{name}/names", [], [])
