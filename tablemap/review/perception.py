"""The calibrated camera, the segmented views and the tables that could be meant."""

from __future__ import annotations

import numpy as np
import rerun as rr
from scipy import ndimage

from tablemap.calibration import Calibration
from tablemap.geometry import Floats, transform
from tablemap.review import colours, text
from tablemap.review.clouds import closed, thinned
from tablemap.review.stream import Stream
from tablemap.segmentation import Label, Segmentation, ViewSegmentation
from tablemap.snapshots import Snapshot

SHOWN_WIDTH = 640
CLOUD_WIDTH = 110
INSIDE_CELLS = 5


class Perception:
    """Draws segmentations; it keeps the corrected snapshots that labels belong to."""

    def __init__(self) -> None:
        self._snapshots: tuple[Snapshot, ...] = ()

    def log_calibration(self, stream: Stream, calibration: Calibration) -> None:
        """Log what the floor said about the camera."""
        self._snapshots = calibration.snapshots
        stream.hold()
        stream.text("calibration/summary", text.calibration(calibration))
        shown = (calibration.floor_rms_before * 1000, calibration.floor_rms_after * 1000)
        stream.log_flat("calibration/floor_rms_mm", rr.BarChart(np.array(shown)))

    def log_segmentation(self, stream: Stream, segmentation: Segmentation) -> None:
        """Log labels in colours, as images and as points, and the candidate tables."""
        scene = stream.scene
        scene.height = segmentation.height
        context = rr.AnnotationContext(
            [(int(label), name, colour) for label, (name, colour) in colours.LABELS.items()]
        )
        stream.rec.log("segmentation", context, static=True)
        by_index = {snapshot.index: snapshot for snapshot in self._snapshots}
        for view in segmentation.views:
            snapshot = by_index.get(view.index)
            if snapshot is None:
                continue
            stream.at(snapshot.stamp_ns, snapshot=view.index)
            if not view.sees_table:
                reason = view.reason or "it does not see the table"
                stream.log_flat(
                    "log", rr.TextLog(f"snapshot {view.index} set aside: {reason}", level="INFO")
                )
            points = snapshot.points_in_base()
            if view.sees_table:
                self._keep(stream, view, points)
            coarse = max(1, -(-view.labels.shape[1] // SHOWN_WIDTH))
            labels = np.ascontiguousarray(view.labels[::coarse, ::coarse])
            stream.log_flat("segmentation/labels", rr.SegmentationImage(labels))
            step = max(1, view.labels.shape[1] // CLOUD_WIDTH)
            few, classes = points[::step, ::step], view.labels[::step, ::step]
            seen = np.isfinite(few).all(axis=-1) & (classes != Label.UNKNOWN)
            stream.log(
                "segmentation/points",
                rr.Points3D(
                    transform(snapshot.map_from_base.lifted(), few[seen]).astype(np.float32),
                    class_ids=classes[seen],
                    radii=rr.Radius.ui_points(2.0),
                ),
            )
        self._log_candidates(stream, segmentation)
        self._snapshots = ()

    def _keep(self, stream: Stream, view: ViewSegmentation, points: Floats) -> None:
        """Keep what registration will move: the top's rim, a little of its inside, the clutter."""
        cell = stream.config.voxel
        is_top = (view.labels == Label.TOP) & np.isfinite(points[..., 2])
        inside = ndimage.binary_erosion(is_top, iterations=2)
        rim = thinned(points[is_top & ~inside], cell)
        sparse = thinned(points[inside], INSIDE_CELLS * cell)
        stream.scene.tops[view.index] = np.concatenate([rim, sparse])
        on_top = (view.labels == Label.ON_TOP) & np.isfinite(points[..., 2])
        stream.scene.clutter[view.index] = thinned(points[on_top], cell)

    def _log_candidates(self, stream: Stream, segmentation: Segmentation) -> None:
        stream.hold()
        stream.text("segmentation/summary", text.segmentation(segmentation))
        if not segmentation.candidates:
            return
        for one in segmentation.candidates:
            if one.chosen:
                stream.scene.centre = (one.x, one.y)
                if len(one.hull):
                    reach = np.linalg.norm(one.hull - one.hull.mean(axis=0), axis=1)
                    stream.scene.extent = float(max(reach.max(), 0.3))
        for name, tint in (("chosen", colours.USED), ("others", colours.MUTED)):
            shown = [
                (one, k)
                for k, one in enumerate(segmentation.candidates)
                if one.chosen == (name == "chosen") and len(one.hull) > 2
            ]
            if shown:
                stream.log(
                    f"segmentation/candidates/{name}",
                    rr.LineStrips3D(
                        [closed(one.hull, one.height) for one, _ in shown],
                        colors=[tint],
                        radii=rr.Radius.ui_points(2.0),
                        labels=[f"table {k}: {one.reason or name}" for one, k in shown],
                        show_labels=name == "chosen",
                    ),
                )
